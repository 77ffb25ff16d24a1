// Lines on the sea surface: isolines of the interpolated grid, bilinear between cells with data, and the graticule; how much
// of every pixel they cover.
struct IsolineParams { count: u32, rad_per_px: f32, low: f32, per_unit: f32, graticule_per_rad: f32, graticule_half_px: f32 }
@group(0) @binding(30) var<uniform> isolines: IsolineParams;
// A line: its value and how far the next ones are from it, over the range of colours; half its width; its look.
struct Isoline { value: f32, gap: f32, half_px: f32, grey: f32, alpha: f32 }
@group(0) @binding(1) var<storage, read> before: array<f32>;
@group(0) @binding(2) var<storage, read> after: array<f32>;
@group(0) @binding(3) var<storage, read> domain: array<u32>;
@group(0) @binding(4) var<storage, read> axes: array<Axis>;
@group(0) @binding(5) var<storage, read> ground_axes: array<GroundAxis>;
@group(0) @binding(6) var<storage, read> levels: array<Isoline>;
@group(0) @binding(7) var<storage, read_write> lines: array<u32>;

// Lines of one step for each pixel from which on they fade, and at which they are gone: they would be a grey.
const CROWDED = 0.2;
const TOO_CROWDED = 0.5;
// Lines fade so much for each pixel towards the limb.
const RIM_PER_PX = 0.3;
// Pixels across up to which a closed line round a single cell is left out; from twice as many on it is drawn whole.
const LEAST_LOOP_PX = 3.0;
// Pixels between lines beyond which they fade, and are gone at twice as many: on a level plain any place is on the line.
const FLAT_PX = 10000.0;

// A place between centres of cells, the value there over the range of colours, and its change for each column and row; without
// weight where there is no data.
struct FieldAt { x: Axis, y: Axis, weight: f32, value: f32, per_col: f32, per_row: f32 }

// How a field lies on the screen: what its value changes by over a pixel, the size of a cell, and how much is seen of lines.
struct OnScreen { slope: f32, cell_px: vec2<f32>, inside: f32 }

// Value times the share of the cell that holds data, 1, and that share; or zeros where there is no data.
fn cell_value(row: i32, col: i32) -> vec3<f32> {
    let cell = cell_at(row, col);
    if (cell == NO_CELL) { return vec3(0.0); }
    let value = interpolated(before[cell], after[cell], values.weight);
    if (is_missing(value)) { return vec3(0.0); }
    let share = share_of(cell);
    return vec3((value - isolines.low) * isolines.per_unit * share, 1.0, share);
}

fn field_at(x: Axis, y: Axis) -> FieldAt {
    let north_west = cell_value(y.index, x.index);
    let north_east = cell_value(y.index, x.index + 1);
    let south_west = cell_value(y.index + 1, x.index);
    let south_east = cell_value(y.index + 1, x.index + 1);
    let north = mix(north_west, north_east, x.fraction);
    let south = mix(south_west, south_east, x.fraction);
    let sum = mix(north, south, y.fraction);
    var field: FieldAt;
    field.x = x;
    field.y = y;
    if (sum.y < 0.5 || sum.z <= 0.0) { return field; }
    let east = mix(north_east - north_west, south_east - south_west, y.fraction);
    let down = south - north;
    field.weight = sum.y;
    field.value = sum.x / sum.z;
    field.per_col = (east.x - field.value * east.z) / sum.z;
    field.per_row = (down.x - field.value * down.z) / sum.z;
    return field;
}

// What changes so much for each radian east and north changes so much over a pixel of a tile.
fn slope_on_tile(per_rad: vec2<f32>, cos_lat: f32) -> f32 {
    return length(vec2(per_rad.x, per_rad.y * cos_lat)) * isolines.rad_per_px;
}

// The same of a globe view: a step on the screen, to the right and down, is one along the ground.
fn slope_on_globe(per_rad: vec2<f32>, normal: vec3<f32>) -> f32 {
    let toward = normal - view.eye;
    let sight = normalize(toward);
    let along = 1.0 / dot(sight, normal);
    let way = dot(toward, view.forward) / view.focal_px;
    let right = (view.right - sight * (dot(view.right, normal) * along)) * way;
    let down = (view.up - sight * (dot(view.up, normal) * along)) * -way;
    let cos_lat = max(length(normal.xy), 1.0e-6);
    let east = vec3(normal.y, -normal.x, 0.0) / cos_lat;
    let north = vec3(-normal.xy * (normal.z / cos_lat), cos_lat);
    let rise = east * (per_rad.x / cos_lat) + north * per_rad.y;
    return length(vec2(dot(rise, right), dot(rise, down)));
}

// Lines that crowd fade: so many of a step for each pixel.
fn crowd(per_px: f32) -> f32 {
    return clamp((TOO_CROWDED - per_px) / (TOO_CROWDED - CROWDED), 0.0, 1.0);
}

// Share of a pixel that meridians or parallels cover, by its angle and what that changes by over a pixel.
fn graticule_of(angle: f32, slope: f32) -> f32 {
    let place = angle * isolines.graticule_per_rad;
    let per_px = max(slope * isolines.graticule_per_rad, 1.0e-20);
    let off_px = abs(place - floor(place + 0.5)) / per_px;
    return clamp(isolines.graticule_half_px + 0.5 - off_px, 0.0, 1.0) * crowd(per_px);
}

// Value of a cell over the range of colours, or none.
fn value_of(row: i32, col: i32) -> f32 {
    let own = cell_value(row, col);
    if (own.z <= 0.0) { return MISSING; }
    return own.x / own.z;
}

// Of the four cells round a place the one that alone lies on its side of a level: its number, or 4.
fn lone_corner(field: FieldAt, level: f32) -> i32 {
    var above = 0;
    var below = 0;
    var high = 0;
    var low = 0;
    for (var i = 0; i < 4; i++) {
        let own = value_of(field.y.index + i / 2, field.x.index + i % 2);
        if (is_missing(own)) { continue; }
        if (own > level) { above++; high = i; } else { below++; low = i; }
    }
    if (above == 1) { return high; }
    if (below == 1) { return low; }
    return 4;
}

// How much is drawn of a line at a place: less of one that runs round a single cell, which it calls a dot where it is small.
// Between neighbours in a row or a column the value is linear, which says how wide and how high the line is round the cell.
fn loop_share(field: FieldAt, level: f32, cell_px: vec2<f32>) -> f32 {
    let corner = lone_corner(field, level);
    if (corner == 4) { return 1.0; }
    let row = field.y.index + corner / 2;
    let col = field.x.index + corner % 2;
    let own = value_of(row, col);
    var cells = vec2(0.0);
    for (var i = 0; i < 9; i++) {
        if (i == 4) { continue; }
        let other = value_of(row + i / 3 - 1, col + i % 3 - 1);
        let is_there = !is_missing(other);
        // It goes on round this one too.
        if (is_there && (other > level) == (own > level)) { return 1.0; }
        if (i % 2 == 0) { continue; }
        var reach = 0.5;
        if (is_there) { reach = (own - level) / (own - other); }
        if (i == 1 || i == 7) { cells.y += reach; } else { cells.x += reach; }
    }
    let size_px = max(cells.x * cell_px.x, cells.y * cell_px.y);
    return clamp(size_px / LEAST_LOOP_PX - 1.0, 0.0, 1.0);
}

// Share of a pixel that isolines cover, in the low 12 bits, and their grey in the next 8.
fn line_of(field: FieldAt, screen: OnScreen) -> u32 {
    var cover = 0.0;
    var grey = 0.0;
    for (var i = 0u; i < isolines.count; i++) {
        let level = levels[i];
        let off_px = abs(field.value - level.value) / max(screen.slope, 1.0e-20);
        let per_px = screen.slope / level.gap;
        let steep = clamp(per_px * (2.0 * FLAT_PX) - 1.0, 0.0, 1.0);
        var own = clamp(level.half_px + 0.5 - off_px, 0.0, 1.0) * level.alpha * crowd(per_px) * steep;
        if (own > cover) { own *= loop_share(field, level.value, screen.cell_px); }
        if (own > cover) {
            cover = own;
            grey = level.grey;
        }
    }
    return u32(nearest(cover * screen.inside * 4095.0)) | (u32(nearest(grey * 255.0)) << 12u);
}

// Change of the value for each radian east and north.
fn per_rad_of(field: FieldAt) -> vec2<f32> {
    return vec2(field.per_col * grid.cols_per_rad, -field.per_row * grid.rows_per_rad);
}

fn tile_screen(field: FieldAt, cos_lat: f32) -> OnScreen {
    let cells_per_px = vec2(slope_on_tile(vec2(grid.cols_per_rad, 0.0), cos_lat), slope_on_tile(vec2(0.0, grid.rows_per_rad), cos_lat));
    return OnScreen(slope_on_tile(per_rad_of(field), cos_lat), 1.0 / max(cells_per_px, vec2(1.0e-20)), 1.0);
}

fn globe_screen(field: FieldAt, normal: vec3<f32>, inside: f32) -> OnScreen {
    let cells_per_px = vec2(slope_on_globe(vec2(grid.cols_per_rad, 0.0), normal), slope_on_globe(vec2(0.0, grid.rows_per_rad), normal));
    return OnScreen(slope_on_globe(per_rad_of(field), normal), 1.0 / max(cells_per_px, vec2(1.0e-20)), inside);
}

@compute @workgroup_size(SCREEN_TILE_PX, SCREEN_TILE_PX)
fn draw_lines(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if (any(pixel.xy >= view.size_px)) { return; }
    let at = pixel.y * view.size_px.x + pixel.x;
    lines[at] = 0u;
    if (is_tile()) {
        let field = field_at(axes[pixel.x], axes[view.size_px.x + pixel.y]);
        if (field.weight > 0.0) { lines[at] = line_of(field, tile_screen(field, ground_axes[view.size_px.x + pixel.y].cos)); }
        return;
    }
    let hit = ground_below(pixel.xy);
    if (!hit.on_ground) { return; }
    var word = 0u;
    // At the limb a pixel reaches far.
    let inside = clamp(hit.rim_px * RIM_PER_PX - 0.5, 0.0, 1.0) * line_share(hit);
    if (isolines.count > 0u) {
        let field = field_at(col_of(hit.lon), row_of(hit.lat));
        if (field.weight > 0.0) { word = line_of(field, globe_screen(field, hit.normal, inside)); }
    }
    if (isolines.graticule_per_rad > 0.0) {
        let meridian = graticule_of(hit.lon, slope_on_globe(vec2(1.0, 0.0), hit.normal));
        let parallel = graticule_of(hit.lat, slope_on_globe(vec2(0.0, 1.0), hit.normal));
        // The high 12 bits.
        word |= u32(nearest(max(meridian, parallel) * inside * 4095.0)) << 20u;
    }
    lines[at] = word;
}
