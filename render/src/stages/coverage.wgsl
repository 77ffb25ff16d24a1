// Share of a cell that holds data, the cell counted from the first held. Reads `domain`.
fn share_of(cell: u32) -> f32 {
    if (values.has_coverage == 0u) { return 1.0; }
    return f32(domain[cell]) / f32(COVERED);
}
