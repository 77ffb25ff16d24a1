//! Web Mercator tile addresses (z/x/y, y southwards) and their maths.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::ContractError;

/// Deepest zoom level: at level 16 a pixel of a 256 tile is 2.4 m, far below any product's cell.
pub const MAX_ZOOM: u8 = 16;
/// Latitude where the square Web Mercator world ends, degrees.
pub const MAX_LAT_DEG: f64 = 85.051_128_779_806_59;

/// A tile of the Web Mercator quadtree (EPSG:3857, `XYZ` numbering).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Tile {
    /// Zoom level, 0 to [`MAX_ZOOM`].
    pub z: u8,
    /// Column, eastwards from 180 W.
    pub x: u32,
    /// Row, southwards.
    pub y: u32,
}

impl Tile {
    /// A tile inside its level.
    ///
    /// # Errors
    /// Zoom too deep, or column or row outside the level.
    pub fn new(z: u8, x: u32, y: u32) -> Result<Self, ContractError> {
        let bad = |reason: String| {
            Err(ContractError::invalid(
                "tile",
                &format!("{z}/{x}/{y}"),
                reason,
            ))
        };
        if z > MAX_ZOOM {
            return bad(format!("zoom is 0 to {MAX_ZOOM}"));
        }
        let side = 1u32 << z;
        if x >= side || y >= side {
            return bad(format!("column and row at zoom {z} are 0 to {}", side - 1));
        }
        Ok(Self { z, x, y })
    }

    /// West, south, east, north, degrees.
    pub fn bounds_deg(self) -> [f64; 4] {
        let side = f64::from(1u32 << self.z);
        let lon = |x: u32| f64::from(x) / side * 360.0 - 180.0;
        let lat = |y: u32| mercator_lat_deg(f64::from(y) / side);
        [lon(self.x), lat(self.y + 1), lon(self.x + 1), lat(self.y)]
    }
}

/// Longitude as a share of the world's width: 0 at 180 W, 1 at 180 E.
pub fn mercator_x(lon_deg: f64) -> f64 {
    (lon_deg + 180.0) / 360.0
}

/// Latitude as a share of the world's height: 0 at [`MAX_LAT_DEG`], 1 at its opposite, not clamped.
pub fn mercator_y(lat_deg: f64) -> f64 {
    0.5 - (PI / 4.0 + lat_deg.to_radians() / 2.0).tan().ln() / (2.0 * PI)
}

/// Inverse of [`mercator_y`], degrees.
pub fn mercator_lat_deg(y: f64) -> f64 {
    (PI * (1.0 - 2.0 * y)).sinh().atan().to_degrees()
}

impl std::fmt::Display for Tile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}/{}", self.z, self.x, self.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_root_tile_is_the_square_world() {
        let [w, s, e, n] = Tile::new(0, 0, 0).unwrap().bounds_deg();
        assert_eq!((w, e), (-180.0, 180.0));
        assert!((n - MAX_LAT_DEG).abs() < 1e-9 && (s + MAX_LAT_DEG).abs() < 1e-9);
    }

    #[test]
    fn addresses_outside_their_level_are_refused() {
        assert!(Tile::new(0, 1, 0).is_err());
        assert!(Tile::new(3, 0, 8).is_err());
        assert!(Tile::new(MAX_ZOOM + 1, 0, 0).is_err());
        assert!(Tile::new(255, u32::MAX, u32::MAX).is_err());
    }

    proptest! {
        #[test]
        fn mercator_latitudes_round_trip(lat in -85.0f64..85.0) {
            prop_assert!((mercator_lat_deg(mercator_y(lat)) - lat).abs() < 1e-9);
        }
    }
}
