// From cells to stored splats in one pass: interpolate, generate, project; give depth to the light and count the lists.
// One invocation makes a few particles of a cell; a workgroup covers a square of cells, whose particles are near one
// another in the picture and in the light.
@group(0) @binding(1) var<storage, read> rows: array<Row>;
@group(0) @binding(2) var<storage, read> cols: array<Col>;
@group(0) @binding(3) var<storage, read> palette: array<u32>;
@group(0) @binding(4) var<storage, read> value_before: array<f32>;
@group(0) @binding(5) var<storage, read> value_after: array<f32>;
@group(0) @binding(6) var<storage, read> carbon_before: array<f32>;
@group(0) @binding(7) var<storage, read> carbon_after: array<f32>;
// Place on the screen, size and colour of every splat.
@group(0) @binding(8) var<storage, read_write> seen: array<vec4<u32>>;
// Place in the light, slice and day of every splat.
@group(0) @binding(11) var<storage, read_write> lit: array<vec4<u32>>;
@group(0) @binding(9) var<storage, read_write> light: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> counts: array<atomic<u32>>;
// Bound but never read where doubt is not drawn.
@group(0) @binding(12) var<storage, read> doubt_before: array<f32>;
@group(0) @binding(13) var<storage, read> doubt_after: array<f32>;

// Keys of lists; those of light texels are below.
const LIST_KEY = 0x80000000u;

fn add_light(at: u32, amount: u32) {
    let slot = take_slot(at);
    if (slot == NO_SLOT) {
        atomicAdd(&light[at], amount);
    } else {
        atomicAdd(&sums[slot], amount);
    }
}

fn count_list(list: u32) {
    let slot = take_slot(list | LIST_KEY);
    if (slot == NO_SLOT) {
        atomicAdd(&counts[list], 1u);
    } else {
        atomicAdd(&sums[slot], 1u);
    }
}

fn is_in_cap(row: u32, slot: u32) -> bool {
    if (params.view == VIEW_TILE) { return true; }
    let lat = rows[row];
    let lon = cols[slot];
    let center = vec3(lat.cos_lat * lon.sin_lon, lat.cos_lat * lon.cos_lon, lat.sin_lat);
    return dot(center, vec3(params.eye_x, params.eye_y, params.eye_z)) >= params.cap_least;
}

// Carbon of a cell, counted from the first held; what is missing has accumulated nothing.
fn carbon_of(cell: u32) -> f32 {
    if (params.has_accumulated == 0u) { return 0.0; }
    let carbon = interpolated(carbon_before[cell], carbon_after[cell], params.accumulated_weight);
    if (is_missing(carbon)) { return 0.0; }
    return carbon;
}

fn store(at: u32, splat: Splat) {
    let size = size_word(splat);
    seen[at] = vec4(bitcast<u32>(splat.x_sub), bitcast<u32>(splat.y_sub), size, splat.color);
    if (splat.tau <= 0.0) { return; }
    if (params.light_on == 1u) { deposit(splat); }
    if (size == 0u) { return; }
    lit[at] = vec4(bitcast<u32>(splat.light_u), bitcast<u32>(splat.light_v),
        bitcast<u32>(splat.slice), bitcast<u32>(splat.day));
    let reach = reach_of(vec2(splat.x_sub, splat.y_sub), size);
    for (var y = reach.low.y; y <= reach.high.y; y++) {
        for (var x = reach.low.x; x <= reach.high.x; x++) { count_list(list_of(x, y, u32(splat.slice))); }
    }
}

@compute @workgroup_size(SQUARE, SQUARE)
fn splat(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    clear_table(invocation);
    workgroupBarrier();
    let down = workgroup.y * SQUARE + local.y;
    let slot = workgroup.x * SQUARE + local.x;
    let row = params.first_row + down;
    var value = MISSING;
    var carbon = 0.0;
    var doubt = 0.0;
    if (down < params.row_count && slot < params.slot_count) {
        let cell = row * params.cols + cols[slot].index - params.held_first_cell;
        value = interpolated(value_before[cell], value_after[cell], params.value_weight);
        if (!is_missing(value)) {
            carbon = carbon_of(cell);
            doubt = doubt_of(cell);
            if (!is_in_cap(row, slot)) { value = MISSING; }
        }
    }
    let first = first_splat(workgroup, workgroups) + invocation;
    for (var j = 0u; j < params.particles_each; j++) {
        let k = workgroup.z * params.particles_each + j;
        let at = first + j * SQUARE * SQUARE;
        if (is_missing(value) || k >= params.particles_per_cell) {
            seen[at] = vec4(0u);
        } else {
            var particle = particle_of(row, slot, k, value, carbon);
            if (doubt > 0.0) { particle = doubted(particle, doubt); }
            store(at, splat_of(particle));
        }
    }
    workgroupBarrier();
    for (var slot = invocation; slot < TABLE; slot += SQUARE * SQUARE) {
        let tag = atomicLoad(&tags[slot]);
        if (tag == 0u) { continue; }
        let key = tag - 1u;
        if ((key & LIST_KEY) == 0u) {
            atomicAdd(&light[key], atomicLoad(&sums[slot]));
        } else {
            atomicAdd(&counts[key & ~LIST_KEY], atomicLoad(&sums[slot]));
        }
    }
}
