// The grid of a thematic map at an instant, one invocation a cell.
struct InterpolateParams { first_cell: u32, end_cell: u32 }
@group(0) @binding(25) var<uniform> interpolation: InterpolateParams;
@group(0) @binding(1) var<storage, read> before: array<f32>;
@group(0) @binding(2) var<storage, read> after: array<f32>;
@group(0) @binding(3) var<storage, read_write> between: array<f32>;

@compute @workgroup_size(GROUP)
fn interpolate(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let cell = interpolation.first_cell + list_index(global, workgroups);
    if (cell >= interpolation.end_cell) { return; }
    let held = cell - grid.held_first_cell;
    between[held] = interpolated(before[held], after[held], values.weight);
}
