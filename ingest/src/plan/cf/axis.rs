//! One-dimensional latitudes and longitudes to the one grid of all products: row 0 north, columns eastwards from -180.

use contract::event::RejectReason;
use contract::grid::{Grid, wrap_lon_deg};
use serde::{Deserialize, Serialize};

use super::coordinate::Role;
use super::single;
use super::snapped::{SNAP_CELLS, Slack, closed_step, snapped_edge, snapped_step};
use crate::error::Rejection;

/// How far a label may stand from its place on a regular axis, in cells. Labels in float32 stay well below; those of a Gaussian
/// grid stay below too (0.5 % of a cell with 8 latitudes, 1.4 % with 512), and that is told.
const TOLERANCE_CELLS: f64 = 0.02;

/// What the labels of a grid's axes name.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Registration {
    /// The middle of a cell.
    #[default]
    Center,
    /// The same; rows centred on the poles, half of which lies beyond, are left out.
    CenterWithoutPoles,
    /// Corners of a cell.
    NorthWest,
    NorthEast,
    SouthWest,
    SouthEast,
}

/// Where every cell of a stored grid is in the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Mapping {
    pub(crate) grid: Grid,
    /// Index along the file's latitude axis, for each row of the grid.
    pub(crate) file_rows: Vec<u32>,
    /// Index along the file's longitude axis, for each column of the grid.
    pub(crate) file_cols: Vec<u32>,
}

/// Labels of an axis, degrees.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Labels<'a> {
    pub(crate) deg: &'a [f64],
    /// The width of the cell of one label alone, where bounds say it.
    pub(crate) only_deg: Option<f64>,
}

/// A regular axis: first label, step (signed), count, and how far the farthest label is from its place, degrees.
#[derive(Debug, Clone, Copy)]
struct Regular {
    first: f64,
    step: f64,
    count: u32,
    uneven_deg: f64,
}

/// The labels of an axis, as the file has them and without jumps by a turn, the regular axis that they make, and how exact they are.
#[derive(Debug, Clone, Copy)]
struct Fitted<'a> {
    deg: &'a [f64],
    places: &'a [f64],
    axis: Regular,
    slack: Slack,
}

impl Mapping {
    /// The grid of two axes, latitude and longitude. `names` are those of the variables, for refusals.
    pub(crate) fn from_labels(
        [lat, lon]: [Labels<'_>; 2],
        registration: Registration,
        names: [&str; 2],
    ) -> Result<Self, Rejection> {
        let lon_places = unwrapped(lon.deg);
        let lat = Fitted::of(lat, lat.deg, names[0])?;
        let lon = Fitted::of(lon, &lon_places, names[1])?;
        let taken = Self::of_fitted([lat, lon], registration, names);
        // What leads past a pole by a hair where labels are taken at their word was meant to end there.
        taken.or_else(|_refused| {
            let open = Fitted {
                slack: Slack::UNKNOWN,
                ..lat
            };
            Self::of_fitted([open, lon], registration, names)
        })
    }

    fn of_fitted(
        [lat_labels, lon_labels]: [Fitted<'_>; 2],
        registration: Registration,
        names: [&str; 2],
    ) -> Result<Self, Rejection> {
        let cells = [
            lat_labels.snapped(snapped_step),
            lon_labels.snapped(closed_step),
        ];
        let [lat_slack, lon_slack] = [(lat_labels, cells[0]), (lon_labels, cells[1])]
            .map(|(labels, cell_deg)| labels.edge_slack_deg(cell_deg));
        let (lat, dlat) = meant(lat_labels, cells[0]);
        let (lon, dlon) = meant(lon_labels, cells[1]);
        let is_beyond = |v: &f64| v.abs() > 90.0 + lat.step.abs();
        if lat_labels.deg.iter().any(is_beyond) {
            return Err(refused(
                names[0],
                "goes past the poles; latitudes are in degrees, -90 to 90",
            ));
        }
        let (north_shift, west_shift) = registration.shifts();
        let northernmost = if lat.step > 0.0 {
            lat.last()
        } else {
            lat.first
        };
        let westernmost = if lon.step > 0.0 {
            lon.first
        } else {
            lon.last()
        };
        let mut north = snapped_edge(northernmost + north_shift * dlat, dlat, lat_slack);
        let west = westernmost - west_shift * dlon;
        let mut file_rows: Vec<u32> = if lat.step > 0.0 {
            (0..lat.count).rev().collect()
        } else {
            (0..lat.count).collect()
        };
        if registration == Registration::CenterWithoutPoles {
            let south = north - f64::from(lat.count) * dlat;
            if south < -90.0 - SNAP_CELLS * dlat {
                file_rows.pop();
            }
            if north > 90.0 + SNAP_CELLS * dlat {
                file_rows.remove(0);
                north -= dlat;
            }
        }
        let file_cols: Vec<u32> = if lon.step > 0.0 {
            (0..lon.count).collect()
        } else {
            (0..lon.count).rev().collect()
        };
        let step = [dlat, dlon];
        Self::turned(
            north,
            (west, lon_slack),
            step,
            [file_rows, file_cols],
            names,
        )
    }

    /// How far the farthest label of an axis is from the place that the grid has for it, degrees, and the same in cells; none if
    /// rounding explains it.
    ///
    /// `labels`: latitudes or longitudes in the order of the file, of which the grid was made.
    pub(crate) fn moved(
        &self,
        role: Role,
        labels: &[f64],
        registration: Registration,
    ) -> Option<(f64, f64)> {
        let (north_shift, west_shift) = registration.shifts();
        let grid = self.grid;
        let (indexes, cell) = match role {
            Role::Latitude => (&self.file_rows, grid.dlat_deg),
            _ => (&self.file_cols, grid.dlon_deg),
        };
        let off = |(index, file): (usize, &u32)| {
            let (index, label) = (index as f64, labels[*file as usize]);
            match role {
                Role::Latitude => label - (grid.north_deg - (index + north_shift) * cell),
                _ => wrap_lon_deg(label - (grid.west_deg + (index + west_shift) * cell)),
            }
        };
        let off_deg = farthest(indexes.iter().enumerate().map(off));
        let rounding_deg = 2.0 * f64::from(f32::EPSILON) * farthest(labels.iter().copied());
        (off_deg > SNAP_CELLS * cell + rounding_deg).then_some((off_deg, off_deg / cell))
    }

    /// How far from the poles the cells of a grid end that another row would not fit beside, degrees: those of a Gaussian grid end 0.27 of a
    /// cell before them, where the cells of its file reach the poles. None of a part of the globe.
    pub(crate) fn short_of_poles_deg(&self) -> Option<f64> {
        let grid = self.grid;
        let left = [90.0 - grid.north_deg, grid.south_deg() + 90.0].map(|deg| deg / grid.dlat_deg);
        let is_short = left.iter().all(|cells| (SNAP_CELLS..0.5).contains(cells));
        is_short.then(|| left[0].max(left[1]) * grid.dlat_deg)
    }

    /// A grid that a profile states, for files that have no axes.
    pub(crate) fn from_grid(grid: Grid, north_first: bool) -> Result<Self, Rejection> {
        let file_rows = if north_first {
            (0..grid.rows).collect()
        } else {
            (0..grid.rows).rev().collect()
        };
        let step = [grid.dlat_deg, grid.dlon_deg];
        Self::turned(
            grid.north_deg,
            (grid.west_deg, f64::INFINITY),
            step,
            [file_rows, (0..grid.cols).collect()],
            ["grid", "grid"],
        )
    }

    /// Turns global grids so that they start at -180, and others so that their western edge, which may be off by so much, is in [-180, 180).
    fn turned(
        north_deg: f64,
        (west_deg, slack_deg): (f64, f64),
        [dlat, dlon]: [f64; 2],
        [file_rows, mut file_cols]: [Vec<u32>; 2],
        names: [&str; 2],
    ) -> Result<Self, Rejection> {
        let around = f64::from(file_cols.len() as u32) * dlon;
        // Some files repeat the first column at the end.
        if (around - 360.0 - dlon).abs() < TOLERANCE_CELLS * dlon {
            file_cols.pop();
        }
        let cols = file_cols.len() as u32;
        let west_deg = snapped_edge(west_deg, dlon, slack_deg);
        let mut west_deg = snapped_edge(wrap_lon_deg(west_deg), dlon, slack_deg);
        if west_deg >= 180.0 {
            west_deg -= 360.0;
        }
        if (f64::from(cols) * dlon - 360.0).abs() < TOLERANCE_CELLS * dlon {
            // The first column whose western edge is at or east of -180.
            let skipped = ((180.0 - west_deg) / dlon - SNAP_CELLS).ceil().max(0.0) as u32 % cols;
            file_cols.rotate_left(skipped as usize);
            west_deg = wrap_lon_deg(west_deg + f64::from(skipped) * dlon);
            west_deg = snapped_edge(west_deg, dlon, slack_deg);
            // A hair before the date line, which all but a hair of the first column lies behind.
            if 180.0 - west_deg < SNAP_CELLS * dlon {
                west_deg = -180.0;
            }
        }
        let grid = Grid {
            rows: file_rows.len() as u32,
            cols,
            north_deg,
            west_deg,
            dlat_deg: dlat,
            dlon_deg: dlon,
        };
        if north_deg > 90.0 + SNAP_CELLS * dlat || grid.south_deg() < -90.0 - SNAP_CELLS * dlat {
            let detail = "has cells that reach past a pole; if its labels are corners, say so with registration in a profile, \
                          and if rows are centred on the poles, leave them out with registration = \"center_without_poles\"";
            return Err(refused(names[0], detail));
        }
        if f64::from(cols) * dlon > 360.0 + TOLERANCE_CELLS * dlon {
            let detail = format!(
                "goes more than once round the earth ({cols} columns of {dlon:.6} degrees), so that places are there twice; give each once"
            );
            return Err(refused(names[1], &detail));
        }
        grid.validate()
            .map_err(|e| refused(names[1], &format!("makes no grid ({e})")))?;
        Ok(Self {
            grid,
            file_rows,
            file_cols,
        })
    }
}

impl Registration {
    /// From label to northern edge, and from western edge to label, in cells.
    fn shifts(self) -> (f64, f64) {
        match self {
            Self::Center | Self::CenterWithoutPoles => (0.5, 0.5),
            Self::NorthWest => (0.0, 0.0),
            Self::NorthEast => (0.0, 1.0),
            Self::SouthWest => (1.0, 0.0),
            Self::SouthEast => (1.0, 1.0),
        }
    }
}

impl Regular {
    fn last(self) -> f64 {
        self.first + self.step * f64::from(self.count - 1)
    }
}

impl<'a> Fitted<'a> {
    /// `places`: the labels without jumps.
    fn of(labels: Labels<'a>, places: &'a [f64], name: &str) -> Result<Self, Rejection> {
        let axis = regular(places, labels.only_deg, name)?;
        Ok(Self {
            deg: labels.deg,
            places,
            axis,
            slack: Slack::of(labels.deg, axis.step.abs(), axis.uneven_deg),
        })
    }

    /// The width of a cell, degrees, by its step.
    fn snapped(&self, snap: impl Fn(f64, u32, Slack) -> f64) -> f64 {
        snap(self.axis.step.abs(), self.axis.count, self.slack)
    }

    /// How far an edge may be off, degrees, with cells so wide.
    fn edge_slack_deg(&self, cell_deg: f64) -> f64 {
        let drift_deg = (cell_deg - self.axis.step.abs()).abs() * f64::from(self.axis.count);
        self.slack.edge_deg + drift_deg
    }
}

/// The largest distance from 0.
fn farthest(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |most, number| most.max(number.abs()))
}

fn refused(name: &str, detail: &str) -> Rejection {
    Rejection::new(RejectReason::Grid, name, detail)
}

/// Longitudes without jumps: each within half a turn of the one before.
fn unwrapped(lon_deg: &[f64]) -> Vec<f64> {
    let mut last = None;
    let step = |value: &f64| {
        let value = match last {
            Some(before) if f64::is_finite(before) => before + wrap_lon_deg(value - before),
            _ => *value,
        };
        last = Some(value);
        value
    };
    lon_deg.iter().map(step).collect()
}

/// `only_deg`: the width of the cell of one label alone, where it is known.
fn regular(labels: &[f64], only_deg: Option<f64>, name: &str) -> Result<Regular, Rejection> {
    let count = u32::try_from(labels.len()).ok().filter(|n| *n >= 1);
    let Some(count) = count else {
        let detail = "has no labels, or too many; state the grid in a profile";
        return Err(refused(name, detail));
    };
    if let Some(bad) = labels.iter().find(|v| !v.is_finite() || v.abs() > 1e4) {
        return Err(refused(
            name,
            &format!(
                "holds {bad}, which is no coordinate; the file is damaged, or state the grid in a profile"
            ),
        ));
    }
    let first = labels[0];
    if count == 1 {
        let detail = "has one label and no bounds, so that nothing says how wide its cell is: give it two edges (bounds), or state the grid in a profile";
        let step = only_deg.ok_or_else(|| refused(name, detail))?;
        return Ok(Regular {
            first,
            step,
            count,
            uneven_deg: 0.0,
        });
    }
    let step = (labels[labels.len() - 1] - first) / f64::from(count - 1);
    let worst = labels
        .iter()
        .enumerate()
        .map(|(i, v)| (v - (first + step * i as f64)).abs())
        .fold(0.0, f64::max);
    if step == 0.0 || worst > TOLERANCE_CELLS * step.abs() {
        let detail = format!(
            "is not evenly spaced (off by up to {worst:.3} degrees at a step of {:.3}); regrid it to regular latitudes and longitudes",
            step.abs()
        );
        return Err(refused(name, &detail));
    }
    Ok(Regular {
        first,
        step,
        count,
        uneven_deg: worst,
    })
}

/// An axis and the width of its cells, degrees: as they are fitted and taken to be, or, of labels of single precision, as they were
/// before these were rounded.
fn meant(labels: Fitted<'_>, cell_deg: f64) -> (Regular, f64) {
    let fitted = labels.axis;
    // The width of one cell is what its edges say.
    if fitted.count == 1 {
        return (fitted, fitted.step);
    }
    let is_round = (cell_deg - fitted.step.abs()).abs() > 0.0;
    let round_deg = is_round.then(|| cell_deg.copysign(fitted.step));
    match single::meant(labels.deg, labels.places, fitted.step, round_deg) {
        Some([first, step]) => {
            let meant = Regular {
                first,
                step,
                ..fitted
            };
            (meant, step.abs())
        }
        None => (fitted, cell_deg),
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these numbers are exact")]
mod tests {
    use super::*;

    fn labels(first: f64, step: f64, count: u32) -> Vec<f64> {
        (0..count).map(|i| first + step * f64::from(i)).collect()
    }

    fn map(lat: &[f64], lon: &[f64], registration: Registration) -> Result<Mapping, Rejection> {
        let labels = [lat, lon].map(|deg| Labels {
            deg,
            only_deg: None,
        });
        Mapping::from_labels(labels, registration, ["lat", "lon"])
    }

    const ONE_DEGREE: Grid = Grid {
        rows: 180,
        cols: 360,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    #[test]
    fn every_way_round_makes_the_same_global_grid() {
        let south_first = labels(-89.5, 1.0, 180);
        let north_first = labels(89.5, -1.0, 180);
        let m = map(
            &north_first,
            &labels(-179.5, 1.0, 360),
            Registration::Center,
        )
        .unwrap();
        assert_eq!((m.grid, m.file_rows[0], m.file_cols[0]), (ONE_DEGREE, 0, 0));
        let m = map(&south_first, &labels(0.5, 1.0, 360), Registration::Center).unwrap();
        assert_eq!(
            (m.grid, m.file_rows[0], m.file_cols[0], m.file_cols[180]),
            (ONE_DEGREE, 179, 180, 0)
        );
        let m = map(&south_first, &labels(20.5, 1.0, 360), Registration::Center).unwrap();
        assert_eq!((m.grid, m.file_cols[0]), (ONE_DEGREE, 160)); // 20.5 + 160 = 180.5 = -179.5
        let m = map(
            &north_first,
            &labels(179.5, -1.0, 360),
            Registration::Center,
        )
        .unwrap();
        assert_eq!((m.grid, m.file_cols[0]), (ONE_DEGREE, 359));
        let split: Vec<f64> = labels(0.5, 1.0, 180)
            .into_iter()
            .chain(labels(-179.5, 1.0, 180))
            .collect();
        let m = map(&north_first, &split, Registration::Center).unwrap();
        assert_eq!((m.grid, m.file_cols[0]), (ONE_DEGREE, 180));
    }

    #[test]
    fn places_that_are_there_twice_are_refused_in_words() {
        let lat = labels(-85.0, 10.0, 18);
        // A column that is repeated at either end, and two at one.
        for first in [-185.0, 0.0] {
            let refused = map(&lat, &labels(first, 10.0, 38), Registration::Center);
            let detail = refused.unwrap_err().detail;
            assert!(detail.contains("38 columns"), "{detail}");
        }
    }

    #[test]
    fn corner_labels_move_the_grid_by_half_a_cell() {
        let (lat, lon) = (labels(90.0, -1.0, 180), labels(-180.0, 1.0, 360));
        assert_eq!(
            map(&lat, &lon, Registration::NorthWest).unwrap().grid,
            ONE_DEGREE
        );
        assert!(
            map(&lat, &lon, Registration::Center)
                .unwrap_err()
                .detail
                .contains("past a pole")
        );
        let (lat, lon) = (labels(-90.0, 1.0, 180), labels(-179.0, 1.0, 360));
        assert_eq!(
            map(&lat, &lon, Registration::SouthEast).unwrap().grid,
            ONE_DEGREE
        );
    }

    #[test]
    fn labels_of_many_digits_lie_where_they_say_and_those_of_few_where_they_are_meant() {
        let lon = labels(0.5, 1.0, 360);
        let near = |own: f64, wanted: f64| assert!((own - wanted).abs() < 1e-9, "{own} {wanted}");
        // Seven rows from pole to pole.
        let sevenths = labels(540.0 / 7.0, -180.0 / 7.0, 7);
        let m = map(&sevenths, &lon, Registration::Center).unwrap();
        near(m.grid.dlat_deg, 180.0 / 7.0);
        near(m.grid.north_deg, 90.0);
        assert_eq!(
            m.moved(Role::Latitude, &sevenths, Registration::Center),
            None
        );
        // Edges a thousandth of a cell beside a round place, from the south and from the north, and those of longitudes.
        let beside = labels(-10.1247, 0.25, 40);
        let m = map(&beside, &lon, Registration::Center).unwrap();
        near(m.grid.south_deg(), -10.2497);
        let m = map(&labels(9.8753, -0.25, 40), &beside, Registration::Center).unwrap();
        near(m.grid.north_deg, 10.0003);
        near(m.grid.west_deg, -10.2497);
        // Thirds of a degree with four digits.
        let thirds: Vec<f64> = labels(1.0 / 6.0, 1.0 / 3.0, 60);
        let thirds: Vec<f64> = thirds.iter().map(|v| (v * 1e4).round() / 1e4).collect();
        let m = map(&thirds, &thirds, Registration::Center).unwrap();
        assert_eq!((m.grid.dlat_deg, m.grid.dlon_deg), (1.0 / 3.0, 1.0 / 3.0));
        assert_eq!((m.grid.north_deg, m.grid.west_deg), (20.0, 0.0));
        // Past a pole by a hair more than a grid may reach.
        let m = map(&labels(89.5015, -1.0, 180), &lon, Registration::Center).unwrap();
        assert_eq!(m.grid, ONE_DEGREE);
    }

    #[test]
    fn columns_around_the_earth_begin_at_the_date_line_also_a_hair_before_it() {
        let lat = labels(89.5, -1.0, 180);
        for (first, west_deg, skipped) in [
            (-179.5005, -180.0, 0),
            (-179.4995, -179.9995, 0),
            (0.4995, -180.0, 180),
            (0.5005, -179.9995, 180),
        ] {
            let m = map(&lat, &labels(first, 1.0, 360), Registration::Center).unwrap();
            assert!((m.grid.west_deg - west_deg).abs() < 1e-9, "{:?}", m.grid);
            assert_eq!((m.grid.cols, m.file_cols[0]), (360, skipped));
        }
    }

    #[test]
    fn longitudes_that_drift_past_the_turn_make_one() {
        // 5 minutes of arc, summed up with an error of a millionth of a degree each.
        let lon = labels(0.0, 359.92 / 4319.0, 4320);
        let m = map(&labels(89.5, -1.0, 180), &lon, Registration::Center).unwrap();
        assert_eq!((m.grid.cols, m.grid.dlon_deg), (4320, 1.0 / 12.0));
        assert!(m.grid.is_periodic());
    }

    /// Latitudes of the Gaussian grid N4: arc sines of the roots of the Legendre polynomial of degree 8.
    const GAUSSIAN: [f64; 8] = [
        73.7992, 52.8129, 31.7041, 10.5699, -10.5699, -31.7041, -52.8129, -73.7992,
    ];

    #[test]
    fn labels_that_are_moved_to_regular_places_are_told_of() {
        let lon = labels(0.0, 22.5, 16);
        let m = map(&GAUSSIAN, &lon, Registration::Center).unwrap();
        let moved = |m: &Mapping, role, labels: &[f64]| m.moved(role, labels, Registration::Center);
        let (off_deg, cells) = moved(&m, Role::Latitude, &GAUSSIAN).unwrap();
        // Their step is taken for 21 5/60 degrees.
        assert!((0.10..0.11).contains(&off_deg), "{off_deg}");
        assert!((cells - 0.005).abs() < 1e-4, "{cells}");
        assert_eq!(moved(&m, Role::Longitude, &lon), None);
        // It ends at 84.34 degrees by its labels and step, never beyond a pole.
        let short_deg = m.short_of_poles_deg().unwrap();
        assert!((short_deg - 5.66).abs() < 0.02, "{short_deg}");
        assert!(m.grid.north_deg < 90.0 && m.grid.south_deg() > -90.0);
        // Longitudes that drift are moved by their drift.
        let lon = labels(0.0, 359.92 / 4319.0, 4320);
        let lat = labels(89.5, -1.0, 180);
        let m = map(&lat, &lon, Registration::Center).unwrap();
        let (_, cells) = moved(&m, Role::Longitude, &lon).unwrap();
        assert!((0.02..0.05).contains(&cells), "{cells}");
        assert_eq!(moved(&m, Role::Latitude, &lat), None);
        assert_eq!(m.short_of_poles_deg(), None);
    }

    #[test]
    fn labels_that_are_at_their_places_are_not_told_of() {
        let float32 = |v: Vec<f64>| {
            v.into_iter()
                .map(|x| f64::from(x as f32))
                .collect::<Vec<_>>()
        };
        for (lat, lon, registration) in [
            (
                float32(labels(-90.0 + 0.5 / 60.0, 1.0 / 60.0, 10_800)),
                float32(labels(0.5 / 60.0, 1.0 / 60.0, 21_600)),
                Registration::Center,
            ),
            (
                labels(90.0, -1.0, 180),
                labels(-179.0, 1.0, 360),
                Registration::NorthEast,
            ),
            (
                labels(-90.0, 0.5, 361),
                labels(20.0, 0.5, 721),
                Registration::CenterWithoutPoles,
            ),
        ] {
            let m = map(&lat, &lon, registration).unwrap();
            for (role, labels) in [(Role::Latitude, &lat), (Role::Longitude, &lon)] {
                assert_eq!(m.moved(role, labels, registration), None, "{role:?}");
            }
        }
    }

    #[test]
    fn rows_centred_on_the_poles_are_refused_or_left_out() {
        let (lat, lon) = (labels(-90.0, 0.5, 361), labels(20.0, 0.5, 721));
        let refused = map(&lat, &lon, Registration::Center).unwrap_err();
        assert!(refused.detail.contains("center_without_poles"));
        let m = map(&lat, &lon, Registration::CenterWithoutPoles).unwrap();
        assert_eq!(
            (m.grid.rows, m.grid.north_deg, m.grid.south_deg()),
            (359, 89.75, -89.75)
        );
        assert_eq!((m.file_rows[0], m.file_rows[358]), (359, 1));
        assert_eq!((m.grid.cols, m.grid.west_deg), (720, -179.75));
        // A grid without such rows is what it is without the word.
        let (lat, lon) = (labels(-89.5, 1.0, 180), labels(0.5, 1.0, 360));
        assert_eq!(
            map(&lat, &lon, Registration::CenterWithoutPoles).unwrap(),
            map(&lat, &lon, Registration::Center).unwrap()
        );
    }

    #[test]
    fn labels_in_float32_give_round_edges() {
        let float32 = |v: Vec<f64>| {
            v.into_iter()
                .map(|x| f64::from(x as f32))
                .collect::<Vec<_>>()
        };
        let lat = float32(labels(0.5 / 60.0, 1.0 / 60.0, 2460));
        let lon = float32(labels(100.0 + 0.5 / 60.0, 1.0 / 60.0, 1800));
        let m = map(&lat, &lon, Registration::Center).unwrap();
        let expected = Grid {
            rows: 2460,
            cols: 1800,
            north_deg: 41.0,
            west_deg: 100.0,
            dlat_deg: 1.0 / 60.0,
            dlon_deg: 1.0 / 60.0,
        };
        assert_eq!(m.grid.dlat_deg, expected.dlat_deg);
        assert!(
            (m.grid.north_deg - 41.0).abs() < 1e-12 && (m.grid.west_deg - 100.0).abs() < 1e-12,
            "{:?}",
            m.grid
        );
    }

    #[test]
    fn labels_in_float32_whose_edges_are_no_halves_of_cells_give_edges_of_few_decimals() {
        let float32 = |v: Vec<f64>| {
            v.into_iter()
                .map(|x| f64::from(x as f32))
                .collect::<Vec<_>>()
        };
        let near = |grid: Grid, wanted: [f64; 4]| {
            let own = [grid.north_deg, grid.west_deg, grid.dlat_deg, grid.dlon_deg];
            let off = own.iter().zip(wanted).map(|(own, wanted)| own - wanted);
            assert!(farthest(off) < 1e-12, "{grid:?} {wanted:?}");
        };
        // From the south and from the north, and steps that are no part of a degree by themselves.
        let m = map(
            &float32(labels(20.1, 0.25, 40)),
            &float32(labels(120.1, 0.07, 100)),
            Registration::Center,
        );
        near(m.unwrap().grid, [29.975, 120.065, 0.25, 0.07]);
        let m = map(
            &float32(labels(60.3, -0.25, 40)),
            &float32(labels(200.1, 0.25, 40)),
            Registration::NorthWest,
        );
        near(m.unwrap().grid, [60.3, -159.9, 0.25, 0.25]);
        // Round the earth, from anywhere.
        let m = map(
            &float32(labels(-89.5, 1.0, 180)),
            &float32(labels(0.1, 0.25, 1440)),
            Registration::Center,
        );
        let grid = m.unwrap().grid;
        assert!(grid.is_periodic());
        near(grid, [90.0, -179.775, 1.0, 0.25]);
        // Labels that are off by more than that stay where they are.
        let mut lat = float32(labels(20.1, 0.25, 40));
        lat[7] += 0.001;
        let lon = float32(labels(120.1, 0.25, 100));
        let m = map(&lat, &lon, Registration::Center).unwrap();
        assert!((m.grid.south_deg() - (f64::from(20.1_f32) - 0.125)).abs() < 1e-12);
        assert!((m.grid.west_deg - 119.975).abs() < 1e-12);
    }

    #[test]
    fn a_region_across_the_date_line_stays_whole() {
        let m = map(
            &labels(9.5, -1.0, 20),
            &labels(170.5, 1.0, 20),
            Registration::Center,
        )
        .unwrap();
        assert_eq!(
            (m.grid.west_deg, m.grid.east_deg(), m.file_cols[0]),
            (170.0, 190.0, 0)
        );
        let m = map(
            &labels(9.5, -1.0, 20),
            &labels(190.5, 1.0, 20),
            Registration::Center,
        )
        .unwrap();
        assert_eq!(m.grid.west_deg, -170.0);
    }

    #[test]
    fn a_repeated_last_column_is_dropped_and_odd_global_grids_start_near_the_date_line() {
        let m = map(
            &labels(89.5, -1.0, 180),
            &labels(0.0, 1.0, 361),
            Registration::Center,
        )
        .unwrap();
        assert_eq!(
            (m.grid.cols, m.grid.west_deg, m.file_cols[0]),
            (360, -179.5, 181)
        );
    }

    #[test]
    fn one_label_is_a_row_or_a_column_where_the_width_of_its_cell_is_known() {
        let lon = labels(0.5, 1.0, 360);
        let only = |deg, only_deg| Labels { deg, only_deg };
        let mapped = |lat: Labels<'_>, lon: Labels<'_>| {
            Mapping::from_labels([lat, lon], Registration::Center, ["lat", "lon"])
        };
        let m = mapped(only(&[3.0], Some(4.0625)), only(&lon, None)).unwrap();
        let grid = Grid {
            rows: 1,
            north_deg: 5.03125,
            dlat_deg: 4.0625,
            ..ONE_DEGREE
        };
        assert_eq!((m.grid, &m.file_rows[..]), (grid, &[0][..]));
        // A mean over all longitudes.
        let lat = labels(-89.5, 1.0, 180);
        let m = mapped(only(&lat, None), only(&[0.0], Some(360.0))).unwrap();
        let grid = Grid {
            cols: 1,
            dlon_deg: 360.0,
            ..ONE_DEGREE
        };
        assert_eq!((m.grid, &m.file_cols[..]), (grid, &[0][..]));
        assert!(m.grid.is_periodic());
        // Edges that were written with nine decimals.
        let width_deg = 0.333_333_334;
        let place = [
            only(&[-15.6], Some(width_deg)),
            only(&[-30.0], Some(width_deg)),
        ];
        let grid = mapped(place[0], place[1]).unwrap().grid;
        let off =
            [grid.north_deg + 15.6, grid.west_deg + 30.0].map(|edge| edge.abs() - width_deg / 2.0);
        assert!(farthest(off.into_iter()) < 1e-12, "{grid:?}");
        let refused = mapped(only(&[2.0], None), only(&lon, None)).unwrap_err();
        assert!(
            refused.detail.contains("one label and no bounds"),
            "{refused:?}"
        );
    }

    #[test]
    fn what_is_no_regular_grid_is_refused() {
        let lon = labels(0.5, 1.0, 360);
        let mut gaussian = labels(89.5, -1.0, 180);
        gaussian[3] += 0.1;
        let mut broken = labels(89.5, -1.0, 180);
        broken[7] = f64::NAN;
        for lat in [
            gaussian,
            broken,
            vec![],
            vec![1.0],
            vec![5.0; 10],
            labels(1e36, 1.0, 10),
            labels(-200.0, 1.0, 50),
        ] {
            assert_eq!(
                map(&lat, &lon, Registration::Center).unwrap_err().reason,
                RejectReason::Grid
            );
        }
        assert!(
            map(
                &labels(89.5, -1.0, 180),
                &labels(0.5, 1.0, 700),
                Registration::Center
            )
            .is_err()
        );
    }
}
