// The eye's side of half-angle slicing: one workgroup a screen tile. Inside a slice the entries of its list add optical
// depth and colour to the pixels that they reach, as integers and so in any order; slices are blended in order, towards
// or away from the eye. Entries are spread over the invocations while they are added, pixels while they are blended.
@group(0) @binding(1) var<storage, read> list_ends: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<Entry>;
@group(0) @binding(3) var<storage, read> domain: array<u32>;
@group(0) @binding(4) var<storage, read_write> image: array<u32>;

// The kind of particle is tested for every pixel of every entry: there is a kernel for each.
override KERNEL: u32;

const PIXELS = 256u; // SCREEN_TILE_PX squared, and invocations
// Entries of a slice whose sums, below 2^24 each, stay below 2^32.
const SAFE = 256u;
const MOST_SUM = 0x7fffffffu;
// Slices whose lists are looked up at once.
const LOOKED_UP = 64u;
// Where this much is covered, what lies behind would change a byte by a fifteenth at most and is left out.
const OPAQUE = 0.99975586; // 1 - 1/4096
// A tile of so many entries is asked after every few slices whether all of it is covered.
const WORTH_ASKING = 1024u;
const ASKED_EVERY = 8u;

// Shared memory is what limits how many workgroups run at once: no more than this.
// Red, green, blue and depth of every pixel.
var<workgroup> sums: array<atomic<u32>, 1024>;
// Where the list before these slices ends, and theirs.
var<workgroup> ends: array<u32, 65>;
var<workgroup> is_open: u32;
// Shares of what lies beyond the sea surface that are hidden in the pixels, in 255 parts, four in a word.
var<workgroup> hidden: array<u32, 64>;

// Is anything that lies beyond the sea surface hidden?
fn hides_beyond() -> bool {
    return IN_CONTEXT && (land_hides() || has_trails());
}

// What lies beyond the sea surface lies behind the land, or the trail, that a sight line meets first.
fn is_behind(entry: Entry) -> bool {
    return hides_beyond() && (entry.size & BEYOND_BIT) != 0u;
}

// What is seen of something beyond the sea surface where so much is hidden.
fn kept_of(share: u32) -> f32 {
    return f32(255u - share) * 0.003921569;
}

// Sets `hidden`; to be waited for.
fn look_up_hidden(tile: vec2<u32>, invocation: u32) {
    if (!IN_CONTEXT || invocation >= PIXELS / 4u) { return; }
    var word = 0u;
    if (hides_beyond()) {
        for (var part = 0u; part < 4u; part++) {
            let at = invocation * 4u + part;
            let pixel = tile * SCREEN_TILE_PX + vec2(at % SCREEN_TILE_PX, at / SCREEN_TILE_PX);
            if (all(pixel < view.size_px)) { word |= hidden_share(pixel) << (8u * part); }
        }
    }
    hidden[invocation] = word;
}

// Share of a splat's depth at a squared distance of `q` squared radii from its centre.
fn weight_at(q: f32, radius_px: f32) -> f32 {
    if (KERNEL == KERNEL_CLOUD) {
        let inside = max(1.0 - q, 0.0);
        return inside * inside;
    }
    return clamp((1.0 - sqrt(q)) * radius_px, 0.0, 1.0);
}

// Light 1 of a channel in the whole numbers that `light_of` gives: 255 squared over 16.
const LIGHT_ONE = 4064.0625;

// Linear light of a colour in 12 bits.
fn light_of(colour: u32) -> vec3<u32> {
    let codes = vec3(colour & 255u, (colour >> 8u) & 255u, (colour >> 16u) & 255u);
    return (codes * codes + 8u) >> vec3(4u);
}

// What light in 12 bits adds with a depth to sums of 24.
fn sixteenth(product: vec3<u32>) -> vec3<u32> {
    return (product + 8u) >> vec3(4u);
}

// Light on a ball seen from the front, lit from the upper left.
fn ball_light(offset: vec2<f32>) -> f32 {
    let toward = sqrt(max(1.0 - dot(offset, offset), 0.0));
    return 0.4 + 0.6 * clamp(-0.45 * offset.x - 0.55 * offset.y + 0.70 * toward, 0.0, 1.0);
}

// Colour of a dot whose rim stands out from the ground: darker over a light one, lighter over a dark one, so that values
// that lie close together look so. `q` squared radii from its middle.
fn rimmed(rgb: vec3<u32>, q: f32, radius_px: f32) -> vec3<u32> {
    let colour = vec3<f32>(rgb);
    let inside = clamp((1.0 - sqrt(q)) * radius_px - RIM_PX, 0.0, 1.0);
    let rim = colour * lists.rim_kept + LIGHT_ONE * lists.rim_added;
    return vec3<u32>(mix(rim, colour, inside) + 0.5);
}
const RIM_PX = 0.7;

// Upper left corner of the screen tile, pixels of the whole picture.
var<private> corner_px: vec2<f32>;

fn set_corner(tile: vec2<u32>) {
    corner_px = vec2<f32>(vec2<i32>(tile * SCREEN_TILE_PX) + view.origin_px);
}

// How a cloud's light rises across it, for each radius: away from the middle of the earth as it is seen. `place` in the tile.
fn slope_of(entry: Entry, place: vec2<f32>) -> vec2<f32> {
    if (KERNEL != KERNEL_CLOUD || is_tile()) { return vec2(0.0); }
    let middle = vec2(-dot(view.eye, view.right), dot(view.eye, view.up)) * view.focal_px;
    let up = middle + (corner_px + place - view.center_px) * dot(view.eye, view.forward);
    return -up * inverseSqrt(max(dot(up, up), 1.0e-12)) * (f32(i32(entry.colour >> 24u) - 128) / SLOPE_ONE);
}

// Depth times light, as a share of what is added with it: an entry gives less than 2^24 to a sum.
const MOST_BRIGHT = 65535.0;

// Adds an entry to every second row of pixels.
fn add(entry: Entry, half: i32) {
    let pixel_units = f32(SUBPIXELS) / f32(1u << lists.entry_shift);
    let radius_px = f32(entry.size & RADIUS_BITS) / pixel_units;
    let place = vec2(f32(i32(entry.place << 16u) >> 16u), f32(i32(entry.place) >> 16u)) / pixel_units;
    let depth = f32(entry.size >> 16u);
    let rgb = light_of(entry.colour);
    // Pixels with their centre within the radius.
    let low = max(vec2<i32>(ceil(place - radius_px - 0.5)), vec2(0));
    let high = min(vec2<i32>(floor(place + radius_px - 0.5)), vec2(i32(SCREEN_TILE_PX) - 1));
    let inverse_radius = 1.0 / radius_px;
    let is_hidden = is_behind(entry);
    let slope = slope_of(entry, place);
    for (var y = low.y + ((low.y ^ half) & 1); y <= high.y; y += 2) {
        let south = (f32(y) + 0.5 - place.y) * inverse_radius;
        for (var x = low.x; x <= high.x; x++) {
            let east = (f32(x) + 0.5 - place.x) * inverse_radius;
            let pixel = u32(y) * SCREEN_TILE_PX + u32(x);
            var kept = 1.0;
            if (is_hidden) { kept = kept_of((hidden[pixel >> 2u] >> ((pixel & 3u) * 8u)) & 255u); }
            let share = depth * weight_at(east * east + south * south, radius_px) * kept;
            let amount = u32(share + 0.5);
            if (amount == 0u) { continue; }
            let bright = u32(min(share * (1.0 + slope.x * east + slope.y * south), MOST_BRIGHT) + 0.5);
            var own = rgb;
            if (KERNEL == KERNEL_BALL) { own = vec3<u32>(vec3<f32>(rgb) * ball_light(vec2(east, south)) + 0.5); }
            if (KERNEL == KERNEL_RIMMED) { own = rimmed(rgb, east * east + south * south, radius_px); }
            let given = sixteenth(own * bright);
            atomicAdd(&sums[pixel], given.x);
            atomicAdd(&sums[PIXELS + pixel], given.y);
            atomicAdd(&sums[2u * PIXELS + pixel], given.z);
            atomicAdd(&sums[3u * PIXELS + pixel], amount);
        }
    }
}

fn taken_one(at: u32) -> u32 {
    let sum = atomicLoad(&sums[at]);
    if (sum > 0u) { atomicStore(&sums[at], 0u); }
    return sum;
}

// What was added to a pixel since it was last looked at.
fn taken(at: u32) -> vec4<u32> {
    return vec4(taken_one(at), taken_one(PIXELS + at), taken_one(2u * PIXELS + at), taken_one(3u * PIXELS + at));
}

// What entries add to a pixel, the whole workgroup at work: it adds them to all pixels together.
fn summed(begin: u32, end: u32, pixel: u32) -> vec4<u32> {
    var own = vec4(0u);
    for (var base = begin; base < end; base += SAFE) {
        // Two invocations an entry.
        for (var at = base + (pixel >> 1u); at < min(base + SAFE, end); at += PIXELS / 2u) {
            add(entries[at], i32(pixel & 1u));
        }
        workgroupBarrier();
        own += min(taken(pixel), vec4(MOST_SUM) - own);
        workgroupBarrier();
    }
    return own;
}

fn is_covered(picture: vec4<f32>) -> bool {
    return is_front_to_back() && picture.w > OPAQUE;
}

// Linear light with alpha, premultiplied, once the slice with these sums is blended into it.
fn blended(picture: vec4<f32>, sums: vec4<u32>) -> vec4<f32> {
    if (sums.w == 0u || is_covered(picture)) { return picture; }
    let alpha = 1.0 - exp(-f32(sums.w) / lists.depth_one);
    let slice = vec4(vec3<f32>(sums.xyz) / (f32(sums.w) * (LIGHT_ONE / 16.0)), 1.0) * alpha;
    if (is_front_to_back()) { return picture + slice * (1.0 - picture.w); }
    return picture * (1.0 - alpha) + slice;
}

@compute @workgroup_size(SCREEN_TILE_PX, SCREEN_TILE_PX)
fn eye(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(global_invocation_id) pixel: vec3<u32>,
    @builtin(local_invocation_index) invocation: u32) {
    for (var channel = 0u; channel < 4u; channel++) { atomicStore(&sums[channel * PIXELS + invocation], 0u); }
    look_up_hidden(workgroup.xy, invocation);
    set_corner(workgroup.xy);
    let first_list = (workgroup.y * view.tiles.x + workgroup.x) * view.slices;
    var colour = vec4(0.0);
    for (var first = 0u; first < view.slices; first += LOOKED_UP) {
        let looked_up = min(view.slices - first, LOOKED_UP);
        if (invocation <= looked_up) {
            // Ends of lists, from the one before on.
            let list = first_list + first + invocation;
            ends[invocation] = 0u;
            if (list > 0u) { ends[invocation] = min(list_ends[list - 1u], lists.entry_capacity); }
        }
        workgroupBarrier();
        // Nothing to look for where nothing is listed.
        let listed = select(looked_up, 0u, ends[0] == ends[looked_up]);
        let is_worth_asking = is_front_to_back() && ends[looked_up] - ends[0] > WORTH_ASKING;
        for (var slice = 0u; slice < listed; slice++) {
            let begin = ends[slice];
            let end = ends[slice + 1u];
            if (end <= begin) { continue; }
            let long = long_sum(first_list + first + slice, end - begin, invocation);
            if (long.is_there) {
                colour = blended(colour, long.own);
                continue;
            }
            colour = blended(colour, summed(begin, end, invocation));
            if (is_worth_asking && slice % ASKED_EVERY == 0u) {
                if (invocation == 0u) { is_open = 0u; }
                workgroupBarrier();
                if (!is_covered(colour)) { is_open = 1u; }
                if (workgroupUniformLoad(&is_open) == 0u) { break; }
            }
        }
        workgroupBarrier();
    }
    if (all(pixel.xy < view.size_px)) { image[pixel.y * view.size_px.x + pixel.x] = composed(pixel.xy, colour); }
}
