// The grid of a thematic map at an instant, one invocation a cell.
@group(0) @binding(1) var<storage, read> before: array<f32>;
@group(0) @binding(2) var<storage, read> after: array<f32>;
@group(0) @binding(3) var<storage, read_write> between: array<f32>;

@compute @workgroup_size(GROUP)
fn interpolate(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let cell = params.first_cell + list_index(global, workgroups);
    if (cell >= params.end_cell) { return; }
    let held = cell - params.held_first_cell;
    between[held] = interpolated(before[held], after[held], params.value_weight);
}
