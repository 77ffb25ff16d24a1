// Splats stored, their depth given to the light and the lists counted, for passes that make particles of cells.
@group(0) @binding(1) var<storage, read> rows: array<Row>;
@group(0) @binding(2) var<storage, read> cols: array<Col>;
@group(0) @binding(3) var<storage, read> palette: array<u32>;
// Place on the screen, size and colour of every splat.
@group(0) @binding(8) var<storage, read_write> seen: array<vec4<u32>>;
// Place in the light, slice and day of every splat.
@group(0) @binding(11) var<storage, read_write> lit: array<vec4<u32>>;
@group(0) @binding(9) var<storage, read_write> light: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> counts: array<atomic<u32>>;

fn is_light_alone() -> bool { return feature(IS_LIGHT_ALONE, lighting.mode == LIGHT_ALONE); }

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
    if (is_tile()) { return true; }
    let lat = rows[row];
    let lon = cols[slot];
    let center = vec3(lat.cos_lat * lon.sin_lon, lat.cos_lat * lon.cos_lon, lat.sin_lat);
    return dot(center, view.cap) >= view.cap_least;
}

fn store_nothing(at: u32) {
    if (!is_light_alone()) { seen[at] = vec4(0u); }
}

fn store(at: u32, splat: Splat) {
    if (is_light_alone()) {
        if (splat.light_depth > 0.0) { deposit(splat); }
        return;
    }
    let size = size_word(splat);
    seen[at] = vec4(bitcast<u32>(splat.x_sub), bitcast<u32>(splat.y_sub), size, splat.colour);
    if (feature(MAKES_LIGHT, lighting.mode == LIGHT_OWN) && splat.light_depth > 0.0) { deposit(splat); }
    if (size == 0u) { return; }
    lit[at] = vec4(bitcast<u32>(splat.light_u), bitcast<u32>(splat.light_v),
        bitcast<u32>(splat.slice), bitcast<u32>(splat.day));
    let reach = reach_of(vec2(splat.x_sub, splat.y_sub), size);
    for (var y = reach.low.y; y <= reach.high.y; y++) {
        for (var x = reach.low.x; x <= reach.high.x; x++) { count_list(list_of(x, y, u32(splat.slice))); }
    }
}

// Adds what the workgroup has summed up.
fn add_sums(invocation: u32) {
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
