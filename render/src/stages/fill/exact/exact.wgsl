// Multilevel summation: values carried to coarser levels by the transpose of six-point interpolation, sums carried
// back by the interpolation itself.
@group(0) @binding(1) var<storage, read> fine_planes: array<f32>;
@group(0) @binding(2) var<storage, read_write> coarse_planes: array<f32>;

// Weights of the six nodes around the middle between two: Lagrange, exact for polynomials of degree 5.
fn share(k: u32) -> f32 {
    let from_end = min(k, 5u - k);
    if (from_end == 0u) { return 0.01171875; }
    if (from_end == 1u) { return -0.09765625; }
    return 0.5859375;
}

// Place of a node among finer ones: of itself for `tap` 6, else of the finer one between nodes that takes share `tap`.
fn finer(place: u32, tap: u32, pad: u32) -> i32 {
    let own = 2 * (i32(place) - i32(pad));
    if (tap == 6u) { return own; }
    return own + 2 * (2 - i32(tap)) + 1;
}

fn fine(row: i32, col: i32) -> vec3<f32> {
    let cols = i32(level.cols);
    var x = col;
    if (level.periodic == 1u) { x = (x % cols + cols) % cols; }
    if (row < 0 || row >= i32(level.rows) || x < 0 || x >= cols) { return vec3<f32>(0.0); }
    let cells = level.rows * level.cols;
    let cell = u32(row) * level.cols + u32(x);
    return vec3<f32>(fine_planes[cell], fine_planes[cells + cell], fine_planes[2u * cells + cell]);
}

@compute @workgroup_size(16, 16)
fn gather(@builtin(global_invocation_id) at: vec3<u32>) {
    if (at.x >= level.coarser_cols || at.y >= level.coarser_rows) { return; }
    var total = vec3<f32>(0.0);
    for (var i = 0u; i < 7u; i++) {
        let row = finer(at.y, i, COARSER_PAD);
        var line = vec3<f32>(0.0);
        for (var k = 0u; k < 6u; k++) {
            line += products(share(k), fine(row, finer(at.x, k, level.coarser_pad_cols)));
        }
        line += fine(row, finer(at.x, 6u, level.coarser_pad_cols));
        if (i == 6u) { total += line; } else { total += products(share(i), line); }
    }
    let cells = level.coarser_rows * level.coarser_cols;
    let cell = at.y * level.coarser_cols + at.x;
    coarse_planes[cell] = total.x;
    coarse_planes[cells + cell] = total.y;
    coarse_planes[2u * cells + cell] = total.z;
}

@group(0) @binding(3) var<storage, read> coarse_sums: array<f32>;
@group(0) @binding(4) var<storage, read> wanted: array<u32>;
@group(0) @binding(5) var<storage, read_write> fine_sums: array<f32>;

fn coarse(row: u32, col: u32) -> vec3<f32> {
    let cells = level.coarser_rows * level.coarser_cols;
    let cell = row * level.coarser_cols + col;
    return vec3<f32>(coarse_sums[cell], coarse_sums[cells + cell], coarse_sums[2u * cells + cell]);
}

// The coarser column of a place: the same, or the `k`th of the six round it.
fn coarse_col(col: u32, k: u32) -> u32 {
    let cols = level.coarser_cols;
    if (level.periodic == 1u) { return (col / 2u + k + 3u * cols - 2u) % cols; }
    return col / 2u + k;
}

fn across(row: u32, col: u32) -> vec3<f32> {
    if (col % 2u == 0u) { return coarse(row, coarse_col(col, 2u)); }
    var line = vec3<f32>(0.0);
    for (var k = 0u; k < 6u; k++) { line += products(share(k), coarse(row, coarse_col(col, k))); }
    return line;
}

@compute @workgroup_size(16, 16)
fn raise(@builtin(global_invocation_id) at: vec3<u32>) {
    if (at.x >= level.cols || at.y >= level.rows) { return; }
    let cells = level.rows * level.cols;
    let cell = at.y * level.cols + at.x;
    if (level.is_masked == 1u && wanted[cell] == 0u) { return; }
    var total = vec3<f32>(0.0);
    if (at.y % 2u == 0u) {
        total = across(at.y / 2u + COARSER_PAD, at.x);
    } else {
        for (var k = 0u; k < 6u; k++) { total += products(share(k), across(at.y / 2u + k, at.x)); }
    }
    fine_sums[cell] += total.x;
    fine_sums[cells + cell] += total.y;
    fine_sums[2u * cells + cell] += total.z;
}

@group(0) @binding(6) var<storage, read> sums: array<f32>;
@group(0) @binding(7) var<storage, read_write> answers: array<f32>;

@compute @workgroup_size(16, 16)
fn finish(@builtin(global_invocation_id) at: vec3<u32>) {
    if (at.x >= level.cols || at.y >= level.rows) { return; }
    let cells = level.rows * level.cols;
    let cell = at.y * level.cols + at.x;
    if (wanted[cell] == 0u) { return; }
    answers[cell] = quotient(sums[cells + cell], sums[cell]);
    answers[cells + cell] = quotient(sums[2u * cells + cell], sums[cell]);
}
