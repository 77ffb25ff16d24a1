//! Regions on grids: the exact area of a region's share of every cell, and of the sea in it.
//!
//! A region's edges are straight in longitude and latitude, as RFC 7946 says; every place in it counts once
//! (docs/decisions/008-regions.md). Areas lie on the chosen figure of the earth.

pub(crate) mod address;
mod area;
mod box_cover;
pub(crate) mod computed;
mod crossings;
mod cut;
pub mod extent;
pub mod file;
mod found;
mod lattice;
pub(crate) mod line_cover;
pub(crate) mod loaded;
pub mod mask;
pub(crate) mod place_cover;
mod polygon_cover;
mod ring;
mod rings;
mod sea;
pub mod shares;
mod union;
pub mod weights;
