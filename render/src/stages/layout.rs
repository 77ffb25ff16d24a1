//! The structs that Rust and WGSL share, declared once here and mirrored in `prelude.wgsl`; a test compares the two.

/// Invocations of a workgroup in stages that run over a list.
pub const GROUP: u32 = 128;
/// Side of a square of invocations in stages that run over cells or over the pixels of a screen tile.
pub const SQUARE: u32 = 16;
/// Side of a screen tile, pixels.
pub const SCREEN_TILE_PX: u32 = 16;
/// Subpixels of a screen tile, as a shift.
pub const SCREEN_TILE_SHIFT: u32 = 8;
/// Positions on the screen are whole multiples of this part of a pixel, so that no two tiles round them differently.
pub const SUBPIXELS: i32 = 16;
/// Optical depth 1 in the integers that light and eye sum up.
pub const DEPTH_ONE: f32 = 4096.0;
/// [`Params::long_list`]: no list is cut into parts.
pub const NEVER_LONG: u32 = u32::MAX;
/// Entries of a part of a long list.
pub const PART_ENTRIES: u32 = 1024;
/// Most parts of a picture; lists that find no room are summed up whole.
pub const MOST_HOT_PARTS: u32 = 4096;
/// No list.
pub const NO_LIST: u32 = u32::MAX;
/// Counters that one workgroup of the scan sums up.
pub const SCAN_BLOCK: u32 = GROUP * 8;
/// Radii before and behind its centre, along the sight line, at which a cloud looks its light up: somewhat less than the
/// root of the mean square distance of its mass there, 1 over the root of 6; what comes nearest to the reference. Gauss's
/// three points (5/9 at the centre, 2/9 at the root of 3/8) are 1.4 dB nearer on a coast, 0.3 dB on the equator, and
/// cost 0.05 ms of a frame of 4.5 M particles.
pub const LOOK: f32 = 0.34;
/// What stands for "no data" in grids: NaN is not reliable in shaders.
pub const MISSING: f32 = -1.0e30;

/// Colour of deep water in daylight, red, green and blue, 0 to 1.
pub const WATER_RED: f32 = 0.04;
/// See [`WATER_RED`].
pub const WATER_GREEN: f32 = 0.14;
/// See [`WATER_RED`].
pub const WATER_BLUE: f32 = 0.24;

/// [`Params::view`]: a map tile.
pub const VIEW_TILE: u32 = 0;
/// [`Params::view`]: the globe in perspective.
pub const VIEW_GLOBE: u32 = 1;
/// [`Params::light_on`]: particles are not lit.
pub const LIGHT_OFF: u32 = 0;
/// [`Params::light_on`]: the picture makes its own light.
pub const LIGHT_OWN: u32 = 1;
/// [`Params::light_on`]: the light is there; nothing is given to it.
pub const LIGHT_GIVEN: u32 = 2;
/// [`Params::light_on`]: the light is made, and no picture.
pub const LIGHT_ALONE: u32 = 3;
/// [`Params::kernel`]: hard dots.
pub const KERNEL_DOT: u32 = 0;
/// [`Params::kernel`]: shaded balls with a soft edge.
pub const KERNEL_BALL: u32 = 1;
/// [`Params::kernel`]: soft clouds, the projection of a round cloud of density `(1 - r²)^1.5`.
pub const KERNEL_CLOUD: u32 = 2;

shared_struct! {
    /// Everything that all stages of one picture agree on.
    pub struct Params {
        pub rows: u32,
        pub cols: u32,
        pub periodic: u32,
        pub first_cell: u32,
        pub end_cell: u32,
        /// Cells that the buffers of frames hold, the first and the end: all unless a frame is too large to be held whole.
        pub held_first_cell: u32,
        pub held_end_cell: u32,
        pub value_weight: f32,
        pub accumulated_weight: f32,
        /// Of the later step in the northward part of a flow.
        pub northward_weight: f32,
        pub has_accumulated: u32,
        pub transfer_low: f32,
        pub transfer_per_unit: f32,
        pub strength_per_unit: f32,
        pub diverging: u32,
        pub depth_floor: f32,
        /// Rows of the grid from `first_row` on, and columns of the table, whose cells may be drawn.
        pub first_row: u32,
        pub row_count: u32,
        pub slot_count: u32,
        /// Least cosine of a cell's angle to the place below the camera, times the camera's distance (globe).
        pub cap_least: f32,
        pub particles_per_cell: u32,
        /// Particles of its cell that one invocation makes.
        pub particles_each: u32,
        /// Places for splats, those of cells without data included.
        pub splat_count: u32,
        /// Random places spread over 2 to the minus this of a cell.
        pub jitter_shift: u32,
        pub height_m_per_kg_m2: f32,
        pub height_limit_m: f32,
        pub sheet_m: f32,
        pub turns_per_kg_m2: f32,
        pub optical_depth: f32,
        pub view: u32,
        pub kernel: u32,
        pub front_to_back: u32,
        pub width: u32,
        pub height: u32,
        pub tiles_x: u32,
        pub tiles_y: u32,
        pub slices: u32,
        pub entry_capacity: u32,
        /// Lists of more entries are summed up in parts.
        pub long_list: u32,
        pub min_radius_px: f32,
        pub max_radius_px: f32,
        pub size_spread: f32,
        pub height_px_per_m: f32,
        pub slice_top: f32,
        pub slices_per_unit: f32,
        pub light_on: u32,
        pub light_width: u32,
        pub light_height: u32,
        pub light_unit: i32,
        pub light_origin_x: i32,
        pub light_origin_y: i32,
        pub light_shift_x_per_m: f32,
        pub light_shift_y_per_m: f32,
        pub light_depth_gain: f32,
        /// From a place in the light towards the eye, for each pixel of radius: this, less `toward_pull` times the place
        /// (in parts of texels and in slices).
        pub toward_u: f32,
        pub toward_v: f32,
        pub toward_slice: f32,
        pub toward_pull: f32,
        /// Power of the light at a place by which what is seen of it counts.
        pub look_power: f32,
        pub light_u0: f32,
        pub light_v0: f32,
        pub light_texels_per_unit: f32,
        pub ambient: f32,
        pub direct: f32,
        pub lon_span_rad: f32,
        pub per_earth_radius_m: f32,
        pub focal_px: f32,
        pub eye_x: f32,
        pub eye_y: f32,
        pub eye_z: f32,
        pub right_x: f32,
        pub right_y: f32,
        pub right_z: f32,
        pub up_x: f32,
        pub up_y: f32,
        pub up_z: f32,
        pub forward_x: f32,
        pub forward_y: f32,
        pub forward_z: f32,
        pub half_x: f32,
        pub half_y: f32,
        pub half_z: f32,
        pub sun_x: f32,
        pub sun_y: f32,
        pub sun_z: f32,
        pub light_u_x: f32,
        pub light_u_y: f32,
        pub light_u_z: f32,
        pub light_v_x: f32,
        pub light_v_y: f32,
        pub light_v_z: f32,
        pub center_px_x: f32,
        pub center_px_y: f32,
        pub grid_west_rad: f32,
        pub grid_north_rad: f32,
        pub cols_per_rad: f32,
        pub rows_per_rad: f32,
        pub edge_sharpness: f32,
        pub map_alpha: f32,
        pub surface: u32,
        /// Left and top of the part drawn, pixels (globe views are drawn in parts).
        pub origin_x_px: i32,
        pub origin_y_px: i32,
        /// Bits that places in lists are coarser than subpixels, so that the largest particle fits 16 bits.
        pub entry_shift: u32,
        /// The palette is followed by 256 words of opacity (low 16 bits) and size (next 8).
        pub shape_table: u32,
        /// Cells whose gap was filled are drawn differently.
        pub uncertainty: u32,
        /// 1: the picture is composed with coast lines, terrain, sea or night (`stages/compose/in_context.wgsl`).
        pub in_context: u32,
        /// 1: particles of tiles are dimmed where it is night.
        pub day_on: u32,
        /// 1: thematic maps are dimmed where it is night.
        pub night_on: u32,
        /// 1: the sun is given in east, north and up of every place; else in the axes of eq. 4 (docs/method.md).
        pub sun_is_local: u32,
        /// Extinction of the sea for each metre below its surface that a particle is drawn at.
        pub sea_per_m: f32,
        /// The same for each metre below the level of the sea that its floor lies at.
        pub seabed_per_m: f32,
        pub terrain_on: u32,
        pub terrain_rows: u32,
        pub terrain_cols: u32,
        pub terrain_periodic: u32,
        pub terrain_west_rad: f32,
        pub terrain_north_rad: f32,
        pub terrain_cols_per_rad: f32,
        pub terrain_rows_per_rad: f32,
        /// Exaggeration over eight earth radii, m⁻¹: from sums of differences for each radian to slopes.
        pub terrain_slope: f32,
        pub coast_on: u32,
        /// 1: coast lines lie over the picture, as on maps; else under it.
        pub coast_above: u32,
        pub coast_grey: f32,
        pub coast_alpha: f32,
        /// Words of the coast mask in a row of the whole picture.
        pub coast_row_words: u32,
        /// How far into its life a particle is that is born at 0 in every life, 0 to 1 (flow).
        pub flow_turn: f32,
        /// Which of its lives that is.
        pub flow_cycle: u32,
        /// Share of the particles that live at all, of 2^32.
        pub flow_share: u32,
        /// Steps from a particle's birthplace to its trail's end.
        pub flow_lead_steps: u32,
        /// Columns on the equator, and rows, that 1 m/s drifts through in a life.
        pub flow_cols_per_m_s: f32,
        pub flow_rows_per_m_s: f32,
        /// Columns of the whole circle: no particle goes farther in a life.
        pub flow_most_cols: f32,
        /// Speed above which particles are drawn no faster, m/s.
        pub flow_most_m_s: f32,
        /// Pixels on the equator, or below the camera, that 1 m/s drifts through in a life.
        pub flow_px_per_m_s: f32,
    }
}

shared_struct! {
    /// One row of the grid as the view sees it.
    pub struct Row {
        /// Northern edge, subpixels south of the picture's top (tiles).
        pub y_sub: i32,
        /// Height, pixels (tiles).
        pub y_span_px: f32,
        /// Of the row's middle latitude.
        pub sin_lat: f32,
        pub cos_lat: f32,
        /// Height, radians (the same).
        pub lat_span_rad: f32,
        /// Particle radius: pixels (tiles), earth radii (globe).
        pub radius: f32,
        /// Area of one cell, m².
        pub area_m2: f32,
        /// Optical depth at a particle's centre for a column of optical depth 1.
        pub depth_gain: f32,
    }
}

shared_struct! {
    /// One column of the grid, or one of its copies beyond the date line, as the view sees it.
    pub struct Col {
        /// Western edge, subpixels east of the picture's left (tiles).
        pub x_sub: i32,
        /// Width, pixels (tiles).
        pub x_span_px: f32,
        /// Of the column's middle longitude.
        pub sin_lon: f32,
        pub cos_lon: f32,
        /// Which column of the grid.
        pub index: u32,
    }
}

/// A cell to draw: which one, and through which copy of its column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Active {
    pub cell: u32,
    pub slot: u32,
}

shared_struct! {
    /// A particle in the frame of its cell.
    pub struct Particle {
        pub row: u32,
        pub slot: u32,
        /// Place in the cell, 0 west to 1 east.
        pub east: f32,
        /// Place in the cell, 0 north to 1 south.
        pub south: f32,
        /// Above the sea surface; negative below it.
        pub height_m: f32,
        /// Its share of the carbon the cell has given off, kg.
        pub mass_kg: f32,
        /// Optical depth that it gives its column, before sharing.
        pub depth: f32,
        /// Red, green, blue, strength; 8 bits each, red lowest.
        pub color: u32,
    }
}

shared_struct! {
    /// A particle on the screen and in the light. Devices store it packed, see `passes/splat`.
    pub struct Splat {
        /// Centre, subpixels east of the picture's left.
        pub x_sub: i32,
        /// Centre, subpixels south of the picture's top.
        pub y_sub: i32,
        pub radius_px: f32,
        /// Optical depth at the centre; 0 draws nothing.
        pub tau: f32,
        /// Slice and place within it.
        pub slice: f32,
        /// Place in the light buffer, in parts of a texel (`Params::light_unit` of them).
        pub light_u: i32,
        pub light_v: i32,
        /// Optical depth given to one light texel that takes all of it.
        pub light_depth: f32,
        /// Share of direct light the ground below would get, 0 on the night side.
        pub day: f32,
        /// Red, green, blue, strength; 8 bits each, red lowest.
        pub color: u32,
    }
}

shared_struct! {
    /// A splat in the list of one screen tile and slice.
    pub struct Entry {
        /// Centre from the screen tile's corner, east in the low and south in the high 16 bits, both signed, in
        /// subpixels shifted right by `Params::entry_shift`.
        pub place: u32,
        /// Radius in the same unit in the low 16 bits, optical depth at the centre times [`DEPTH_ONE`] in the high.
        pub size: u32,
        /// Red, green, blue, slice; 8 bits each, red lowest.
        pub color: u32,
    }
}

shared_struct! {
    /// Velocity of one cell of a flow, m/s; both parts [`MISSING`] where either is.
    pub struct Velocity {
        pub east: f32,
        pub north: f32,
    }
}

shared_struct! {
    /// Where a pixel's column or row falls between two cell centres (tiles).
    pub struct Axis {
        /// Cell west or north of the place; may lie outside the grid.
        pub index: i32,
        /// 0 at that cell's centre, 1 at the next one's.
        pub fraction: f32,
    }
}

shared_struct! {
    /// Where a pixel's column or row lies on the earth (tiles): its place between two cell centres of the terrain, and
    /// its longitude or latitude.
    pub struct GroundAxis {
        /// Cell west or north of the place; may lie outside the grid.
        pub index: i32,
        /// 0 at that cell's centre, 1 at the next one's.
        pub fraction: f32,
        pub sin: f32,
        pub cos: f32,
    }
}

/// Does a stored value stand for "no data"?
pub fn is_missing(value: f32) -> bool {
    value < 0.5 * MISSING
}

/// Nearest whole number, halves upwards, the same on every device.
pub fn nearest(x: f32) -> i32 {
    (x + 0.5).floor() as i32
}
