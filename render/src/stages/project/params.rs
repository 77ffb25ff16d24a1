//! What the projection reads besides the view: mirrored in `project.wgsl`.

use glam::{IVec2, Vec2, Vec3};

shared_struct! {
    /// Where particles lie on the screen, in their slice and in the light.
    pub struct ProjectParams {
        /// Across the slices of a globe view.
        pub half: Vec3,
        /// Where the first slice begins: m (tiles), earth radii along `half` (globe).
        pub slice_top: f32,
        /// Axes of the light of a globe view, and where along them its first texel begins.
        pub light_u: Vec3,
        pub light_u0: f32,
        pub light_v: Vec3,
        pub light_v0: f32,
        pub slices_per_unit: f32,
        /// Radius of a particle without strength is smaller by this share.
        pub size_spread: f32,
        /// Of a column.
        pub lon_span_rad: f32,
        pub height_px_per_m: f32,
        /// Way of a shadow across the ground of a tile, subpixels.
        pub light_shift_per_m: Vec2,
        /// From a place on a tile to one in its light, subpixels.
        pub light_origin: IVec2,
        pub min_radius_px: f32,
        pub max_radius_px: f32,
        pub light_depth_gain: f32,
        pub light_texels_per_unit: f32,
        pub per_earth_radius_m: f32,
        /// 1: particles of tiles are dimmed where it is night.
        pub day_on: u32,
        /// What lies farther than this beyond the sea surface, seen from the eye, lies beyond it, m.
        pub beyond_m: f32,
    }
}
