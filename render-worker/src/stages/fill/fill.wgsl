// Missing cells of the domain from the cells with data around them: inverse distance weighting (power 2) within a
// window, every workgroup loading its block and the window's rim into shared memory once.
@group(0) @binding(0) var<uniform> params: FillParams;
@group(0) @binding(1) var<storage, read> values: array<f32>;
@group(0) @binding(2) var<storage, read> domain: array<u32>;
@group(0) @binding(3) var<storage, read> cosines: array<f32>;
@group(0) @binding(4) var<storage, read_write> filled: array<f32>;

struct FillParams { rows: u32, cols: u32, periodic: u32, reach_x: i32, lon_per_lat: f32, pad_a: u32, pad_b: u32, pad_c: u32, }

const MISSING = -1.0e30;
const BLOCK = 16;
const REACH = 8;
const SIDE = 32; // BLOCK + 2 * REACH

var<workgroup> near: array<f32, 1024>; // SIDE * SIDE

fn load(row: i32, col: i32) -> f32 {
    var x = col;
    let cols = i32(params.cols);
    if (params.periodic == 1u) { x = (x % cols + cols) % cols; }
    if (row < 0 || row >= i32(params.rows) || x < 0 || x >= cols) { return MISSING; }
    return values[u32(row) * params.cols + u32(x)];
}

@compute @workgroup_size(BLOCK, BLOCK)
fn fill(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    let origin = vec2<i32>(workgroup.xy) * BLOCK - REACH;
    for (var i = i32(invocation); i < SIDE * SIDE; i += BLOCK * BLOCK) {
        near[i] = load(origin.y + i / SIDE, origin.x + i % SIDE);
    }
    workgroupBarrier();
    let center = vec2<i32>(local.xy) + REACH;
    let col = u32(origin.x + center.x);
    let row = u32(origin.y + center.y);
    if (row >= params.rows || col >= params.cols) { return; }
    let at = row * params.cols + col;
    let own = near[center.y * SIDE + center.x];
    if (own >= 0.5 * MISSING || domain[at] == 0u) {
        filled[at] = own;
        return;
    }
    let width = cosines[row] * params.lon_per_lat;
    var weights = 0.0;
    var sum = 0.0;
    for (var dy = -REACH; dy <= REACH; dy++) {
        for (var dx = -params.reach_x; dx <= params.reach_x; dx++) {
            let value = near[(center.y + dy) * SIDE + center.x + dx];
            if (value >= 0.5 * MISSING) {
                let east = f32(dx) * width;
                let south = f32(dy);
                let weight = 1.0 / (east * east + south * south);
                weights += weight;
                sum += weight * value;
            }
        }
    }
    if (weights > 0.0) { filled[at] = sum / weights; } else { filled[at] = own; }
}
