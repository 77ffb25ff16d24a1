// Thematic map: the interpolated grid, bilinear between cells with data, in the colours of the transfer function.
struct MapParams { alpha: f32, edge_sharpness: f32 }
@group(0) @binding(26) var<uniform> thematic: MapParams;
@group(0) @binding(1) var<storage, read> value_grid: array<f32>;
@group(0) @binding(2) var<storage, read> palette: array<u32>;
@group(0) @binding(3) var<storage, read> axes: array<Axis>;
@group(0) @binding(4) var<storage, read_write> picture: array<vec4<f32>>;
// Bound but never read where uncertainty is not drawn.
@group(0) @binding(5) var<storage, read> uncertainty_before: array<f32>;
@group(0) @binding(6) var<storage, read> uncertainty_after: array<f32>;
// Bound but never read where every cell with data is covered all over.
@group(0) @binding(7) var<storage, read> domain: array<u32>;

// Value times the share of the cell that holds data, 1, and that share; or zeros where there is no data.
fn cell_value(row: i32, col: i32) -> vec3<f32> {
    let cell = cell_at(row, col);
    if (cell == NO_CELL) { return vec3(0.0); }
    let value = value_grid[cell];
    if (is_missing(value)) { return vec3(0.0); }
    let share = share_of(cell);
    return vec3(value * share, 1.0, share);
}

fn cell_uncertainty(row: i32, col: i32) -> f32 {
    let cell = cell_at(row, col);
    if (cell == NO_CELL) { return 0.0; }
    return uncertainty_of(cell);
}

fn uncertainty_at(x: Axis, y: Axis) -> f32 {
    let north = mix(cell_uncertainty(y.index, x.index), cell_uncertainty(y.index, x.index + 1), x.fraction);
    let south = mix(cell_uncertainty(y.index + 1, x.index), cell_uncertainty(y.index + 1, x.index + 1), x.fraction);
    return mix(north, south, y.fraction);
}

// The cell that a place lies in, where cells have nothing between them.
fn in_cell(place: Axis) -> Axis {
    if (feature(IS_NEAREST, values.is_nearest == 1u)) {
        return Axis(place.index + select(0, 1, place.fraction >= 0.5), 0.0);
    }
    return place;
}

fn colour_at(across: Axis, down: Axis, pixel: vec2<u32>) -> vec4<f32> {
    let x = in_cell(across);
    let y = in_cell(down);
    let north = mix(cell_value(y.index, x.index), cell_value(y.index, x.index + 1), x.fraction);
    let south = mix(cell_value(y.index + 1, x.index), cell_value(y.index + 1, x.index + 1), x.fraction);
    let value = mix(north, south, y.fraction);
    // Half the weight on data: the edge of the data runs between cell centres, one pixel soft.
    var alpha = thematic.alpha * clamp((value.y - 0.5) * thematic.edge_sharpness + 0.5, 0.0, 1.0);
    if (alpha <= 0.0 || value.z <= 0.0) { return vec4(0.0); }
    if (feature(HAS_COVERAGE, values.has_coverage == 1u)) { alpha *= value.z / value.y; }
    let position = place_in_range(value.x / value.z, values.transfer_low, values.transfer_per_unit, feature(IS_LOG, values.is_log == 1u));
    let at = u32(nearest(position * 255.0));
    if (feature(HAS_SHAPE, values.has_shape == 1u)) { alpha *= f32(palette[256u + at] & 0xffffu) / 65535.0; }
    let colour = palette[at];
    var rgb = vec3(f32(colour & 255u), f32((colour >> 8u) & 255u), f32((colour >> 16u) & 255u)) / 255.0;
    if (feature(HAS_UNCERTAINTY, values.has_uncertainty == 1u)) { rgb = hatched(rgb, uncertainty_at(x, y), pixel); }
    return vec4(linear_of(rgb), 1.0) * alpha;
}

@compute @workgroup_size(SCREEN_TILE_PX, SCREEN_TILE_PX)
fn map(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if (any(pixel.xy >= view.size_px)) { return; }
    let at = pixel.y * view.size_px.x + pixel.x;
    if (is_tile()) {
        picture[at] = colour_at(axes[pixel.x], axes[view.size_px.x + pixel.y], pixel.xy);
        return;
    }
    let hit = ground_below(pixel.xy);
    if (!hit.on_ground) {
        picture[at] = vec4(0.0);
        return;
    }
    picture[at] = colour_at(col_of(hit.lon), row_of(hit.lat), pixel.xy);
}
