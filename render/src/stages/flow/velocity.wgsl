// The vector of every cell at an instant, one invocation a cell.
@group(0) @binding(1) var<storage, read> east_before: array<f32>;
@group(0) @binding(2) var<storage, read> east_after: array<f32>;
@group(0) @binding(3) var<storage, read> north_before: array<f32>;
@group(0) @binding(4) var<storage, read> north_after: array<f32>;
@group(0) @binding(5) var<storage, read_write> velocity: array<Velocity>;

// Squares of larger ones would not be numbers.
const MOST_SPEED = 1.0e6;

@compute @workgroup_size(GROUP)
fn velocities(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let cell = list_index(global, workgroups);
    if (cell >= grid.rows * grid.cols) { return; }
    let east = interpolated(east_before[cell], east_after[cell], values.weight);
    let north = interpolated(north_before[cell], north_after[cell], values.northward_weight);
    if (is_missing(east) || is_missing(north)) {
        velocity[cell] = Velocity(MISSING, MISSING);
    } else {
        velocity[cell] = Velocity(clamp(east, -MOST_SPEED, MOST_SPEED), clamp(north, -MOST_SPEED, MOST_SPEED));
    }
}
