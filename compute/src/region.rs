//! Regions on grids: the exact area of a region's share of every cell.
//!
//! A region's edges are straight in longitude and latitude, as GeoJSON says. Areas lie on the chosen figure of the
//! earth.

pub mod area;
mod box_cover;
pub mod geojson_file;
pub(crate) mod loaded;
mod polygon_cover;
mod rings;
pub mod weights;
