//! Means of a field over bands of latitude or longitude.

use std::ops::Range;

use contract::analysis::Along;
use contract::chunk::Window;
use contract::earth::Earth;
use contract::grid::Grid;

use super::band_shares::{BandShares, CellArea, Touched};

/// Rounding of band's edges, in bands.
const EDGE_SLACK: f64 = 1e-9;

/// The bands of a grid: which cells lie in which.
#[derive(Debug, Clone)]
pub struct Bands {
    /// What they lie along.
    along: Along,
    /// Rows whose middles lie inside.
    rows: Range<u32>,
    /// Whether the middle of each column lies inside.
    cols: Vec<bool>,
    /// Band of each row, or of each column.
    band_of: Vec<Option<usize>>,
    areas: Areas,
    /// Lower and upper edges, degrees.
    edges_deg: Vec<(f64, f64)>,
}

/// What counts of cells.
#[derive(Debug, Clone)]
enum Areas {
    /// All of them: area of a cell of each row, m².
    Whole(Vec<f64>),
    /// A region's share of each.
    Shares(BandShares),
}

/// Areas of a band, m².
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BandAreas {
    /// Of what counts of all its cells.
    pub all_m2: f64,
    /// Of those cells that are some of the grid's.
    pub some_m2: f64,
    /// Of what counts for coverage of all its cells.
    pub covered_m2: f64,
}

/// Sum of a band.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BandSum {
    /// Values by area.
    pub weighted: f64,
    /// Area of cells with data, m².
    pub area_m2: f64,
    /// What counts of it for coverage, m²: all of it of whole cells, the sea in it of a region's shares.
    pub covered_m2: f64,
    /// Squares of how far values are from their mean, by area; 0 where they are not asked for.
    pub squares: f64,
}

impl BandSum {
    /// Adds the sum of a step that lasts so long, s; areas are of time too then. Sums are added in the order of time, so that they
    /// have the same bits each time.
    ///
    /// Source: Chan, Golub and `LeVeque` (1983), doi:10.1080/00031305.1983.10483115.
    pub fn add(&mut self, step: &Self, seconds: f64) {
        let (own, more) = (self.area_m2, step.area_m2 * seconds);
        if own > 0.0 && more > 0.0 {
            let apart = self.weighted / own - step.weighted / step.area_m2;
            self.squares += apart * apart * (own * more / (own + more));
        }
        self.squares += step.squares * seconds;
        self.weighted += step.weighted * seconds;
        self.area_m2 += more;
        self.covered_m2 += step.covered_m2 * seconds;
    }

    /// Mean of the values; none without any.
    pub fn mean(&self) -> Option<f64> {
        (self.area_m2 > 0.0).then(|| self.weighted / self.area_m2)
    }

    /// Their standard deviation √(Σ w (x - m)² / Σ w), where squares were asked for; none without any.
    pub fn std(&self) -> Option<f64> {
        (self.area_m2 > 0.0).then(|| (self.squares / self.area_m2).sqrt())
    }
}

impl Bands {
    /// The bands of `band_deg` degrees, on multiples of it and no further than the poles, that cells with their middles between west, south,
    /// east and north lie in.
    pub fn of(
        grid: &Grid,
        along: Along,
        band_deg: f64,
        bounds_deg: [f64; 4],
        earth: Earth,
    ) -> Self {
        let [west, south, east, north] = bounds_deg;
        let is_inside = |row: &u32| (south..=north).contains(&middle_lat(grid, *row));
        let rows: Vec<u32> = (0..grid.rows).filter(is_inside).collect();
        let rows = rows.first().map_or(0, |row| *row)..rows.last().map_or(0, |row| row + 1);
        let cols: Vec<bool> = (0..grid.cols)
            .map(|col| middle_lon(grid, west, col) <= east)
            .collect();
        let areas = (0..grid.rows).map(|row| grid.cell_area_m2(row, earth));
        let areas = Areas::Whole(areas.collect());
        Self::of_cells(grid, along, band_deg, (west, rows, cols), areas)
    }

    /// The same of a region's share of every cell, by the middles of whole cells.
    pub(super) fn of_region(
        grid: &Grid,
        along: Along,
        band_deg: f64,
        (shares, touched): (BandShares, Touched),
    ) -> Self {
        let west = touched.bounds_deg[0];
        let cells = (west, touched.rows, touched.cols);
        Self::of_cells(grid, along, band_deg, cells, Areas::Shares(shares))
    }

    /// Those of some rows and columns, longitudes eastwards from `west`.
    fn of_cells(
        grid: &Grid,
        along: Along,
        band_deg: f64,
        (west, rows, cols): (f64, Range<u32>, Vec<bool>),
        areas: Areas,
    ) -> Self {
        let middles: Vec<Option<f64>> = match along {
            Along::Lat => (0..grid.rows)
                .map(|row| rows.contains(&row).then(|| middle_lat(grid, row)))
                .collect(),
            Along::Lon => (0..grid.cols)
                .map(|col| cols[col as usize].then(|| middle_lon(grid, west, col)))
                .collect(),
        };
        let number = |middle: f64| (middle / band_deg + EDGE_SLACK).floor();
        let numbers = || middles.iter().flatten().map(|middle| number(*middle));
        let (low, high) = numbers().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), n| {
            (a.min(n), b.max(n))
        });
        let count = if low <= high {
            (high - low) as usize + 1
        } else {
            0
        };
        let edge = |band: usize| {
            let edge = (low + band as f64) * band_deg;
            match along {
                // Where 90 is no multiple of a band, the outermost ones end at the poles.
                Along::Lat => edge.clamp(-90.0, 90.0),
                Along::Lon => edge,
            }
        };
        Self {
            along,
            rows,
            band_of: middles
                .iter()
                .map(|middle| middle.map(|middle| (number(middle) - low) as usize))
                .collect(),
            areas,
            edges_deg: (0..count)
                .map(|band| (edge(band), edge(band + 1)))
                .collect(),
            cols,
        }
    }

    /// Lower and upper edge of each band, degrees, from the south or the west.
    pub fn edges_deg(&self) -> &[(f64, f64)] {
        &self.edges_deg
    }

    /// The cells of all bands: all rows of them, and the columns that lie side by side, west to east.
    pub fn windows(&self) -> Vec<Window> {
        let mut runs: Vec<Range<u32>> = vec![];
        for (col, is_inside) in (0..).zip(&self.cols) {
            match runs.last_mut() {
                _ if !is_inside => {}
                Some(run) if run.end == col => run.end += 1,
                _ => runs.push(col..col + 1),
            }
        }
        let window = |cols: Range<u32>| Window {
            row: self.rows.start,
            col: cols.start,
            rows: self.rows.end - self.rows.start,
            cols: cols.end - cols.start,
        };
        let windows = runs.into_iter().map(window);
        windows.filter(|window| window.rows > 0).collect()
    }

    /// Sums of a field over each band: `values` are `[row, col]` of each of [`Bands::windows`], NaN no data, any unit. In the order
    /// of rows and of columns in each, so that the same field has the same bits.
    pub fn sums(&self, windows: &[Window], values: &[Vec<f32>]) -> Vec<BandSum> {
        let mut sums = vec![BandSum::default(); self.edges_deg.len()];
        self.each(windows, values, |band, value, area| {
            sums[band].weighted += area.area_m2 * value;
            sums[band].area_m2 += area.area_m2;
            sums[band].covered_m2 += area.covered_m2;
        });
        sums
    }

    /// The same with squares about the mean of each band.
    pub fn sums_with_squares(&self, windows: &[Window], values: &[Vec<f32>]) -> Vec<BandSum> {
        let mut sums = self.sums(windows, values);
        let means: Vec<f64> = sums
            .iter()
            .map(|sum| sum.mean().unwrap_or_default())
            .collect();
        self.each(windows, values, |band, value, area| {
            let apart = value - means[band];
            sums[band].squares += area.area_m2 * apart * apart;
        });
        sums
    }

    /// Areas of each band; some cells of the grid are told by a flag a column of a row. Of these it is what sums of a field over them
    /// have, to the bit.
    pub fn areas(&self, some_of_row: impl Fn(u32) -> Vec<bool>) -> Vec<BandAreas> {
        let windows = self.windows();
        let mut bands = vec![BandAreas::default(); self.edges_deg.len()];
        let mut cells = vec![];
        for row in self.rows.clone() {
            let is_some = some_of_row(row);
            for window in &windows {
                self.fill(row, window, &mut cells);
                for (col, area) in (window.col..).zip(&cells) {
                    let Some(band) = self.band_at(row, col) else {
                        continue;
                    };
                    let own = &mut bands[band];
                    own.all_m2 += area.area_m2;
                    own.covered_m2 += area.covered_m2;
                    if is_some[col as usize] {
                        own.some_m2 += area.area_m2;
                    }
                }
            }
        }
        bands
    }

    /// What counts of the cells of a row of a window.
    fn fill(&self, row: u32, window: &Window, cells: &mut Vec<CellArea>) {
        cells.resize(window.cols as usize, CellArea::default());
        match &self.areas {
            Areas::Whole(areas_m2) => {
                let area_m2 = areas_m2[row as usize];
                cells.fill(CellArea {
                    area_m2,
                    covered_m2: area_m2,
                });
            }
            Areas::Shares(shares) => shares.row(row, window, cells),
        }
    }

    fn band_at(&self, row: u32, col: u32) -> Option<usize> {
        let at = match self.along {
            Along::Lat => row,
            Along::Lon => col,
        };
        self.band_of[at as usize]
    }

    /// Hands over the band, the value and the area of each cell that has a value and an area in a band, row by row.
    fn each(
        &self,
        windows: &[Window],
        values: &[Vec<f32>],
        mut take: impl FnMut(usize, f64, CellArea),
    ) {
        let mut areas = vec![];
        for row in self.rows.clone() {
            for (window, values) in windows.iter().zip(values) {
                let start = (row - window.row) as usize * window.cols as usize;
                let cells = &values[start..start + window.cols as usize];
                self.fill(row, window, &mut areas);
                for ((col, value), area) in (window.col..).zip(cells).zip(&areas) {
                    if value.is_nan() || area.area_m2 <= 0.0 {
                        continue;
                    }
                    if let Some(band) = self.band_at(row, col) {
                        take(band, f64::from(*value), *area);
                    }
                }
            }
        }
    }
}

fn middle_lat(grid: &Grid, row: u32) -> f64 {
    0.5 * (grid.row_north_deg(row) + grid.row_north_deg(row + 1))
}

/// East of a west, so that bands do not break at the date line.
fn middle_lon(grid: &Grid, west: f64, col: u32) -> f64 {
    let middle = grid.col_west_deg(col) + 0.5 * grid.dlon_deg;
    west + (middle - west).rem_euclid(360.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 4,
        cols: 6,
        north_deg: 2.0,
        west_deg: 177.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    /// A whole field by the windows of some bands.
    fn in_windows(bands: &Bands, values: &[f32]) -> (Vec<Window>, Vec<Vec<f32>>) {
        let windows = bands.windows();
        let of = |window: &Window| window.cell_indices(&GRID).map(|at| values[at]).collect();
        let values = windows.iter().map(of).collect();
        (windows, values)
    }

    /// Sums of a whole field.
    fn sums(bands: &Bands, values: &[f32]) -> Vec<BandSum> {
        let (windows, values) = in_windows(bands, values);
        bands.sums(&windows, &values)
    }

    #[test]
    fn bands_are_area_weighted_means_of_the_cells_in_them() {
        let values: Vec<f32> = (0..24)
            .map(|i| if i == 8 { f32::NAN } else { i as f32 })
            .collect();
        let bands = Bands::of(
            &GRID,
            Along::Lat,
            2.0,
            [-180.0, -90.0, 180.0, 90.0],
            Earth::Sphere,
        );
        assert_eq!(bands.edges_deg(), [(-2.0, 0.0), (0.0, 2.0)]);
        let sums = sums(&bands, &values);
        // Rows 0 and 1 of the sphere: areas as sin 2 - sin 1 and sin 1 - sin 0.
        let area = |north: f64| north.to_radians().sin() - (north - 1.0).to_radians().sin();
        let [a, b] = [area(2.0), area(1.0)];
        let upper = (a * 15.0 + b * (51.0 - 8.0)) / (a * 6.0 + b * 5.0);
        assert!((sums[1].weighted / sums[1].area_m2 / upper - 1.0).abs() < 1e-12);
        let all = Grid { rows: 4, ..GRID }.cell_area_m2(0, Earth::Sphere);
        assert!((sums[1].area_m2 / (all * (6.0 + 5.0 * b / a)) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn spreads_of_steps_come_to_that_of_all_values_by_area_and_time() {
        // Far from zero, where a difference of sums of squares would have no digit left.
        let at = |i: usize, step: usize| 1e6 + ((i * 7 + step * 5) % 11) as f32;
        let values = |step: usize| -> Vec<f32> { (0..24).map(|i| at(i, step)).collect() };
        let whole = [-180.0, -90.0, 180.0, 90.0];
        let bands = Bands::of(&GRID, Along::Lat, 2.0, whole, Earth::Wgs84);
        let mut all = BandSum::default();
        let steps = [(0, 10.0), (1, 30.0), (2, 1.0)];
        for (step, seconds) in steps {
            let (windows, values) = in_windows(&bands, &values(step));
            all.add(&bands.sums_with_squares(&windows, &values)[1], seconds);
        }
        // Rows 0 and 1 make the northern band.
        let weighed = || {
            steps.into_iter().flat_map(|(step, seconds)| {
                (0..12).map(move |i| {
                    let weight = GRID.cell_area_m2(i as u32 / 6, Earth::Wgs84) * seconds;
                    (f64::from(at(i, step)), weight)
                })
            })
        };
        let weight: f64 = weighed().map(|(_, weight)| weight).sum();
        let mean = weighed().map(|(value, weight)| value * weight).sum::<f64>() / weight;
        let squares: f64 = weighed()
            .map(|(value, weight)| weight * (value - mean).powi(2))
            .sum();
        assert!((all.mean().unwrap() / mean - 1.0).abs() < 1e-12);
        let std = (squares / weight).sqrt();
        assert!(
            (all.std().unwrap() / std - 1.0).abs() < 1e-9,
            "{all:?} {std}"
        );
        assert_eq!(
            (BandSum::default().mean(), BandSum::default().std()),
            (None, None)
        );
    }

    #[test]
    fn areas_of_cells_are_those_of_sums_over_them_to_the_bit() {
        let values: Vec<f32> = (0..24)
            .map(|i| if i % 5 == 3 { f32::NAN } else { 1.0 })
            .collect();
        for along in [Along::Lat, Along::Lon] {
            let bounds = [178.0, -2.0, 182.0, 1.0];
            let bands = Bands::of(&GRID, along, 1.0, bounds, Earth::Wgs84);
            let expected: Vec<f64> = sums(&bands, &values)
                .iter()
                .map(|sum| sum.area_m2)
                .collect();
            let found = bands.areas(|row| (0..6).map(|col| (row * 6 + col) % 5 != 3).collect());
            let found: Vec<f64> = found.iter().map(|own| own.some_m2).collect();
            assert!(expected.len() > 2 && expected.iter().all(|area| *area > 0.0));
            let bits = |areas: &[f64]| areas.iter().map(|area| area.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&found), bits(&expected), "{along:?}");
        }
    }

    #[test]
    fn bands_of_latitude_end_at_the_poles() {
        let globe = Grid {
            rows: 36,
            cols: 72,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 5.0,
            dlon_deg: 5.0,
        };
        let whole = [-180.0, -90.0, 180.0, 90.0];
        let edges = |band_deg: f64| {
            let bands = Bands::of(&globe, Along::Lat, band_deg, whole, Earth::Wgs84);
            let edges = bands.edges_deg();
            [edges[0], edges[1], edges[edges.len() - 1]]
        };
        assert_eq!(edges(20.0), [(-90.0, -80.0), (-80.0, -60.0), (80.0, 90.0)]);
        assert_eq!(edges(30.0), [(-90.0, -60.0), (-60.0, -30.0), (60.0, 90.0)]);
    }

    #[test]
    fn bands_of_longitude_go_on_across_the_date_line() {
        let values: Vec<f32> = (0..24).map(|i| (i % 6) as f32).collect();
        let bands = Bands::of(
            &GRID,
            Along::Lon,
            1.0,
            [178.0, -1.0, 182.0, 1.0],
            Earth::Wgs84,
        );
        assert_eq!(bands.edges_deg()[0], (178.0, 179.0));
        assert_eq!(bands.edges_deg().len(), 4);
        // Cut at the edge of the grid alone.
        let cells = |cols: &[(u32, u32)]| -> Vec<Window> {
            let window = |&(col, cols): &(u32, u32)| Window {
                row: 1,
                col,
                rows: 2,
                cols,
            };
            cols.iter().map(window).collect()
        };
        assert_eq!(bands.windows(), cells(&[(1, 4)]));
        let across = |west: f64| {
            let global = Grid {
                cols: 360,
                west_deg: -180.0,
                ..GRID
            };
            let bounds = [west, -1.0, west + 4.0, 1.0];
            Bands::of(&global, Along::Lat, 1.0, bounds, Earth::Wgs84).windows()
        };
        assert_eq!(across(178.0), cells(&[(0, 2), (358, 2)]));
        assert_eq!(across(10.0), cells(&[(190, 4)]));
        let means: Vec<f64> = sums(&bands, &values)
            .iter()
            .map(|s| s.weighted / s.area_m2)
            .collect();
        assert!(
            means
                .iter()
                .zip([1.0, 2.0, 3.0, 4.0])
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
        let nowhere = Bands::of(
            &GRID,
            Along::Lat,
            1.0,
            [0.0, 50.0, 10.0, 60.0],
            Earth::Wgs84,
        );
        assert!(nowhere.edges_deg().is_empty() && sums(&nowhere, &values).is_empty());
    }
}
