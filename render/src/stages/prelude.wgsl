// Shared by all stages: the structs of layout.rs, constants, hashing and small maths.
struct Params {
    rows: u32, cols: u32, periodic: u32, first_cell: u32, end_cell: u32, held_first_cell: u32, held_end_cell: u32,
    value_weight: f32, accumulated_weight: f32, northward_weight: f32,
    has_accumulated: u32, transfer_low: f32, transfer_per_unit: f32, strength_per_unit: f32, diverging: u32,
    depth_floor: f32, first_row: u32, row_count: u32, slot_count: u32, cap_x: f32, cap_y: f32, cap_z: f32, cap_least: f32, particles_per_cell: u32,
    particles_each: u32, splat_count: u32, jitter_shift: u32, height_m_per_kg_m2: f32,
    height_limit_m: f32, sheet_m: f32, turns_per_kg_m2: f32, optical_depth: f32, view: u32, kernel: u32,
    front_to_back: u32, width: u32, height: u32, tiles_x: u32, tiles_y: u32, slices: u32, entry_capacity: u32, long_list: u32,
    min_radius_px: f32, max_radius_px: f32, size_spread: f32, height_px_per_m: f32, slice_top: f32,
    slices_per_unit: f32, light_on: u32, light_width: u32, light_height: u32, light_unit: i32, light_origin_x: i32,
    light_origin_y: i32, light_shift_x_per_m: f32, light_shift_y_per_m: f32, light_depth_gain: f32, toward_u: f32, toward_v: f32,
    toward_slice: f32, toward_pull: f32, look_power: f32, light_u0: f32,
    light_v0: f32, light_texels_per_unit: f32, ambient: f32, direct: f32, lon_span_rad: f32, per_earth_radius_m: f32,
    focal_px: f32, eye_x: f32, eye_y: f32, eye_z: f32, right_x: f32, right_y: f32, right_z: f32, up_x: f32,
    up_y: f32, up_z: f32, forward_x: f32, forward_y: f32, forward_z: f32, half_x: f32, half_y: f32, half_z: f32,
    sun_x: f32, sun_y: f32, sun_z: f32, light_u_x: f32, light_u_y: f32, light_u_z: f32, light_v_x: f32,
    light_v_y: f32, light_v_z: f32, center_px_x: f32, center_px_y: f32, grid_west_rad: f32, grid_north_rad: f32,
    cols_per_rad: f32, rows_per_rad: f32, edge_sharpness: f32, map_alpha: f32, surface: u32, origin_x_px: i32,
    origin_y_px: i32, entry_shift: u32, shape_table: u32, uncertainty: u32,
    in_context: u32, day_on: u32, night_on: u32, sun_is_local: u32, sea_per_m: f32,
    seabed_per_m: f32, terrain_on: u32, terrain_rows: u32, terrain_cols: u32, terrain_periodic: u32,
    terrain_west_rad: f32, terrain_north_rad: f32, terrain_cols_per_rad: f32, terrain_rows_per_rad: f32,
    terrain_slope: f32, coast_on: u32, coast_above: u32, coast_grey: f32, coast_alpha: f32, coast_row_words: u32,
    flow_turn: f32, flow_cycle: u32, flow_share: u32, flow_lead_steps: u32,
    flow_cols_per_m_s: f32, flow_rows_per_m_s: f32, flow_most_cols: f32, flow_most_m_s: f32,
    flow_px_per_m_s: f32,
}
struct Row {
    y_sub: i32, y_span_px: f32, sin_lat: f32, cos_lat: f32, lat_span_rad: f32, radius: f32, area_m2: f32,
    depth_gain: f32,
}
struct Col {
    x_sub: i32, x_span_px: f32, sin_lon: f32, cos_lon: f32, index: u32,
}
struct Particle {
    row: u32, slot: u32, east: f32, south: f32, height_m: f32, mass_kg: f32, depth: f32, color: u32,
}
struct Splat {
    x_sub: i32, y_sub: i32, radius_px: f32, tau: f32, slice: f32, light_u: i32, light_v: i32, light_depth: f32,
    day: f32, color: u32,
}
struct Entry {
    place: u32, size: u32, color: u32,
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
const DEPTH_ONE: f32 = 4096.0;
const PART_ENTRIES: u32 = 1024u;
const MOST_HOT_PARTS: u32 = 4096u;
const NO_LIST: u32 = 0xffffffffu;
const MISSING: f32 = -1.0e30;
const WATER_RED: f32 = 0.04;
const WATER_GREEN: f32 = 0.14;
const WATER_BLUE: f32 = 0.24;
const VIEW_TILE: u32 = 0u;
const VIEW_GLOBE: u32 = 1u;
const LIGHT_OFF: u32 = 0u;
const LIGHT_OWN: u32 = 1u;
const LIGHT_GIVEN: u32 = 2u;
const LIGHT_ALONE: u32 = 3u;
const KERNEL_DOT: u32 = 0u;
const KERNEL_BALL: u32 = 1u;
const KERNEL_CLOUD: u32 = 2u;

@group(0) @binding(0) var<uniform> params: Params;

fn is_missing(value: f32) -> bool {
    return value < 0.5 * MISSING;
}

// Index of an invocation in a list, of any length that two dimensions of workgroups reach.
fn list_index(global: vec3<u32>, workgroups: vec3<u32>) -> u32 {
    return global.x + global.y * workgroups.x * GROUP;
}

// Nearest whole number, halves upwards: `round` may differ between devices.
fn nearest(x: f32) -> i32 {
    return i32(floor(x + 0.5));
}
