//! The stages of a frame, a folder each: `mod.rs` records the shader, `<stage>.wgsl` is the shader, `cpu.rs` its twin,
//! `params.rs` what it reads of the parameters of a picture.
//!
//! Stages that see one particle at a time are functions; [`passes`](crate::passes) run them.

/// What every shader of a stage begins with: structs, constants and small functions.
pub const PRELUDE: &str = include_str!("prelude.wgsl");

pub mod colour;
pub mod features;
pub mod layout;
pub mod params;
pub mod place;
pub mod sizes;
pub mod sphere;
pub mod uncertainty;
pub mod variants;
pub mod water;

pub mod bin;
pub mod compose;
pub mod eye;
pub mod fill;
pub mod flow;
pub mod interpolate;
pub mod isolines;
pub mod light;
pub mod map;
pub mod particles;
pub mod project;
