// Which lists of (screen tile, slice) a splat belongs to. Whole numbers only, made once from the splat and stored, so
// that those who count and those who scatter entries cannot disagree.

// Depth of one splat at one pixel: a colour sum of the eye grows by less than 2^24 at once and cannot wrap.
const MOST_DEPTH = 65535.0;

// First and last screen tile that a splat touches, x and y; empty if it touches none.
struct Reach { low: vec2<i32>, high: vec2<i32> }

// Radius, whether it lies beyond the sea surface, and depth, as in an entry; 0 draws nothing.
fn size_word(splat: Splat) -> u32 {
    let radius = max(nearest(splat.radius_px * f32(SUBPIXELS)) >> lists.entry_shift, 1);
    var tau = splat.tau;
    if (feature(HAS_CLOUDS, lists.kernel == KERNEL_CLOUD)) {
        // A cloud whose radius was rounded keeps its mass.
        let wider = splat.radius_px / (f32(radius << lists.entry_shift) / f32(SUBPIXELS));
        tau *= wider * wider;
    }
    let depth = u32(min(tau * lists.depth_one, MOST_DEPTH) + 0.5);
    if (splat.tau <= 0.0 || depth == 0u) { return 0u; }
    return u32(radius) | (splat.is_beyond * BEYOND_BIT) | (depth << 16u);
}

fn reach_of(place: vec2<i32>, size: u32) -> Reach {
    if (size == 0u) { return Reach(vec2(0), vec2(-1)); }
    let radius = i32(size & RADIUS_BITS) << lists.entry_shift;
    let tiles = vec2<i32>(view.tiles);
    return Reach(max((place - radius) >> vec2(SCREEN_TILE_SHIFT), vec2(0)), min((place + radius) >> vec2(SCREEN_TILE_SHIFT), tiles - 1));
}

fn list_of(x: i32, y: i32, slice: u32) -> u32 {
    return (u32(y) * view.tiles.x + u32(x)) * view.slices + slice;
}
