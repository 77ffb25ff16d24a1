// Stored splats scattered into the lists of (screen tile, slice), dimmed by what lies between them and the sun: the second half of
// a counting sort. The order within a list is that of arrival; the eye sums inside a slice, so it cannot matter.
@group(0) @binding(1) var<storage, read> seen: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read> lit: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> light: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> entries: array<Entry>;

// A colour that is the same all over its splat.
const LEVEL = 0x80000000u;

// Next free place of a list; afterwards list `b` is `counts[b - 1] .. counts[b]`.
fn next_place(list: u32) -> u32 {
    let slot = find_slot(list);
    if (slot == NO_SLOT) { return atomicAdd(&counts[list], 1u); }
    return atomicAdd(&sums[slot], 1u);
}

fn count_own(at: u32) {
    let near = seen[at];
    if (near.z == 0u) { return; }
    let slice = u32(bitcast<f32>(lit[at].z));
    let reach = reach_of(vec2(bitcast<i32>(near.x), bitcast<i32>(near.y)), near.z);
    for (var y = reach.low.y; y <= reach.high.y; y++) {
        for (var x = reach.low.x; x <= reach.high.x; x++) {
            let slot = take_slot(list_of(x, y, slice));
            if (slot != NO_SLOT) { atomicAdd(&sums[slot], 1u); }
        }
    }
}

fn scatter_own(at: u32) {
    let near = seen[at];
    if (near.z == 0u) { return; }
    let far = lit[at];
    let slice = bitcast<f32>(far.z);
    let place = vec2(bitcast<i32>(near.x), bitcast<i32>(near.y));
    let reach = reach_of(place, near.z);
    if (any(reach.low > reach.high)) { return; }
    var colour = (near.w & 0xffffffu) | LEVEL;
    if (feature(IS_LIT, lighting.mode != LIGHT_OFF)) {
        let radius_px = f32((near.z & RADIUS_BITS) << lists.entry_shift) / f32(SUBPIXELS);
        colour = shaded(near.w, vec2(bitcast<i32>(far.x), bitcast<i32>(far.y)), slice, bitcast<f32>(far.w), radius_px);
    }
    for (var y = reach.low.y; y <= reach.high.y; y++) {
        for (var x = reach.low.x; x <= reach.high.x; x++) {
            let to = next_place(list_of(x, y, u32(slice)));
            let corner = vec2(x, y) << vec2(SCREEN_TILE_SHIFT);
            let from_corner = vec2<u32>((place - corner) >> vec2(lists.entry_shift));
            if (to < lists.entry_capacity) {
                entries[to] = Entry((from_corner.x & 0xffffu) | (from_corner.y << 16u), near.z, colour);
            }
        }
    }
}

@compute @workgroup_size(SQUARE, SQUARE)
fn scatter(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    clear_table(invocation);
    workgroupBarrier();
    let first = first_splat(workgroup, workgroups) + invocation;
    for (var j = 0u; j < cells.particles_each; j++) { count_own(first + j * SQUARE * SQUARE); }
    workgroupBarrier();
    for (var slot = invocation; slot < TABLE; slot += SQUARE * SQUARE) {
        let tag = atomicLoad(&tags[slot]);
        if (tag != 0u) { atomicStore(&sums[slot], atomicAdd(&counts[tag - 1u], atomicLoad(&sums[slot]))); }
    }
    workgroupBarrier();
    for (var j = 0u; j < cells.particles_each; j++) { scatter_own(first + j * SQUARE * SQUARE); }
}
