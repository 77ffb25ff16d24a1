//! What the functions of a particle that drifts read: mirrored in `flow.wgsl`.

shared_struct! {
    /// How long particles live, where in their lives they are and how far they get.
    pub struct FlowParams {
        /// How far into its life a particle is that is born at 0 in every life, 0 to 1.
        pub turn: f32,
        /// Which of its lives that is.
        pub cycle: u32,
        /// Share of the particles that live at all, of 2^32.
        pub share: u32,
        /// Steps from a particle's birthplace to its trail's end.
        pub lead_steps: u32,
        /// Columns on the equator, and rows, that 1 m/s drifts through in a life.
        pub cols_per_m_s: f32,
        pub rows_per_m_s: f32,
        /// Columns of the whole circle: no particle goes farther in a life.
        pub most_cols: f32,
        /// Speed above which particles are drawn no faster, m/s.
        pub most_m_s: f32,
        /// Pixels on the equator, or below the camera, that 1 m/s drifts through in a life.
        pub px_per_m_s: f32,
        /// Of `ValueParams`: a kernel may read few structs (see `Kernel::reading`).
        pub transfer_low: f32,
        pub transfer_per_unit: f32,
        pub has_shape: u32,
        pub is_log: u32,
    }
}
