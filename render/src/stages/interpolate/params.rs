//! What interpolation reads: mirrored in `interpolate.wgsl`.

shared_struct! {
    /// Cells that a thematic map shows, the first and the end.
    pub struct InterpolateParams {
        pub first_cell: u32,
        pub end_cell: u32,
    }
}
