//! Names of oceans and seas: where the globe faces the camera and there is room, the large ones first.

use contract::grid::LonLatDeg;
use legend::LegendError;
use render::plan::Projection;

use super::page::{Area, Page};
use super::seas::{SEAS, Sea};
use super::text::{Anchor, Ink, Text, width};

/// Least that the ground faces the camera under a name: the cosine of 72 degrees.
const LEAST_FACING: f64 = 0.31;
/// Longest a name may be for the width of its sea.
const MOST_OF_SEA: f64 = 1.15;
/// Sizes of letters by rank.
const SIZE_EM: [f64; 4] = [1.3, 1.1, 0.95, 0.85];
/// Free room around a name.
const ROOM_EM: f64 = 0.7;

/// A name at one of its places.
struct Written<'a> {
    text: Text<'a>,
    area: Area,
}

pub(super) fn draw(page: &mut Page, projection: &Projection) -> Result<(), LegendError> {
    for sea in SEAS {
        let (ink, name) = match sea.rank {
            0 => (Ink::Ocean, sea.name.to_uppercase()),
            _ => (Ink::Sea, sea.name.to_owned()),
        };
        let size = SIZE_EM[usize::from(sea.rank).min(SIZE_EM.len() - 1)] * page.em();
        let places = seen_places(sea, projection);
        if places.is_empty() {
            continue;
        }
        let length = width(&name, size, ink)?;
        for (place, px) in places {
            if length > MOST_OF_SEA * width_px(sea, place, projection) {
                continue;
            }
            let written = written(&name, px, size, length, ink);
            if page.take(written.area.grown(ROOM_EM * page.em())) {
                page.label(&written.text);
                break;
            }
        }
    }
    Ok(())
}

/// The places of a sea that face the camera, the one that does most first, and where they are seen.
fn seen_places(sea: &Sea, projection: &Projection) -> Vec<(LonLatDeg, [f64; 2])> {
    let places = sea.places.iter().map(|[lon, lat]| LonLatDeg {
        lon: *lon,
        lat: *lat,
    });
    let mut facing: Vec<_> = places
        .map(|place| (projection.facing(place), place))
        .filter(|(facing, _)| *facing >= LEAST_FACING)
        .collect();
    facing.sort_by(|a, b| b.0.total_cmp(&a.0));
    let seen = facing.into_iter().filter_map(|(_, place)| {
        let seen = projection.seen(place, 0.0).filter(|seen| seen.is_visible)?;
        Some((place, [seen.x_px, seen.y_px]))
    });
    seen.collect()
}

/// How wide a sea is in the picture.
fn width_px(sea: &Sea, place: LonLatDeg, projection: &Projection) -> f64 {
    let across = projection
        .px_per_m(place)
        .map_or(0.0, |[across, _away]| across);
    sea.width_km * 1000.0 * across
}

fn written(name: &str, [x, y]: [f64; 2], size: f64, length: f64, ink: Ink) -> Written<'_> {
    Written {
        text: Text {
            text: name,
            x,
            y: y + 0.35 * size,
            size,
            anchor: Anchor::Middle,
            ink,
        },
        area: Area {
            left: x - 0.5 * length,
            top: y - 0.5 * size,
            right: x + 0.5 * length,
            bottom: y + 0.5 * size,
        },
    }
}
