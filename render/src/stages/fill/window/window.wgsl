// Gap filling from a window on every level: values split into planes, planes joined two by two into coarser levels,
// and each level's answer from the sums around a cell and the coarser level's answer.
@group(0) @binding(1) var<storage, read> values: array<f32>;
@group(0) @binding(2) var<storage, read_write> planes: array<f32>;

@compute @workgroup_size(16, 16)
fn split(@builtin(global_invocation_id) at: vec3<u32>) {
    if (at.x >= level.cols || at.y >= level.rows) { return; }
    let cells = level.rows * level.cols;
    let cell = at.y * level.cols + at.x;
    let value = values[cell];
    let is_held = !is_missing(value);
    planes[cell] = select(0.0, 1.0, is_held);
    planes[cells + cell] = select(0.0, value, is_held);
    planes[2u * cells + cell] = select(0.0, value * value, is_held);
}

@group(0) @binding(3) var<storage, read> fine_planes: array<f32>;
@group(0) @binding(4) var<storage, read> fine_wanted: array<u32>;
@group(0) @binding(5) var<storage, read_write> coarse_planes: array<f32>;
@group(0) @binding(6) var<storage, read_write> coarse_wanted: array<u32>;

fn fine(row: u32, col: u32) -> vec3<f32> {
    if (row >= level.rows || col >= level.cols) { return vec3<f32>(0.0); }
    let cells = level.rows * level.cols;
    let cell = row * level.cols + col;
    return vec3<f32>(fine_planes[cell], fine_planes[cells + cell], fine_planes[2u * cells + cell]);
}

fn is_fine_wanted(row: i32, col: i32) -> bool {
    let cols = i32(level.cols);
    var x = col;
    if (level.periodic == 1u) { x = (x % cols + cols) % cols; }
    if (row < 0 || row >= i32(level.rows) || x < 0 || x >= cols) { return false; }
    return fine_wanted[u32(row) * level.cols + u32(x)] != 0u;
}

@compute @workgroup_size(16, 16)
fn join(@builtin(global_invocation_id) at: vec3<u32>) {
    if (at.x >= level.coarser_cols || at.y >= level.coarser_rows) { return; }
    let row = 2u * at.y;
    let col = 2u * at.x;
    let north = fine(row, col) + fine(row, col + 1u);
    let south = fine(row + 1u, col) + fine(row + 1u, col + 1u);
    let joined = (north + south) * 0.25;
    let cells = level.coarser_rows * level.coarser_cols;
    let cell = at.y * level.coarser_cols + at.x;
    coarse_planes[cell] = joined.x;
    coarse_planes[cells + cell] = joined.y;
    coarse_planes[2u * cells + cell] = joined.z;
    // A cell reads the answers of the four blocks nearest to it.
    var is_wanted = false;
    for (var dy = -1; dy <= 2; dy++) {
        for (var dx = -1; dx <= 2; dx++) {
            is_wanted = is_wanted || is_fine_wanted(i32(row) + dy, i32(col) + dx);
        }
    }
    coarse_wanted[cell] = u32(is_wanted);
}

@group(0) @binding(7) var<storage, read> sums: array<f32>;
@group(0) @binding(8) var<storage, read> coarser_answers: array<f32>;
@group(0) @binding(9) var<storage, read> wanted: array<u32>;
@group(0) @binding(10) var<storage, read_write> answers: array<f32>;

// The block on the other side of a cell, as seen from the middle of its own block.
fn beside(place: u32, count: u32, is_round: bool) -> u32 {
    if (place % 2u == 1u) {
        if (place / 2u + 1u < count) { return place / 2u + 1u; }
        return select(count - 1u, 0u, is_round);
    }
    if (place >= 2u) { return place / 2u - 1u; }
    return select(0u, count - 1u, is_round);
}

// Between the four nearest coarser answers, bilinear.
fn coarser(row: u32, col: u32, plane: u32) -> f32 {
    let first = plane * level.coarser_rows * level.coarser_cols;
    let near = first + row / 2u * level.coarser_cols;
    let far = first + beside(row, level.coarser_rows, false) * level.coarser_cols;
    let x = beside(col, level.coarser_cols, level.periodic == 1u);
    let own = coarser_answers[near + col / 2u];
    let sides = coarser_answers[near + x] + coarser_answers[far + col / 2u];
    return product(0.5625, own) + product(0.1875, sides) + product(0.0625, coarser_answers[far + x]);
}

@compute @workgroup_size(16, 16)
fn settle(@builtin(global_invocation_id) at: vec3<u32>) {
    if (at.x >= level.cols || at.y >= level.rows) { return; }
    let cells = level.rows * level.cols;
    let cell = at.y * level.cols + at.x;
    if (wanted[cell] == 0u) { return; }
    var total = vec3<f32>(sums[cell], sums[cells + cell], sums[2u * cells + cell]);
    if (level.has_coarser == 1u) {
        let leaned = vec2<f32>(coarser(at.y, at.x, 0u), coarser(at.y, at.x, 1u));
        total += vec3<f32>(level.lean, product(level.lean, leaned.x), product(level.lean, leaned.y));
    }
    answers[cell] = quotient(total.y, total.x);
    answers[cells + cell] = quotient(total.z, total.x);
}
