//! Views of the globe and of the map in one line each.

use contract::job::View;
use contract::tile::Tile;

/// A square picture of a globe from above a place, degrees; height in metres.
pub fn globe(lon_deg: f64, lat_deg: f64, height_m: f64, size_px: u32) -> View {
    View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        width_px: size_px,
        height_px: size_px,
        angles: contract::camera::CameraAngles::NADIR,
    }
}

/// A map tile, of which there is one.
pub fn tile(z: u8, x: u32, y: u32, size_px: u32) -> View {
    View::Tile {
        tile: Tile { z, x, y },
        size_px,
    }
}
