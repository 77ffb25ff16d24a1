// Counting sort of splats into lists of (screen tile, slice): count, exclusive scan in three steps, scatter.
// The order within a list is that of arrival; the eye sums inside a slice, so it cannot matter.
@group(0) @binding(1) var<storage, read> splats: array<Splat>;
@group(0) @binding(2) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> block_sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> entries: array<Entry>;

const PER_INVOCATION = 8u;
// Depth of one splat at one pixel: a colour sum of the eye grows by less than 2^24 at once and cannot wrap.
const MOST_DEPTH = 15.0;
// First and last screen tile that a splat touches, x and y; empty if it touches none. Whole numbers only: `count` and
// `scatter` must agree to the last bit.
struct Reach { low: vec2<i32>, high: vec2<i32> }

fn radius_of(splat: Splat) -> i32 {
    return max(nearest(splat.radius_px * f32(SUBPIXELS)) >> params.entry_shift, 1);
}

fn reach_of(splat: Splat) -> Reach {
    if (splat.tau <= 0.0) { return Reach(vec2(0), vec2(-1)); }
    let radius = radius_of(splat) << params.entry_shift;
    let place = vec2(splat.x_sub, splat.y_sub);
    let tiles = vec2(i32(params.tiles_x), i32(params.tiles_y));
    return Reach(max((place - radius) >> vec2(SCREEN_TILE_SHIFT), vec2(0)), min((place + radius) >> vec2(SCREEN_TILE_SHIFT), tiles - 1));
}

fn list_of(x: i32, y: i32, splat: Splat) -> u32 {
    return (u32(y) * params.tiles_x + u32(x)) * params.slices + u32(splat.slice);
}

@compute @workgroup_size(GROUP)
fn count(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let i = list_index(global, workgroups);
    if (i >= params.particle_count) { return; }
    let splat = splats[i];
    let reach = reach_of(splat);
    for (var y = reach.low.y; y <= reach.high.y; y++) {
        for (var x = reach.low.x; x <= reach.high.x; x++) { atomicAdd(&counts[list_of(x, y, splat)], 1u); }
    }
}

var<workgroup> partial: array<u32, GROUP>;

// Sum of `own` over the invocations before this one; `partial[GROUP - 1]` then holds the whole.
fn scan_workgroup(invocation: u32, own: u32) -> u32 {
    partial[invocation] = own;
    workgroupBarrier();
    for (var distance = 1u; distance < GROUP; distance *= 2u) {
        var before = 0u;
        if (invocation >= distance) { before = partial[invocation - distance]; }
        workgroupBarrier();
        partial[invocation] += before;
        workgroupBarrier();
    }
    return partial[invocation] - own;
}

@compute @workgroup_size(GROUP)
fn scan_blocks(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    let block = workgroup.x + workgroup.y * workgroups.x;
    let base = (block * GROUP + invocation) * PER_INVOCATION;
    let length = params.tiles_x * params.tiles_y * params.slices;
    var before: array<u32, PER_INVOCATION>;
    var sum = 0u;
    for (var j = 0u; j < PER_INVOCATION; j++) {
        before[j] = sum;
        if (base + j < length) { sum += atomicLoad(&counts[base + j]); }
    }
    let start = scan_workgroup(invocation, sum);
    for (var j = 0u; j < PER_INVOCATION; j++) {
        if (base + j < length) { atomicStore(&counts[base + j], start + before[j]); }
    }
    if (invocation == GROUP - 1u) { block_sums[block] = start + sum; }
}

@compute @workgroup_size(GROUP)
fn scan_sums(@builtin(local_invocation_index) invocation: u32) {
    let block = GROUP * PER_INVOCATION;
    let blocks = (params.tiles_x * params.tiles_y * params.slices + block - 1u) / block;
    let each = (blocks + GROUP - 1u) / GROUP;
    let first = invocation * each;
    var sum = 0u;
    for (var j = first; j < min(first + each, blocks); j++) { sum += block_sums[j]; }
    var start = scan_workgroup(invocation, sum);
    for (var j = first; j < min(first + each, blocks); j++) {
        let own = block_sums[j];
        block_sums[j] = start;
        start += own;
    }
}

@compute @workgroup_size(GROUP)
fn scan_add(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    let block = workgroup.x + workgroup.y * workgroups.x;
    let length = params.tiles_x * params.tiles_y * params.slices;
    for (var j = 0u; j < PER_INVOCATION; j++) {
        let at = (block * PER_INVOCATION + j) * GROUP + invocation;
        if (at < length) { atomicAdd(&counts[at], block_sums[block]); }
    }
}

// Moves each list's start to its end: afterwards list `b` is `counts[b - 1] .. counts[b]`.
@compute @workgroup_size(GROUP)
fn scatter(@builtin(global_invocation_id) global: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let i = list_index(global, workgroups);
    if (i >= params.particle_count) { return; }
    let splat = splats[i];
    let reach = reach_of(splat);
    let color = (splat.color & 0xffffffu) | (u32(splat.slice) << 24u);
    let depth = u32(min(splat.tau, MOST_DEPTH) * DEPTH_ONE + 0.5);
    let size = u32(radius_of(splat)) | (depth << 16u);
    for (var y = reach.low.y; y <= reach.high.y; y++) {
        for (var x = reach.low.x; x <= reach.high.x; x++) {
            let at = atomicAdd(&counts[list_of(x, y, splat)], 1u);
            let corner = vec2(x, y) << vec2(SCREEN_TILE_SHIFT);
            let place = vec2<u32>((vec2(splat.x_sub, splat.y_sub) - corner) >> vec2(params.entry_shift));
            if (at < params.entry_capacity) { entries[at] = Entry((place.x & 0xffffu) | (place.y << 16u), size, color); }
        }
    }
}
