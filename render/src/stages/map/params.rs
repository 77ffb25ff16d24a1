//! What thematic maps read: mirrored in `map.wgsl`.

shared_struct! {
    /// The look of a thematic map.
    pub struct MapParams {
        pub alpha: f32,
        /// Pixels of a cell, which the edge of the data is one of.
        pub edge_sharpness: f32,
    }
}
