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
/// Largest letters for the picture's shorter side: small pictures have letters that are large for them.
const MOST_OF_PICTURE: f64 = 0.03;
/// From one line to the next, sizes of letters.
const LINE: f64 = 1.25;
/// Free room around a name, by rank: small seas that lie close together are left out one by one.
const ROOM_EM: [f64; 4] = [0.7, 0.9, 1.6, 2.0];

/// A name as it is written, in one line or two.
struct Name {
    lines: Vec<String>,
    /// Of the longest line, pixels.
    length: f64,
    size: f64,
    ink: Ink,
}

pub(super) fn draw(page: &mut Page, projection: &Projection) -> Result<(), LegendError> {
    for sea in SEAS {
        let places = seen_places(sea, projection);
        if places.is_empty() {
            continue;
        }
        let names = Name::forms(sea, size(sea, page))?;
        let choices = names
            .iter()
            .flat_map(|name| places.iter().map(move |place| (name, place)));
        for (name, (place, px)) in choices {
            let has_room = name.length <= MOST_OF_SEA * width_px(sea, *place, projection);
            if has_room && name.is_on_globe(*px, projection) && name.write(page, *px, room(sea)) {
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
        let seen = projection.seen(place, 0.0);
        let seen = seen.filter(|seen| seen.is_visible)?;
        Some((place, [seen.x_px, seen.y_px]))
    });
    seen.collect()
}

/// The free room around the name of a sea, letters.
fn room(sea: &Sea) -> f64 {
    let [.., most] = ROOM_EM;
    *ROOM_EM.get(usize::from(sea.rank)).unwrap_or(&most)
}

/// How large the letters of a name are, pixels.
fn size(sea: &Sea, page: &Page) -> f64 {
    let [.., smallest] = SIZE_EM;
    let of_rank = SIZE_EM.get(usize::from(sea.rank)).unwrap_or(&smallest);
    let [width, height] = page.size();
    let most = (MOST_OF_PICTURE * width.min(height)).max(smallest * page.em());
    (of_rank * page.em()).min(most)
}

/// How wide a sea is in the picture.
fn width_px(sea: &Sea, place: LonLatDeg, projection: &Projection) -> f64 {
    let px_per_m = projection.px_per_m(place);
    sea.width_km * 1000.0 * px_per_m.map_or(0.0, |[across, _away]| across)
}

impl Name {
    /// In one line; in two where that is shorter.
    fn forms(sea: &Sea, size: f64) -> Result<Vec<Self>, LegendError> {
        let (ink, text) = match sea.rank {
            0 => (Ink::Ocean, sea.name.to_uppercase()),
            _ => (Ink::Sea, sea.name.to_owned()),
        };
        let form = |lines: Vec<String>| -> Result<Self, LegendError> {
            let mut length = 0.0f64;
            for line in &lines {
                length = length.max(width(line, size, ink)?);
            }
            Ok(Self {
                lines,
                length,
                size,
                ink,
            })
        };
        let mut forms = vec![form(vec![text.clone()])?];
        if let Some((first, last)) = text.rsplit_once(' ') {
            forms.push(form(vec![first.to_owned(), last.to_owned()])?);
        }
        Ok(forms)
    }

    /// Is there ground below both ends of it? A name that runs over the limb would be that of the sky.
    fn is_on_globe(&self, [x, y]: [f64; 2], projection: &Projection) -> bool {
        let half = 0.5 * self.length;
        [x - half, x + half]
            .into_iter()
            .all(|x| projection.ground_at([x, y]).is_some())
    }

    /// Writes it round a place if there is room.
    fn write(&self, page: &mut Page, [x, y]: [f64; 2], room_em: f64) -> bool {
        let line_px = LINE * self.size;
        let half = 0.5 * self.lines.len() as f64 * line_px;
        let area = Area {
            left: x - 0.5 * self.length,
            top: y - half,
            right: x + 0.5 * self.length,
            bottom: y + half,
        };
        let is_free = page.take(area.grown(room_em * page.em()));
        if is_free {
            for (i, line) in self.lines.iter().enumerate() {
                let middle = y - half + (i as f64 + 0.5) * line_px;
                page.label(&Text {
                    words: line,
                    x,
                    y: middle + 0.35 * self.size,
                    size: self.size,
                    anchor: Anchor::Middle,
                    ink: self.ink,
                });
            }
        }
        is_free
    }
}
