//! Views of the globe and of the map in one line each.

use contract::camera::CameraAngles;
use contract::grid::LonLatDeg;
use contract::job::View;
use contract::look_at::LookAt;
use contract::tile::Tile;

/// A square picture of a globe from above a place, degrees; height in metres.
pub fn globe(lon_deg: f64, lat_deg: f64, height_m: f64, size_px: u32) -> View {
    View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        width_px: size_px,
        height_px: size_px,
        angles: CameraAngles::NADIR,
    }
}

/// A square picture of a place, degrees, from so many metres away, with a heading and a tilt there.
///
/// # Panics
/// A distance below a kilometre, a tilt beyond 0 to 90.
#[expect(
    clippy::expect_used,
    reason = "views of tests and benches are written down"
)]
pub fn looking_at(
    target: [f64; 2],
    distance_m: f64,
    [heading_deg, tilt_deg]: [f64; 2],
    size_px: u32,
) -> View {
    let [lon, lat] = target;
    let look_at = LookAt {
        target: LonLatDeg { lon, lat },
        distance_m,
        angles: CameraAngles {
            heading_deg,
            tilt_deg,
            ..CameraAngles::NADIR
        },
    };
    look_at.view([size_px; 2]).expect("a valid camera")
}

/// A map tile, of which there is one.
pub fn tile(z: u8, x: u32, y: u32, size_px: u32) -> View {
    View::Tile {
        tile: Tile { z, x, y },
        size_px,
    }
}
