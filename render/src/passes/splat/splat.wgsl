// From cells to stored splats in one pass: interpolate, generate, project; give depth to the light and count the lists.
// One invocation makes a few particles of a cell; a workgroup covers a square of cells, whose particles are near one
// another in the picture and in the light.
@group(0) @binding(4) var<storage, read> value_before: array<f32>;
@group(0) @binding(5) var<storage, read> value_after: array<f32>;
@group(0) @binding(6) var<storage, read> carbon_before: array<f32>;
@group(0) @binding(7) var<storage, read> carbon_after: array<f32>;
// Bound but never read where uncertainty is not drawn.
@group(0) @binding(12) var<storage, read> uncertainty_before: array<f32>;
@group(0) @binding(13) var<storage, read> uncertainty_after: array<f32>;
// Bound but never read where every cell with data is covered all over.
@group(0) @binding(14) var<storage, read> domain: array<u32>;

// Carbon of a cell, counted from the first held; what is missing has accumulated nothing.
fn carbon_of(cell: u32) -> f32 {
    if (!feature(HAS_ACCUMULATED, values.has_accumulated == 1u)) { return 0.0; }
    let carbon = interpolated(carbon_before[cell], carbon_after[cell], values.accumulated_weight);
    if (is_missing(carbon)) { return 0.0; }
    return carbon;
}

@compute @workgroup_size(SQUARE, SQUARE)
fn splat(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    clear_table(invocation);
    workgroupBarrier();
    let down = workgroup.y * SQUARE + local.y;
    let slot = workgroup.x * SQUARE + local.x;
    let row = cells.first_row + down;
    var value = MISSING;
    var carbon = 0.0;
    var uncertainty = 0.0;
    var share = 1.0;
    if (down < cells.row_count && slot < cells.slot_count) {
        let cell = row * grid.cols + cols[slot].index - grid.held_first_cell;
        value = interpolated(value_before[cell], value_after[cell], values.weight);
        if (!is_missing(value)) {
            carbon = carbon_of(cell);
            uncertainty = uncertainty_of(cell);
            share = share_of(cell);
            if (!is_in_cap(row, slot)) { value = MISSING; }
        }
    }
    let first = first_splat(workgroup, workgroups) + invocation;
    for (var j = 0u; j < cells.particles_each; j++) {
        let k = workgroup.z * cells.particles_each + j;
        let at = first + j * SQUARE * SQUARE;
        if (is_missing(value) || k >= cells.particles_per_cell) {
            store_nothing(at);
        } else {
            var particle = covering(particle_of(row, slot, k, value, carbon), share * particle_share(k));
            if (uncertainty > 0.0) { particle = uncertain(particle, uncertainty); }
            store(at, splat_of(particle));
        }
    }
    workgroupBarrier();
    add_sums(invocation);
}
