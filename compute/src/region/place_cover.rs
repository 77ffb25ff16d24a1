//! A place on a grid: the cell that holds it, or the four whose centres lie around it, with their shares.

use std::collections::BTreeMap;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS, field_chunks};
use contract::geometry::Sampling;
use contract::grid::{Grid, LonLatDeg};

/// Shares of a place in every cell, together 1, by chunk number; none if it lies outside the grid.
pub(crate) fn shares(grid: &Grid, place: LonLatDeg, sampling: Sampling) -> Vec<(u32, Vec<f64>)> {
    let Some(cell) = grid.cell_at(place) else {
        return vec![];
    };
    let cells = match sampling {
        Sampling::Cell => vec![(cell, 1.0)],
        Sampling::Bilinear => around(grid, place),
    };
    let windows = field_chunks(grid);
    let across = grid.cols.div_ceil(CHUNK_COLS);
    let mut chunks: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for ((row, col), share) in cells.into_iter().filter(|(_cell, share)| *share > 0.0) {
        let chunk = row / CHUNK_ROWS * across + col / CHUNK_COLS;
        let window = windows[chunk as usize];
        let shares = chunks
            .entry(chunk)
            .or_insert_with(|| vec![0.0; window.cell_count()]);
        shares[((row - window.row) * window.cols + col - window.col) as usize] += share;
    }
    chunks.into_iter().collect()
}

/// The cells whose centres lie around a place. Beyond the outermost centres the outermost cells hold alone, but a grid that
/// goes all the way round has none along its parallels.
fn around(grid: &Grid, place: LonLatDeg) -> Vec<((u32, u32), f64)> {
    let y = (grid.north_deg - place.lat) / grid.dlat_deg - 0.5;
    let x = grid.east_of_edge_deg(place.lon) / grid.dlon_deg - 0.5;
    let row = |at: f64| at.clamp(0.0, f64::from(grid.rows - 1)) as u32;
    let col = |at: f64| {
        let cols = f64::from(grid.cols);
        if grid.is_periodic() {
            at.rem_euclid(cols) as u32
        } else {
            at.clamp(0.0, cols - 1.0) as u32
        }
    };
    let (north, west) = (y.floor(), x.floor());
    let (down, right) = (y - north, x - west);
    let corner = |rows: f64, cols: f64| (row(north + rows), col(west + cols));
    vec![
        (corner(0.0, 0.0), (1.0 - down) * (1.0 - right)),
        (corner(0.0, 1.0), (1.0 - down) * right),
        (corner(1.0, 0.0), down * (1.0 - right)),
        (corner(1.0, 1.0), down * right),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 180,
        cols: 360,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    fn cells(grid: &Grid, lon: f64, lat: f64, sampling: Sampling) -> BTreeMap<(u32, u32), f64> {
        let place = LonLatDeg::new(lon, lat).unwrap();
        let windows = field_chunks(grid);
        let mut found = BTreeMap::new();
        for (chunk, shares) in shares(grid, place, sampling) {
            let window = windows[chunk as usize];
            for (cell, share) in (0u32..).zip(shares).filter(|(_, share)| *share > 0.0) {
                let at = (
                    window.row + cell / window.cols,
                    window.col + cell % window.cols,
                );
                found.insert(at, share);
            }
        }
        found
    }

    #[test]
    fn a_place_is_its_cell_or_the_four_around_it() {
        let own = cells(&GRID, 10.25, 20.75, Sampling::Cell);
        assert_eq!(own, BTreeMap::from([((69, 190), 1.0)]));
        let four = cells(&GRID, 10.25, 20.75, Sampling::Bilinear);
        let expected = [
            ((68, 189), 0.0625),
            ((68, 190), 0.1875),
            ((69, 189), 0.1875),
            ((69, 190), 0.5625),
        ];
        assert_eq!(four, BTreeMap::from(expected));
        let center = cells(&GRID, 10.5, 20.5, Sampling::Bilinear);
        assert_eq!(center, BTreeMap::from([((69, 190), 1.0)]));
    }

    #[test]
    fn around_the_earth_the_first_column_follows_the_last() {
        let dated = cells(&GRID, 179.9, 0.5, Sampling::Bilinear);
        let keys: Vec<_> = dated.keys().copied().collect();
        assert_eq!(keys, [(89, 0), (89, 359)]);
        let pole = cells(&GRID, 10.5, 89.9, Sampling::Bilinear);
        assert_eq!(pole, BTreeMap::from([((0, 190), 1.0)]));
        let regional = Grid {
            cols: 30,
            west_deg: 100.0,
            ..GRID
        };
        let edge = cells(&regional, 100.1, 0.5, Sampling::Bilinear);
        assert_eq!(edge, BTreeMap::from([((89, 0), 1.0)]));
        assert!(cells(&regional, 99.9, 0.5, Sampling::Bilinear).is_empty());
        // Its eastern edge is of the last column, and what rounding puts a hair west of the western one of the first.
        let edge = cells(&regional, 130.0, 0.5, Sampling::Bilinear);
        assert_eq!(edge, BTreeMap::from([((89, 29), 1.0)]));
        let edge = cells(&regional, 100.0 - 1e-12, 0.5, Sampling::Bilinear);
        assert_eq!(edge, BTreeMap::from([((89, 0), 1.0)]));
        assert!(cells(&regional, 130.1, 0.5, Sampling::Bilinear).is_empty());
    }
}
