// Shared by all stages: the uniforms that most of them read, the tables of layout.rs, constants, hashing and small maths.

// What is drawn and from where; lengths in earth radii.
struct ViewParams {
    eye: vec3<f32>, focal_px: f32,
    right: vec3<f32>, kind: u32,
    up: vec3<f32>, slices: u32,
    forward: vec3<f32>, front_to_back: u32,
    sun: vec3<f32>, sun_is_local: u32, cap: vec3<f32>, cap_least: f32,
    water: vec3<f32>, water_per_unit: f32, deep: vec3<f32>, hides: f32, ceiling: vec3<f32>, ceiling_kept: f32,
    size_px: vec2<u32>, origin_px: vec2<i32>, center_px: vec2<f32>, tiles: vec2<u32>, sun_share: f32,
}
@group(0) @binding(16) var<uniform> view: ViewParams;

struct GridParams {
    rows: u32, cols: u32, periodic: u32, west_rad: f32, north_rad: f32, cols_per_rad: f32, rows_per_rad: f32,
    held_first_cell: u32, held_end_cell: u32, whole_row: u32, whole_col: u32, whole_cols: u32,
}
@group(0) @binding(17) var<uniform> grid: GridParams;

// How stored values are read: between which of their steps, and as which colour.
struct ValueParams {
    weight: f32, accumulated_weight: f32, northward_weight: f32, has_accumulated: u32, transfer_low: f32,
    transfer_per_unit: f32, has_shape: u32, has_uncertainty: u32, has_coverage: u32, is_log: u32, is_nearest: u32,
}
@group(0) @binding(18) var<uniform> values: ValueParams;

struct Row {
    y_sub: i32, y_span_px: f32, sin_lat: f32, cos_lat: f32, lat_span_rad: f32, radius: f32, area_m2: f32,
    depth_gain: f32,
}
struct Col {
    x_sub: i32, x_span_px: f32, sin_lon: f32, cos_lon: f32, index: u32,
}
struct Particle {
    row: u32, slot: u32, east: f32, south: f32, height_m: f32, mass_kg: f32, depth: f32, colour: u32,
}
struct Splat {
    x_sub: i32, y_sub: i32, radius_px: f32, tau: f32, slice: f32, light_u: i32, light_v: i32, light_depth: f32,
    day: f32, colour: u32, is_beyond: u32, slope: i32,
}
struct Entry {
    place: u32, size: u32, colour: u32,
}
struct Velocity {
    east: f32, north: f32,
}
struct Axis {
    index: i32, fraction: f32,
}
struct GroundAxis {
    index: i32, fraction: f32, sin: f32, cos: f32,
}

const GROUP: u32 = 128u;
const SQUARE: u32 = 16u;
const SCREEN_TILE_PX: u32 = 16u;
const SCREEN_TILE_SHIFT: u32 = 8u;
const SUBPIXELS: i32 = 16;
const BEYOND_BIT: u32 = 0x8000u;
const RADIUS_BITS: u32 = 0x7fffu;
const MOST_PART_ENTRIES: u32 = 1024u;
const MOST_HOT_PARTS: u32 = 8192u;
const NO_LIST: u32 = 0xffffffffu;
const COVERED: u32 = 16777216u;
const SLOPE_ONE: f32 = 160.0;
const MISSING: f32 = -1.0e30;
const WATER_RED: f32 = 0.0031;
const WATER_GREEN: f32 = 0.0174;
const WATER_BLUE: f32 = 0.047;
const VIEW_TILE: u32 = 0u;
const VIEW_GLOBE: u32 = 1u;
const LIGHT_OFF: u32 = 0u;
const LIGHT_OWN: u32 = 1u;
const LIGHT_GIVEN: u32 = 2u;
const LIGHT_ALONE: u32 = 3u;
const KERNEL_DOT: u32 = 0u;
const KERNEL_BALL: u32 = 1u;
const KERNEL_CLOUD: u32 = 2u;
const KERNEL_RIMMED: u32 = 3u;
const ASKED: u32 = 0xffffffffu;
const IS_TILE: u32 = 1u;
const IS_SUBMERGED: u32 = 2u;
const HAS_SURFACE: u32 = 4u;
const HAS_TERRAIN: u32 = 8u;
const HAS_SEA_FLOOR: u32 = 16u;
const HAS_WATER: u32 = 32u;
const HAS_NIGHT: u32 = 64u;
const HAS_DAY: u32 = 128u;
const HAS_LOCAL_SUN: u32 = 256u;
const HAS_COAST: u32 = 512u;
const HAS_COAST_ABOVE: u32 = 1024u;
const HAS_LINES: u32 = 2048u;
const HAS_TRAILS: u32 = 4096u;
const LAND_HIDES: u32 = 8192u;
const HAS_COVERAGE: u32 = 16384u;
const HAS_SHAPE: u32 = 32768u;
const HAS_UNCERTAINTY: u32 = 65536u;
const HAS_ACCUMULATED: u32 = 131072u;
const IS_LOG: u32 = 262144u;
const IS_DIVERGING: u32 = 524288u;
const IS_LIT: u32 = 1048576u;
const MAKES_LIGHT: u32 = 2097152u;
const IS_LIGHT_ALONE: u32 = 4194304u;
const IS_FRONT_TO_BACK: u32 = 8388608u;
const HAS_CLOUDS: u32 = 16777216u;
const HAS_SEA_DEPTH: u32 = 33554432u;
const IS_PERIODIC: u32 = 67108864u;
const MASKS_LAND: u32 = 134217728u;
const IS_NEAREST: u32 = 268435456u;

// What a kernel is compiled for; see `features.rs`.
override FEATURES: u32 = ASKED;

// Does the picture have a feature? `asked` is what its parameters say.
fn feature(bit: u32, asked: bool) -> bool {
    if (FEATURES == ASKED) { return asked; }
    return (FEATURES & bit) != 0u;
}

fn is_tile() -> bool { return feature(IS_TILE, view.kind == VIEW_TILE); }

// Does the eye stand below the sea surface? The core hides then, in the place of the ground.
fn is_submerged() -> bool { return feature(IS_SUBMERGED, view.hides < 1.0); }

fn is_front_to_back() -> bool { return feature(IS_FRONT_TO_BACK, view.front_to_back == 1u); }

// Index of a column or row of a grid that goes round, at most so many beyond its ends.
fn wrapped(index: i32, count: i32) -> i32 {
    return index + select(0, count, index < 0) - select(0, count, index >= count);
}

fn is_missing(value: f32) -> bool {
    return value < 0.5 * MISSING;
}

// Index of an invocation in a list, of any length that two dimensions of workgroups reach.
fn list_index(global: vec3<u32>, workgroups: vec3<u32>) -> u32 {
    return global.x + global.y * workgroups.x * GROUP;
}

// A particle's colour is linear light, each channel coded by its square root in 8 bits: steps about as even to the eye as
// those of sRGB, and a multiplication decodes them.
fn codes_of(colour: u32) -> vec3<f32> {
    return vec3(f32(colour & 255u), f32((colour >> 8u) & 255u), f32((colour >> 16u) & 255u));
}

// A colour with other codes; what its last byte says stays.
fn with_codes(colour: u32, codes: vec3<f32>) -> u32 {
    let rounded = vec3<u32>(clamp(codes, vec3(0.0), vec3(255.0)) + 0.5);
    return rounded.x | (rounded.y << 8u) | (rounded.z << 16u) | (colour & 0xff000000u);
}

// IEC 61966-2-1, sRGB.
fn linear_of(srgb: vec3<f32>) -> vec3<f32> {
    return select(pow((srgb + 0.055) / 1.055, vec3(2.4)), srgb / 12.92, srgb <= vec3(0.04045));
}

fn srgb_of(linear: vec3<f32>) -> vec3<f32> {
    let light = max(linear, vec3(0.0));
    return select(1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, light * 12.92, light <= vec3(0.0031308));
}

// Nearest whole number, halves upwards: `round` may differ between devices.
fn nearest(x: f32) -> i32 {
    return i32(floor(x + 0.5));
}

// Binary logarithm of a positive number, good to 1e-7 on every device, unlike the function of some: the exponent, and the
// series of the area tangent for what is left, between the roots of 1/2 and 2.
fn binary_log(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let exponent = bitcast<i32>(bits - 0x3f3504f3u) >> 23u;
    let left = bitcast<f32>(bits - (bitcast<u32>(exponent) << 23u));
    let z = (left - 1.0) / (left + 1.0);
    let w = z * z;
    let series = 1.0 + w * (0.33333333 + w * (0.2 + w * (0.14285714 + w * 0.11111111)));
    return f32(exponent) + 2.8853901 * z * series;
}

// Place of a value between the ends of the range of colours, 0 to 1.
fn place_in_range(value: f32, low: f32, per_unit: f32, is_log: bool) -> f32 {
    var at = value;
    if (is_log) { at = binary_log(max(value, 1.0e-37)); }
    return clamp((at - low) * per_unit, 0.0, 1.0);
}
