//! The constants and the tables that Rust and WGSL share, mirrored in `prelude.wgsl`; a test compares the two.

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
/// What lies farther than this beyond the sea surface, seen from the eye, lies beyond it, m: below it, or above it for an eye
/// in the sea. It is half the sheet, which lies on both sides; trails lie on the sheet, which is then beyond the surface too.
pub const BEYOND_M: f32 = 10_000.0;
/// In the size of an entry: it lies beyond the sea surface, and land and trails hide it.
pub const BEYOND_BIT: u32 = 0x8000;
/// In the size of an entry: its radius.
pub const RADIUS_BITS: u32 = 0x7fff;
/// `ListParams::long_list`: no list is cut into parts.
pub const NEVER_LONG: u32 = u32::MAX;
/// Most entries of a part of a long list.
pub const MOST_PART_ENTRIES: u32 = 1024;
/// Most parts of a picture; lists that find no room are summed up whole.
pub const MOST_HOT_PARTS: u32 = 8192;
/// No list.
pub const NO_LIST: u32 = u32::MAX;
/// Counters that one workgroup of the scan sums up.
pub const SCAN_BLOCK: u32 = GROUP * 8;
/// Radii before and behind its centre, along the sight line, at which a cloud looks its light up: somewhat less than the
/// root of the mean square distance of its mass there, 1 over the root of 6; what comes nearest to the reference. Gauss's
/// three points (5/9 at the centre, 2/9 at the root of 3/8) are 1.4 dB nearer on a coast, 0.3 dB on the equator, and
/// cost 0.05 ms of a frame of 4.5 M particles.
pub const LOOK: f32 = 0.34;
/// Radii from its centre, across the sight line and along the vertical as it is seen, at which a cloud on a globe looks its
/// light up as well: what lies farther out is lit as the line through these two says.
pub const ASIDE: f32 = 0.4;
/// Sine of the angle between sight line and vertical from which on light may rise across a cloud as steeply as it is found to.
pub const LEAST_SINE: f32 = 0.05;
/// Square of its cosine from which on `LightParams::look_power` is what the angles say: where the eye looks along the sheet,
/// what lies before and behind a cloud is lit alike.
pub const LEAST_COSINE_SQ: f32 = 0.01;
/// Largest power of the light by which what is seen of it counts: more shows in no picture.
pub const MOST_POWER: f32 = 4.0;
/// Beyond this optical depth nothing is seen; single precision ends not far above it.
pub const MOST_EXPONENT: f32 = 60.0;
/// Parts that the slope of a cloud's light is counted in.
pub const SLOPE_ONE: f32 = 160.0;
/// What stands for "no data" in grids: NaN is not reliable in shaders.
pub const MISSING: f32 = -1.0e30;

/// A cell that holds data all over, in the whole numbers that domains are kept in: a power of two, so that its share is
/// exactly 1.
pub const COVERED: u32 = 1 << 24;

/// Colour of deep water in daylight, red, green and blue, linear light 0 to 1: in sRGB 0.04, 0.14, 0.24.
pub const WATER_RED: f32 = 0.0031;
/// See [`WATER_RED`].
pub const WATER_GREEN: f32 = 0.0174;
/// See [`WATER_RED`].
pub const WATER_BLUE: f32 = 0.047;

/// `ViewParams::kind`: a map tile.
pub const VIEW_TILE: u32 = 0;
/// `ViewParams::kind`: the globe in perspective.
pub const VIEW_GLOBE: u32 = 1;
/// `LightParams::mode`: particles are not lit.
pub const LIGHT_OFF: u32 = 0;
/// `LightParams::mode`: the picture makes its own light.
pub const LIGHT_OWN: u32 = 1;
/// `LightParams::mode`: the light is there; nothing is given to it.
pub const LIGHT_GIVEN: u32 = 2;
/// `LightParams::mode`: the light is made, and no picture.
pub const LIGHT_ALONE: u32 = 3;
/// `ListParams::kernel`: hard dots.
pub const KERNEL_DOT: u32 = 0;
/// `ListParams::kernel`: shaded balls with a soft edge.
pub const KERNEL_BALL: u32 = 1;
/// `ListParams::kernel`: soft clouds, the projection of a round cloud of density `(1 - r²)^1.5`.
pub const KERNEL_CLOUD: u32 = 2;
/// `ListParams::kernel`: hard dots with a rim of the other tone, which are told from any ground.
pub const KERNEL_RIMMED: u32 = 3;

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
        pub colour: u32,
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
        /// Place in the light buffer, in parts of a texel (`LightParams::unit` of them).
        pub light_u: i32,
        pub light_v: i32,
        /// Optical depth given to one light texel that takes all of it.
        pub light_depth: f32,
        /// Share of direct light the ground below would get, 0 on the night side.
        pub day: f32,
        /// Red, green, blue, and how much of them is the particle's own light rather than that of water before it; 8 bits
        /// each, red lowest.
        pub colour: u32,
        /// 1: farther than `ProjectParams::beyond_m` beyond the sea surface.
        pub is_beyond: u32,
        /// How much brighter it is a radius farther up in the picture, of the earth, than in its middle: in [`SLOPE_ONE`]
        /// parts, -127 to 127. Found when it is dimmed; devices store none.
        pub slope: i32,
    }
}

shared_struct! {
    /// A splat in the list of one screen tile and slice.
    pub struct Entry {
        /// Centre from the screen tile's corner, east in the low and south in the high 16 bits, both signed, in
        /// subpixels shifted right by `ListParams::entry_shift`.
        pub place: u32,
        /// Radius in the same unit in the low 15 bits, then [`BEYOND_BIT`], optical depth at the centre times `depth_one` of the lists in the high.
        pub size: u32,
        /// Red, green, blue, and the slope of its light and 128; 8 bits each, red lowest.
        pub colour: u32,
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
