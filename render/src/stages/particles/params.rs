//! What the functions of a particle read: mirrored in `particles.wgsl`.

shared_struct! {
    /// From a cell's values to the height, depth and colour of its particles.
    pub struct ParticleParams {
        /// Random places spread over 2 to the minus this of a cell.
        pub jitter_shift: u32,
        /// 1: values of the range lie on both sides of zero.
        pub diverging: u32,
        pub strength_per_unit: f32,
        /// Share of the optical depth that a value without strength keeps.
        pub depth_floor: f32,
        pub optical_depth: f32,
        pub height_m_per_kg_m2: f32,
        pub height_limit_m: f32,
        pub sheet_m: f32,
        pub turns_per_kg_m2: f32,
        /// Extinction of the sea for each metre below its surface that a particle is drawn at.
        pub sea_per_m: f32,
    }
}
