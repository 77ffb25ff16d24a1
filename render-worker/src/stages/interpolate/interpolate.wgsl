// Linear interpolation in time between two adjacent frames (eq. 3), one invocation a cell.
@group(0) @binding(1) var<storage, read> before: array<f32>;
@group(0) @binding(2) var<storage, read> after: array<f32>;
@group(0) @binding(3) var<storage, read_write> between: array<f32>;

fn interpolated(v1: f32, v2: f32, weight: f32) -> f32 {
    if (weight <= 0.0) { return v1; }
    if (is_missing(v1) || is_missing(v2)) { return MISSING; }
    return v1 + (v2 - v1) * weight;
}

@compute @workgroup_size(GROUP)
fn interpolate_value(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let cell = params.first_cell + list_index(global, workgroups);
    if (cell >= params.end_cell) { return; }
    between[cell] = interpolated(before[cell], after[cell], params.value_weight);
}

@compute @workgroup_size(GROUP)
fn interpolate_accumulated(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let cell = params.first_cell + list_index(global, workgroups);
    if (cell >= params.end_cell) { return; }
    between[cell] = interpolated(before[cell], after[cell], params.accumulated_weight);
}
