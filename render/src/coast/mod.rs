//! The coast lines of the earth: packed in the program, unpacked once, at the scale that suits a picture.
//!
//! Natural Earth (public domain), 1:110 million and 1:50 million. `tests/it/coast.rs` packs them and tells how. Globe
//! views draw the outlines that land is filled by (`ring`), so that line and land agree.

mod cover;
mod mask;
mod packed;
pub mod ring;
pub mod sea_floor;

use std::sync::LazyLock;

use contract::tile::{mercator_x, mercator_y};
use glam::DVec3;

pub use cover::Cover;
pub use mask::{Mask, Pen};
pub use packed::{Place, pack, unpack};

/// Both scales, the coarse one first.
const PACKED: &[u8] = include_bytes!("lines.bin");
/// Pixels a degree from which on the fine lines are drawn: the coarse ones are off by a pixel or two there.
const FINE_FROM_PX_PER_DEG: f64 = 4.0;
/// Latitude beyond which a map has no place, degrees.
const POLE_DEG: f64 = 89.9;

/// A corner of a coast line.
#[derive(Debug, Clone, Copy)]
pub struct Corner {
    /// On the map: shares of the world's width and height from its north-west.
    pub share: [f64; 2],
    /// On the globe, in the axes of eq. 4 (docs/method.md).
    pub normal: DVec3,
}

/// Coast lines of one scale.
type Lines = Vec<Vec<Corner>>;

static SCALES: LazyLock<[Lines; 2]> = LazyLock::new(|| {
    let scales = unpack(PACKED).expect("the lines in the program are whole");
    scales.map(|lines| {
        let corners = |line: Vec<Place>| -> Vec<Corner> { line.into_iter().map(corner).collect() };
        lines.into_iter().map(corners).collect()
    })
});

fn corner(place: Place) -> Corner {
    let [lon_deg, lat_deg] = place.degrees();
    Corner {
        share: [
            mercator_x(lon_deg),
            mercator_y(lat_deg.clamp(-POLE_DEG, POLE_DEG)),
        ],
        normal: ring::normal([lon_deg, lat_deg]),
    }
}

/// The lines that suit a picture with so many pixels a degree.
pub fn lines(px_per_deg: f64) -> &'static [Vec<Corner>] {
    &SCALES[usize::from(px_per_deg >= FINE_FROM_PX_PER_DEG)]
}

/// The lines as they are packed.
pub fn packed() -> &'static [u8] {
    PACKED
}
