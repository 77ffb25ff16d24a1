// The weighted sums of presence, value and square over the cells around each wanted cell. A workgroup takes a run of
// a few rows and passes over the rows around them, each loaded into shared memory once with its rim.
@group(0) @binding(1) var<storage, read> source: array<f32>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> spans: array<u32>;
@group(0) @binding(4) var<storage, read> wanted: array<u32>;
@group(0) @binding(5) var<storage, read_write> sums: array<f32>;

// Rows of wanted cells that a workgroup takes at once: what it loads serves all of them.
const ROWS = 4u;

var<workgroup> near_count: array<f32, SEGMENT>;
var<workgroup> near_sum: array<f32, SEGMENT>;
var<workgroup> near_square: array<f32, SEGMENT>;
// Weights of a column step, one for each of the rows.
var<workgroup> near_weight: array<vec4<f32>, 193>; // MOST_REACH_COLS + 1
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

// Columns that the table reaches from a row of cells in the row `y`, the middle one included; 0 if it does not.
fn span_of(row: u32, y: i32) -> u32 {
    let step = y - i32(row) + i32(level.reach_rows);
    let width = i32(2u * level.reach_rows + 1u);
    if (row >= level.rows || step < 0 || step >= width) { return 0u; }
    return spans[row * u32(width) + u32(step)];
}

fn weight_of(row: u32, y: i32, span: u32, dx: u32) -> f32 {
    if (dx >= span) { return 0.0; }
    let line = row * (2u * level.reach_rows + 1u) + u32(y - i32(row) + i32(level.reach_rows));
    return weights[line * (level.reach_cols + 1u) + dx];
}

fn is_wanted(row: u32, col: u32) -> bool {
    if (row >= level.rows || col >= level.cols) { return false; }
    return level.is_masked == 0u || wanted[row * level.cols + col] != 0u;
}

fn store(row: u32, col: u32, total: vec3<f32>) {
    let cells = level.rows * level.cols;
    let cell = row * level.cols + col;
    sums[cell] = total.x;
    sums[cells + cell] = total.y;
    sums[2u * cells + cell] = total.z;
}

@compute @workgroup_size(WIDTH)
fn stencil(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let top = group.y * ROWS;
    let rows = vec4<u32>(top, top + 1u, top + 2u, top + 3u);
    let first = group.x * WIDTH;
    let col = first + lane;
    let wants = vec4<bool>(is_wanted(rows.x, col), is_wanted(rows.y, col), is_wanted(rows.z, col), is_wanted(rows.w, col));
    if (lane == 0u) { any_wanted = 0u; }
    workgroupBarrier();
    if (any(wants)) { any_wanted = 1u; }
    // Most of an open or a land-locked field has no gap.
    if (workgroupUniformLoad(&any_wanted) == 0u) { return; }
    var total_0 = vec3<f32>(0.0);
    var total_1 = vec3<f32>(0.0);
    var total_2 = vec3<f32>(0.0);
    var total_3 = vec3<f32>(0.0);
    let lowest = max(i32(top) - i32(level.reach_rows), 0);
    let end = min(i32(top + ROWS + level.reach_rows), i32(level.rows));
    for (var y = lowest; y < end; y++) {
        let own = vec4<u32>(span_of(rows.x, y), span_of(rows.y, y), span_of(rows.z, y), span_of(rows.w, y));
        let span = max(max(own.x, own.y), max(own.z, own.w));
        if (span == 0u) { continue; }
        let rim = span - 1u;
        for (var i = lane; i < WIDTH + 2u * rim; i += WIDTH) {
            load(y, i32(first + i) - i32(rim), i);
        }
        for (var i = lane; i < span; i += WIDTH) {
            near_weight[i] = vec4<f32>(weight_of(rows.x, y, own.x, i), weight_of(rows.y, y, own.y, i),
                weight_of(rows.z, y, own.z, i), weight_of(rows.w, y, own.w, i));
        }
        workgroupBarrier();
        if (any(wants)) {
            let center = lane + rim;
            // Rows that the table does not reach from add nothing: their weights are 0.
            for (var dx = 0u; dx < span; dx++) {
                var met = near(center - dx);
                if (dx > 0u) { met += near(center + dx); }
                let weight = near_weight[dx];
                total_0 += products(weight.x, met);
                total_1 += products(weight.y, met);
                total_2 += products(weight.z, met);
                total_3 += products(weight.w, met);
            }
        }
        workgroupBarrier();
    }
    if (wants.x) { store(rows.x, col, total_0); }
    if (wants.y) { store(rows.y, col, total_1); }
    if (wants.z) { store(rows.z, col, total_2); }
    if (wants.w) { store(rows.w, col, total_3); }
}
