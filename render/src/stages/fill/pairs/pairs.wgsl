// All pairs: the weighted sums over every cell with data for every gap, rows from the north, columns from the west.
// A row is summed up before it is added, so that a far cell is not lost beside the sum of all others.
@group(0) @binding(1) var<storage, read> tables: array<f32>;
@group(0) @binding(2) var<storage, read_write> answers: array<f32>;

const TILE = 128u;
const MOST_COLS = 4096u;

fn apart(a: u32, b: u32) -> u32 {
    return max(a, b) - min(a, b);
}

fn rows_apart(a: u32, b: u32) -> f32 {
    return tables[apart(a, b)];
}

fn cols_apart(count: u32) -> f32 {
    return tables[level.rows + count];
}

fn cosine(row: u32) -> f32 {
    return tables[level.rows + level.cols + row];
}

// One over the squared chord in cells: of the haversine form, which is exact for neighbours too.
fn weight(base: f32, cosines: f32, cols: u32) -> f32 {
    return quotient(1.0, base + product(cosines, cols_apart(cols)));
}

fn adding(line: vec3<f32>, near: f32, value: f32) -> vec3<f32> {
    let weighted = product(near, value);
    return line + vec3<f32>(near, weighted, product(weighted, value));
}

fn keep(row: u32, col: u32, total: vec3<f32>) {
    let cells = level.rows * level.cols;
    answers[row * level.cols + col] = quotient(total.y, total.x);
    answers[cells + row * level.cols + col] = quotient(total.z, total.x);
}

@group(0) @binding(3) var<storage, read> values: array<f32>;
@group(0) @binding(4) var<storage, read> gaps: array<u32>;

@compute @workgroup_size(16, 16)
fn naive(@builtin(global_invocation_id) at: vec3<u32>) {
    if (at.x >= level.cols || at.y >= level.rows || gaps[at.y * level.cols + at.x] == 0u) { return; }
    var total = vec3<f32>(0.0);
    for (var row = 0u; row < level.rows; row++) {
        var line = vec3<f32>(0.0);
        for (var col = 0u; col < level.cols; col++) {
            let value = values[row * level.cols + col];
            if (!is_missing(value)) {
                let near = weight(rows_apart(at.y, row), product(cosine(at.y), cosine(row)), apart(at.x, col));
                line = adding(line, near, value);
            }
        }
        total += line;
    }
    keep(at.y, at.x, total);
}

@group(0) @binding(5) var<storage, read> work: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read> targets: array<u32>;
@group(0) @binding(7) var<storage, read> row_starts: array<u32>;
@group(0) @binding(8) var<storage, read> source_cols: array<u32>;
@group(0) @binding(9) var<storage, read> source_values: array<f32>;

var<workgroup> weight_of: array<f32, MOST_COLS>;
var<workgroup> tile_cols: array<u32, TILE>;
var<workgroup> tile_values: array<f32, TILE>;

@compute @workgroup_size(TILE)
fn tiled(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32) {
    let number = group.x + group.y * groups.x;
    if (number >= arrayLength(&work)) { return; }
    let own = work[number];
    let is_target = lane < own.z;
    var col = 0u;
    if (is_target) { col = targets[own.y + lane]; }
    var total = vec3<f32>(0.0);
    for (var row = 0u; row < level.rows; row++) {
        let base = rows_apart(own.x, row);
        let cosines = product(cosine(own.x), cosine(row));
        for (var i = lane; i < level.cols; i += TILE) { weight_of[i] = weight(base, cosines, i); }
        var line = vec3<f32>(0.0);
        let end = row_starts[row + 1u];
        for (var first = row_starts[row]; first < end; first += TILE) {
            if (first + lane < end) {
                tile_cols[lane] = source_cols[first + lane];
                tile_values[lane] = source_values[first + lane];
            }
            workgroupBarrier();
            if (is_target) {
                let count = min(TILE, end - first);
                for (var i = 0u; i < count; i++) {
                    line = adding(line, weight_of[apart(col, tile_cols[i])], tile_values[i]);
                }
            }
            workgroupBarrier();
        }
        total += line;
    }
    if (is_target) { keep(own.x, col, total); }
}
