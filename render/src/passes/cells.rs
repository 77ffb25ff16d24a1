//! Which cells the passes over particles draw: mirrored in `order.wgsl`.

shared_struct! {
    /// Which cells are drawn, and how their particles are spread over invocations.
    pub struct CellParams {
        /// Rows of the grid from `first_row` on, and columns of the table, whose cells may be drawn.
        pub first_row: u32,
        pub row_count: u32,
        pub slot_count: u32,
        pub particles_per_cell: u32,
        /// Particles of its cell that one invocation makes.
        pub particles_each: u32,
        /// Places for splats, those of cells without data included.
        pub splat_count: u32,
    }
}
