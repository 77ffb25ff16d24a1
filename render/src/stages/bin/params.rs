//! What the lists of splats are made and read with: mirrored in `lists.wgsl`.

shared_struct! {
    /// The lists of (screen tile, slice) and their entries.
    pub struct ListParams {
        /// How a particle is drawn: as a dot, a ball or a cloud.
        pub kernel: u32,
        /// Bits that places in lists are coarser than subpixels, so that the largest particle fits 16 bits.
        pub entry_shift: u32,
        pub entry_capacity: u32,
        /// Lists of more entries are summed up in parts.
        pub long_list: u32,
        /// Optical depth 1 in the integers that the eye sums up.
        pub depth_one: f32,
        /// How much of its light the rim of a dot keeps, and what is added to it.
        pub rim_kept: f32,
        pub rim_added: f32,
    }
}
