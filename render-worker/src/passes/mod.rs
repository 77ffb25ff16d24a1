//! The two passes over particles, each made of the functions of several stages: storing what lies between them would
//! cost more than the stages do.
//!
//! Both keep sums for a workgroup's neighbours in a small table (`tally.wgsl`) and store splats in one order (`order.wgsl`).

pub mod place;
pub mod splat;
