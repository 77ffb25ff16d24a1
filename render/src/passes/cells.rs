//! Which cells the passes over particles draw: mirrored in `order.wgsl`.

shared_struct! {
    /// Which cells are drawn, and how their particles are spread over invocations.
    pub struct CellParams {
        /// Rows of the grid from `first_row` on, and columns of the table, whose cells may be drawn.
        pub first_row: u32,
        pub row_count: u32,
        pub slot_count: u32,
        pub particles_per_cell: u32,
        /// The same by their shares: all are whole but the last, which comes and goes gradually as cells grow and shrink.
        pub particle_shares: f32,
        /// Particles of its cell that one invocation makes.
        pub particles_each: u32,
        /// Places for splats, those of cells without data included.
        pub splat_count: u32,
    }
}

impl CellParams {
    /// Sets how many particles a cell has, the last of them in part.
    pub(crate) fn set_particles(&mut self, particles: f64) {
        self.particles_per_cell = particles.ceil() as u32;
        self.particle_shares = particles as f32;
    }
}
