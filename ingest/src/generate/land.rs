//! Which cells of a global grid have their centre on land, row by row: what a ring of Natural Earth goes round at all.

use contract::land::LAND;

use super::grid::FileGrid;

/// Runs of land along every row.
pub(super) struct LandRows {
    grid: FileGrid,
    /// By row: where along it land begins and ends, longitudes in degrees; runs may overlap.
    runs: Vec<Vec<[f64; 2]>>,
}

impl LandRows {
    /// Of a grid from -180 to 180 degrees.
    pub(super) fn new(grid: FileGrid) -> Self {
        let mut runs = vec![Vec::new(); grid.rows as usize];
        for ring in LAND.iter() {
            add_ring(grid, ring, &mut runs);
        }
        Self { grid, runs }
    }

    /// Marks the columns of a row that are land.
    pub(super) fn mark(&self, row: u32, is_land: &mut [bool]) {
        let cells_per_deg = f64::from(self.grid.cols) / self.grid.width_deg;
        // The first column whose centre is at or beyond a longitude.
        let column = |lon: f64| {
            ((lon - self.grid.west_deg) * cells_per_deg - 0.5)
                .ceil()
                .max(0.0) as usize
        };
        for [west, east] in &self.runs[row as usize] {
            let [first, end] = [*west, *east].map(|lon| column(lon).min(is_land.len()));
            is_land[first..end].fill(true);
        }
    }
}

/// Adds the runs between every other crossing of a ring with the middle of every row.
fn add_ring(grid: FileGrid, ring: &[[f64; 2]], runs: &mut [Vec<[f64; 2]>]) {
    let rows_per_deg = f64::from(grid.rows) / grid.height_deg;
    // The first row whose middle is at or beyond a latitude.
    let row = |lat: f64| {
        ((lat - grid.south_deg) * rows_per_deg - 0.5)
            .ceil()
            .max(0.0) as u32
    };
    let mut crossings: Vec<(u32, f64)> = Vec::new();
    let last = ring[ring.len() - 1];
    let starts = std::iter::once(&last).chain(ring);
    for (a, b) in starts.zip(ring) {
        let [south, north] = if a[1] <= b[1] { [a, b] } else { [b, a] };
        for at in row(south[1])..row(north[1]).min(grid.rows) {
            let share = (grid.lat_deg(at) - south[1]) / (north[1] - south[1]);
            crossings.push((at, south[0] + share * (north[0] - south[0])));
        }
    }
    crossings.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    for pair in crossings.chunks_exact(2) {
        debug_assert_eq!(
            pair[0].0, pair[1].0,
            "a closed ring crosses a row twice or more"
        );
        runs[pair[0].0 as usize].push([pair[0].1, pair[1].1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_places_are_land_or_sea_and_the_share_of_land_is_the_earths() {
        let grid = FileGrid {
            rows: 720,
            cols: 1440,
            south_deg: -90.0,
            west_deg: -180.0,
            height_deg: 180.0,
            width_deg: 360.0,
        };
        let land = LandRows::new(grid);
        let is_land_at = |lon: f64, lat: f64| {
            let mut row = vec![false; grid.cols as usize];
            land.mark(((lat + 90.0) * 4.0) as u32, &mut row);
            row[((lon + 180.0) * 4.0) as usize]
        };
        for (lon, lat) in [
            (0.0, -85.0),
            (20.0, 0.0),
            (-100.0, 40.0),
            (134.0, -24.0),
            (178.0, 68.0),
        ] {
            assert!(is_land_at(lon, lat), "{lon} {lat}");
        }
        for (lon, lat) in [
            (0.0, 89.0),
            (-30.0, 0.0),
            (-150.0, 20.0),
            (179.9, 0.0),
            (-179.9, 0.0),
            (18.0, 35.0),
        ] {
            assert!(!is_land_at(lon, lat), "{lon} {lat}");
        }
        let (mut of_land, mut all) = (0.0, 0.0);
        for row in 0..grid.rows {
            let mut is_land = vec![false; grid.cols as usize];
            land.mark(row, &mut is_land);
            let weight = grid.lat_deg(row).to_radians().cos();
            of_land += weight * is_land.iter().filter(|land| **land).count() as f64;
            all += weight * is_land.len() as f64;
        }
        // 29.2 % with Antarctica's ice shelves; the coast here is that of the ground below.
        assert!((of_land / all - 0.29).abs() < 0.01, "{}", of_land / all);
    }
}
