//! Names of meridians and parallels: where a line leaves the picture, else where it goes behind the globe, else inside.

use contract::grid::LonLatDeg;
use legend::LegendError;
use render::plan::Projection;

use super::super::page::{Area, Page};
use super::super::text::{Anchor, Ink, Text, width};
use super::{Kind, Line, Lines, clip};

const SIZE_EM: f64 = 0.74;
/// From a line's end to its name.
const GAP_EM: f64 = 0.7;
/// How near to the edge of the picture a line has left it, pixels.
const NEAR_PX: f64 = 0.01;
/// Ground that faces the camera less than this is at the horizon.
const HORIZON_FACING: f64 = 0.2;
/// Meridians have no name at the horizon beyond this latitude, where they run together, degrees.
const MOST_LAT_DEG: f64 = 75.0;

/// Where a line ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Left,
    Right,
    Top,
    Bottom,
    Horizon,
}

/// Where names are looked for, the best first.
fn order(kind: Kind) -> [End; 5] {
    match kind {
        Kind::Parallel => [End::Left, End::Right, End::Horizon, End::Top, End::Bottom],
        Kind::Meridian => [End::Bottom, End::Top, End::Horizon, End::Left, End::Right],
    }
}

impl Lines {
    /// Names lines at their ends; tells which kinds have none then.
    pub(in super::super) fn label_ends(
        &self,
        page: &mut Page,
        projection: &Projection,
    ) -> Result<Vec<Kind>, LegendError> {
        let mut unnamed = vec![Kind::Parallel, Kind::Meridian];
        for line in &self.0 {
            let name = line.name();
            let size = SIZE_EM * page.em();
            let across = width(&name, size, Ink::Ground)?;
            let ends = line.ends(page.free_size(), projection);
            let places = order(line.kind).into_iter().flat_map(|end| {
                let here = ends.iter().filter(move |(found, _)| *found == end);
                here.map(|(end, px)| (*end, *px))
            });
            for (end, px) in places {
                let middle = beside(end, px, [across, size], GAP_EM * page.em(), projection);
                if write(page, &name, middle, across) {
                    unnamed.retain(|kind| *kind != line.kind);
                    break;
                }
            }
        }
        Ok(unnamed)
    }

    /// Names the lines of some kinds where they cross the middle of the picture: the whole disc is seen, and meridians run
    /// together at its edge.
    pub(in super::super) fn label_inside(
        &self,
        page: &mut Page,
        projection: &Projection,
        kinds: &[Kind],
    ) -> Result<(), LegendError> {
        let middle = page.size().map(|side| side / 2.0);
        let Some(middle) = projection.ground_at(middle) else {
            return Ok(());
        };
        let nearest = |kind: Kind, to: f64| {
            let others = self.0.iter().filter(|line| line.kind == kind);
            let distance =
                |line: &&Line| ((line.degrees - to + 180.0).rem_euclid(360.0) - 180.0).abs();
            others
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .map_or(to, |line| line.degrees)
        };
        let (lon, lat) = (
            nearest(Kind::Meridian, middle.lon),
            nearest(Kind::Parallel, middle.lat),
        );
        for line in self.0.iter().filter(|line| kinds.contains(&line.kind)) {
            let place = match line.kind {
                Kind::Meridian => LonLatDeg {
                    lon: line.degrees,
                    lat,
                },
                Kind::Parallel => LonLatDeg {
                    lon,
                    lat: line.degrees,
                },
            };
            let seen = projection.seen(place, 0.0).filter(|seen| seen.is_visible);
            let Some(seen) = seen.filter(|_| projection.facing(place) > HORIZON_FACING) else {
                continue;
            };
            let name = line.name();
            let size = SIZE_EM * page.em();
            let across = width(&name, size, Ink::Ground)?;
            let gap = 0.3 * page.em();
            let middle = [seen.x_px + gap + 0.5 * across, seen.y_px - gap - 0.5 * size];
            write(page, &name, middle, across);
        }
        Ok(())
    }
}

impl Line {
    /// `30°N`, `0.5°W`.
    fn name(&self) -> String {
        let degrees = match self.kind {
            Kind::Parallel => self.degrees,
            Kind::Meridian => (self.degrees + 180.0).rem_euclid(360.0) - 180.0,
        };
        // Without the noise of multiples.
        let size = (degrees.abs() * 1e6).round() / 1e6;
        let side = match self.kind {
            _ if size == 0.0 || (size - 180.0).abs() < 1e-9 => "",
            Kind::Parallel if degrees < 0.0 => "S",
            Kind::Parallel => "N",
            Kind::Meridian if degrees < 0.0 => "W",
            Kind::Meridian => "E",
        };
        format!("{size}°{side}")
    }

    /// Its ends in a picture of a size, from the left upper corner, and where those are.
    fn ends(&self, size: [f64; 2], projection: &Projection) -> Vec<(End, [f64; 2])> {
        let [right, bottom] = size;
        let parts = self.parts.iter();
        let parts = parts.flat_map(|part| clip::to_picture(part, size));
        let ends = parts.flat_map(|part| [part[0], part[part.len() - 1]]);
        let named = ends.filter_map(|px| {
            let [x, y] = px;
            let end = if x <= NEAR_PX {
                End::Left
            } else if x >= right - NEAR_PX {
                End::Right
            } else if y <= NEAR_PX {
                End::Top
            } else if y >= bottom - NEAR_PX {
                End::Bottom
            } else {
                self.is_at_horizon(px, projection).then_some(End::Horizon)?
            };
            Some((end, px))
        });
        named.collect()
    }

    /// Does it end at the horizon, rather than short of a pole?
    fn is_at_horizon(&self, px: [f64; 2], projection: &Projection) -> bool {
        // A little inside, where there is ground.
        let Some([away_x, away_y]) = outward(px, projection) else {
            return false;
        };
        let Some(place) = projection.ground_at([px[0] - 2.0 * away_x, px[1] - 2.0 * away_y]) else {
            return true;
        };
        let runs_together = self.kind == Kind::Meridian && place.lat.abs() > MOST_LAT_DEG;
        projection.facing(place) < HORIZON_FACING && !runs_together
    }
}

/// From the ground to where there is none: away from the middle of the globe, from below the sea towards the core.
fn outward([x, y]: [f64; 2], projection: &Projection) -> Option<[f64; 2]> {
    let [middle_x, middle_y] = projection.middle_of_globe()?;
    let away = (x - middle_x).hypot(y - middle_y);
    let length = if projection.is_below() { -away } else { away };
    (away > 0.0).then(|| [(x - middle_x) / length, (y - middle_y) / length])
}

/// The middle of a name of a width and height beside the end of a line: inside the picture, outside the globe.
fn beside(
    end: End,
    [x, y]: [f64; 2],
    [width, height]: [f64; 2],
    gap: f64,
    projection: &Projection,
) -> [f64; 2] {
    let away = match end {
        End::Left => [1.0, 0.0],
        End::Right => [-1.0, 0.0],
        End::Top => [0.0, 1.0],
        End::Bottom => [0.0, -1.0],
        End::Horizon => outward([x, y], projection).unwrap_or([0.0, -1.0]),
    };
    // So that the nearest point of the name is as far away as the gap, whichever way it lies.
    let reach = gap + 0.5 * (away[0].abs() * width + away[1].abs() * height);
    [x + away[0] * reach, y + away[1] * reach]
}

/// Writes a name round a place if there is room.
fn write(page: &mut Page, name: &str, [x, y]: [f64; 2], across: f64) -> bool {
    let size = SIZE_EM * page.em();
    let area = Area {
        left: x - 0.5 * across,
        top: y - 0.5 * size,
        right: x + 0.5 * across,
        bottom: y + 0.5 * size,
    };
    let is_free = page.take(area.grown(0.15 * page.em()));
    if is_free {
        page.label(&Text {
            words: name,
            x,
            y: y + 0.36 * size,
            size,
            anchor: Anchor::Middle,
            ink: Ink::Ground,
        });
    }
    is_free
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(kind: Kind, degrees: f64) -> String {
        let parts = vec![];
        Line {
            kind,
            degrees,
            parts,
        }
        .name()
    }

    #[test]
    fn lines_are_called_as_on_maps() {
        assert_eq!(name(Kind::Parallel, 30.0), "30°N");
        assert_eq!(name(Kind::Parallel, -7.5), "7.5°S");
        assert_eq!(name(Kind::Parallel, 0.0), "0°");
        assert_eq!(name(Kind::Meridian, 3.0 * 0.1), "0.3°E");
        assert_eq!(name(Kind::Meridian, 190.0), "170°W");
        assert_eq!(name(Kind::Meridian, -190.0), "170°E");
        assert_eq!(name(Kind::Meridian, 180.0), "180°");
        assert_eq!(name(Kind::Meridian, -360.0), "0°");
    }
}
