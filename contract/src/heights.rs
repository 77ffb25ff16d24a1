//! Where the heights of a picture end, and on which map tiles they are drawn lower than to scale.

use std::f64::consts::TAU;

use crate::earth::WGS84_EQUATORIAL_RADIUS_M;
use crate::job::{RenderJob, View};
use crate::tile::Tile;

/// Farthest a particle is lifted or sunk, m: bounds how far beyond a tile particles must be looked for.
pub const HEIGHT_LIMIT_M: f64 = 1.2e6;
/// Thickness of the sheet that particles fill where they are not lifted or sunk, m.
pub const SHEET_M: f64 = 20_000.0;
/// Farthest a particle of a map tile is lifted or sunk, pixels: in deep zoom levels all heights are scaled down alike,
/// so that particles stay near their cells and shadows fall on the next tile at most.
pub const MOST_LIFT_PX: f64 = 120.0;

/// Pixels of a metre at the equator of a tile's level: the same for a tile and its children of half the size.
pub fn px_per_m(tile: Tile, size_px: u32) -> f64 {
    let world_px = f64::from(size_px) * f64::from(1u32 << tile.z);
    world_px / (TAU * WGS84_EQUATORIAL_RADIUS_M)
}

/// Share of their scale that all heights of a zoom level keep where the highest or deepest particle would be `highest_m`
/// from the sea surface: 1 unless it would be moved more than [`MOST_LIFT_PX`].
pub fn kept_share(px_per_m: f64, highest_m: f64) -> f64 {
    (MOST_LIFT_PX / (highest_m * px_per_m)).min(1.0)
}

impl RenderJob {
    /// Accumulated carbon at which heights end, kg m⁻² of either sign: columns of more are drawn no higher or deeper. None
    /// where nothing is lifted.
    pub fn heights_end_kg_m2(&self) -> Option<f64> {
        let m_per_kg_m2 = self.style.height_m_per_kg_m2;
        let is_lifted = self.accumulated.is_some() && m_per_kg_m2 > 0.0;
        is_lifted.then(|| HEIGHT_LIMIT_M / m_per_kg_m2)
    }

    /// Pixels that heights of a map tile end at, all of the level scaled down alike if they would not; none where even
    /// heights at their limit are drawn to scale.
    pub fn heights_within_px(&self) -> Option<f64> {
        let View::Tile { tile, size_px } = self.view else {
            return None;
        };
        let kept = kept_share(px_per_m(tile, size_px), HEIGHT_LIMIT_M + 0.5 * SHEET_M);
        (self.heights_end_kg_m2().is_some() && kept < 1.0).then_some(MOST_LIFT_PX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_deep_levels_can_have_heights_that_are_not_to_scale() {
        let at =
            |z: u8, highest_m: f64| kept_share(px_per_m(Tile { z, x: 0, y: 0 }, 256), highest_m);
        // 1210 km are 61.8 pixels at zoom 3, and twice as many at zoom 4.
        assert!(at(3, 1.21e6) >= 1.0);
        assert!(
            (at(4, 1.21e6) - 120.0 / (2.0 * 61.836)).abs() < 1e-4,
            "{}",
            at(4, 1.21e6)
        );
        assert!(at(4, 1.0e6) >= 1.0 && at(16, 1e4) < 1.0);
        // A tile of double resolution is its four children.
        let [twice, child] =
            [(3, 512), (4, 256)].map(|(z, px)| px_per_m(Tile { z, x: 0, y: 0 }, px));
        assert!((twice - child).abs() < f64::EPSILON);
    }
}
