//! What the light reads: mirrored in `texel.wgsl`.

use glam::{UVec2, Vec3};

shared_struct! {
    /// The light buffer, and how light is looked up in it.
    pub struct LightParams {
        /// From a place in the light towards the eye, for each pixel of radius: this, less `toward_pull` times the place
        /// (in parts of texels and in slices).
        pub toward: Vec3,
        pub toward_pull: f32,
        /// Texels across and down a layer.
        pub size: UVec2,
        /// Parts of a texel that places are given in.
        pub unit: i32,
        /// Off, its own, given or alone.
        pub mode: u32,
        /// Power of the light at a place by which what is seen of it counts.
        pub look_power: f32,
        pub ambient: f32,
        pub direct: f32,
        /// Optical depth 1 in the integers that the light sums up.
        pub depth_one: f32,
        /// Share of all light that is left at night: 1 where the sun has its place in the picture.
        pub night: f32,
    }
}
