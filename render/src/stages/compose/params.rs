//! What composition reads: mirrored in `in_context.wgsl`.

shared_struct! {
    /// What surrounds the particles.
    pub struct ContextParams {
        /// 1: the globe, or the terrain of a tile, is seen.
        pub surface: u32,
        /// 1: the sea has a colour of its own, into which what lies in it fades.
        pub has_water: u32,
        /// 1: thematic maps are dimmed where it is night.
        pub night_on: u32,
        pub terrain_on: u32,
        /// 1: the terrain is the coarse relief of the program, which shades the plain globe.
        pub sea_floor_on: u32,
        /// Exaggeration over eight earth radii, m⁻¹: from sums of differences for each radian to slopes.
        pub terrain_slope: f32,
        /// Extinction of the sea for each metre below its level that the sea floor lies at.
        pub seabed_per_m: f32,
        pub coast_on: u32,
        /// 1: coast lines lie over the picture, as on maps; else under it.
        pub coast_above: u32,
        pub coast_grey: f32,
        pub coast_alpha: f32,
        /// Words of the mask in a row of the whole picture.
        pub coast_row_words: u32,
        /// 1: land of a globe view hides what lies beyond the sea surface behind it.
        pub land_hides: u32,
        /// 1: isolines or a graticule lie on the sea surface.
        pub lines_on: u32,
        /// How much of isolines is seen through particles; all of them lies over maps.
        pub isolines_through: f32,
        pub graticule_grey: f32,
        pub graticule_alpha: f32,
        /// 1: trails lie on the sea surface.
        pub trails_on: u32,
        /// Pixels in a row of the whole picture.
        pub trails_row_px: u32,
        /// 1: a thematic map and isolines end at the coasts of a globe view.
        pub land_masked: u32,
    }
}
