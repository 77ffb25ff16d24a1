//! What the light reads: mirrored in `texel.wgsl`.

use glam::{UVec2, Vec3};

shared_struct! {
    /// The light buffer, and how light is looked up in it. A place in the light is given across and down its texels and
    /// towards the sun: in earth radii on globes; on map tiles in parts of texels, and in slices away from the sun.
    pub struct LightParams {
        /// From a place towards the eye, for each pixel of radius: this, less `toward_pull` times the place.
        pub toward: Vec3,
        pub toward_pull: f32,
        /// Texels across and down a layer.
        pub size: UVec2,
        /// Parts of a texel that positions are counted in.
        pub unit: i32,
        /// Off, its own, given or alone.
        pub mode: u32,
        /// Globe views: the middle of the earth as a place.
        pub earth: Vec3,
        /// A part of a texel in places.
        pub part: f32,
        /// Layer of a place: this times how far it is towards the sun, and `first_layer`.
        pub deeper: f32,
        pub first_layer: f32,
        /// How far towards the sun a place is: this, and so much for each part of a texel down and for each slice.
        pub sunward: f32,
        pub sunward_per_part: f32,
        pub sunward_per_slice: f32,
        /// Layers from the sun on; the buffer has one more, for the whole.
        pub layers: u32,
        /// Power of the light at a place by which what is seen of it counts; on globes, where sun and eye stand equally high.
        pub look_power: f32,
        pub ambient: f32,
        pub direct: f32,
        /// Optical depth 1 in the integers that the light sums up.
        pub depth_one: f32,
        /// Share of all light that is left at night: 1 where the sun has its place in the picture.
        pub night: f32,
    }
}
