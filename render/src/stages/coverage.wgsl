// Share of a cell that holds data, the cell counted from the first held. Reads `domain`.
fn share_of(cell: u32) -> f32 {
    if (!feature(HAS_COVERAGE, values.has_coverage == 1u)) { return 1.0; }
    return f32(domain[cell]) / f32(COVERED);
}
