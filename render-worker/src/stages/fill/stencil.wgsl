// The weighted sums of presence, value and square over the cells around each wanted cell. A workgroup takes a run of
// one row and passes over the rows around it, each loaded into shared memory once with its rim.
@group(0) @binding(1) var<storage, read> source: array<f32>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> spans: array<u32>;
@group(0) @binding(4) var<storage, read> wanted: array<u32>;
@group(0) @binding(5) var<storage, read_write> sums: array<f32>;

var<workgroup> near_count: array<f32, SEGMENT>;
var<workgroup> near_sum: array<f32, SEGMENT>;
var<workgroup> near_square: array<f32, SEGMENT>;
var<workgroup> near_weight: array<f32, SEGMENT>;
var<workgroup> any_wanted: u32;

fn load(row: i32, col: i32, at: u32) {
    let cols = i32(level.cols);
    var x = col;
    // Reach is at most one turn.
    if (level.periodic == 1u) { x = select(select(x, x - cols, x >= cols), x + cols, x < 0); }
    var loaded = vec3<f32>(0.0);
    if (x >= 0 && x < cols) {
        let cells = level.rows * level.cols;
        let cell = u32(row) * level.cols + u32(x);
        loaded = vec3<f32>(source[cell], source[cells + cell], source[2u * cells + cell]);
    }
    near_count[at] = loaded.x;
    near_sum[at] = loaded.y;
    near_square[at] = loaded.z;
}

fn near(at: u32) -> vec3<f32> {
    return vec3<f32>(near_count[at], near_sum[at], near_square[at]);
}

@compute @workgroup_size(WIDTH)
fn stencil(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let row = group.y;
    let first = group.x * WIDTH;
    let col = first + lane;
    let cell = row * level.cols + col;
    var is_wanted = col < level.cols;
    if (is_wanted && level.is_masked == 1u) { is_wanted = wanted[cell] != 0u; }
    if (is_wanted) { any_wanted = 1u; }
    // Most of an open or a land-locked frame has no gap.
    if (workgroupUniformLoad(&any_wanted) == 0u) { return; }
    var total = vec3<f32>(0.0);
    let width = 2u * level.reach_rows + 1u;
    for (var step = 0u; step < width; step++) {
        let y = i32(row + step) - i32(level.reach_rows);
        let line = row * width + step;
        let span = spans[line];
        if (y < 0 || y >= i32(level.rows) || span == 0u) { continue; }
        let rim = span - 1u;
        for (var i = lane; i < WIDTH + 2u * rim; i += WIDTH) {
            load(y, i32(first + i) - i32(rim), i);
        }
        for (var i = lane; i < span; i += WIDTH) {
            near_weight[i] = weights[line * (level.reach_cols + 1u) + i];
        }
        workgroupBarrier();
        if (is_wanted) {
            let center = lane + rim;
            total += products(near_weight[0], near(center));
            for (var dx = 1u; dx < span; dx++) {
                total += products(near_weight[dx], near(center - dx) + near(center + dx));
            }
        }
        workgroupBarrier();
    }
    if (is_wanted) {
        let cells = level.rows * level.cols;
        sums[cell] = total.x;
        sums[cells + cell] = total.y;
        sums[2u * cells + cell] = total.z;
    }
}
