//! What isolines read: mirrored in `isolines.wgsl`.

shared_struct! {
    /// Which lines a picture has on its sea surface. None of them: the stage does not run.
    pub struct IsolineParams {
        /// Lines in the table.
        pub count: u32,
        /// Way along the equator that a pixel shows, radians (tiles).
        pub rad_per_px: f32,
        /// Values are counted over the range of colours, 0 at its low end: so that numbers are of the size of 1.
        pub low: f32,
        pub per_unit: f32,
        /// Meridians in a radian, and parallels; 0 without a graticule.
        pub graticule_per_rad: f32,
        /// Half the width of one, pixels.
        pub graticule_half_px: f32,
    }
}

shared_struct! {
    /// One line, a row of the table.
    pub struct Isoline {
        /// Over the range of colours.
        pub value: f32,
        /// From it to the nearest other line, the same.
        pub gap: f32,
        /// Half its width.
        pub half_px: f32,
        /// Linear light.
        pub grey: f32,
        pub alpha: f32,
    }
}
