//! The sea by bands of latitude: which band a row is in, and how much sea each band has.
//!
//! A cell belongs to the band that its middle lies in. Gaps are estimated band by band (`gaps.rs`).

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS};
use contract::grid::Grid;

use super::chunk::total_area_steps;
use super::fixed::OutOfRange;

/// Height of a band, degrees: that of the cells of Takahashi et al. (2009) and others, so that a band has values where a
/// row of a finer grid has none.
pub const BAND_DEG: f64 = 5.0;
/// Number of bands from pole to pole.
pub const BAND_COUNT: usize = 36;

/// Sums of the sea with data in one band.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BandSum {
    /// Which, from the south pole.
    pub band: usize,
    /// As [`ChunkSums`](super::chunk::ChunkSums) has it.
    pub mass_steps: i128,
    /// As [`ChunkSums`](super::chunk::ChunkSums) has it.
    pub area_steps: i128,
}

/// The band of a row of a grid.
pub(crate) fn band_of(grid: &Grid, row: u32) -> usize {
    let middle_deg = 0.5 * (grid.row_north_deg(row) + grid.row_north_deg(row + 1));
    (((middle_deg + 90.0) / BAND_DEG) as usize).min(BAND_COUNT - 1)
}

/// Rows of a chunk of a grid with their bands, and how many columns it has; none if the grid has no such chunk.
fn rows(grid: &Grid, chunk: u32) -> Option<(impl Iterator<Item = usize>, usize)> {
    let across = grid.cols.div_ceil(CHUNK_COLS);
    let (first_row, first_col) = (chunk / across * CHUNK_ROWS, chunk % across * CHUNK_COLS);
    let rows = first_row..(first_row + CHUNK_ROWS).min(grid.rows);
    let cols = CHUNK_COLS.min(grid.cols - first_col);
    let grid = *grid;
    (first_row < grid.rows).then(|| (rows.map(move |row| band_of(&grid, row)), cols as usize))
}

/// Area of all sea in every band, m² in steps of 10⁻⁶, of the chunks of a region's sea.
pub fn band_areas(
    grid: &Grid,
    chunks: impl Iterator<Item = (u32, impl AsRef<[f64]>)>,
) -> Result<[i128; BAND_COUNT], OutOfRange> {
    let mut areas = [0; BAND_COUNT];
    for (chunk, area_m2) in chunks {
        let Some((bands, cols)) = rows(grid, chunk) else {
            continue;
        };
        for (band, area_m2) in bands.zip(area_m2.as_ref().chunks(cols)) {
            areas[band] += total_area_steps(area_m2)?;
        }
    }
    Ok(areas)
}

#[cfg(test)]
mod tests {
    use contract::chunk::field_chunks;

    use super::*;

    /// Chunks that are cut at both edges, rows that are no whole part of a band.
    const GRID: Grid = Grid {
        rows: 130,
        cols: 250,
        north_deg: 60.0,
        west_deg: -100.0,
        dlat_deg: 0.7,
        dlon_deg: 0.5,
    };

    #[test]
    fn areas_of_all_chunks_are_the_sums_of_their_cells() {
        let area = |i: usize| 1e9 + i as f64;
        let mut areas = [0; BAND_COUNT];
        for (chunk, window) in field_chunks(&GRID).into_iter().enumerate() {
            let area_m2: Vec<f64> = window.cell_indices(&GRID).map(area).collect();
            let all = band_areas(&GRID, [(chunk as u32, &area_m2[..])].into_iter()).unwrap();
            areas
                .iter_mut()
                .zip(all)
                .for_each(|(sum, area)| *sum += area);
        }
        for (band, found) in areas.iter().enumerate() {
            let south = BAND_DEG * band as f64 - 90.0;
            let in_band = |i: &usize| {
                let place = GRID.cell_center((i / 250) as u32, 0);
                (south..south + BAND_DEG).contains(&place.lat)
            };
            let cells = (0..GRID.cell_count()).filter(in_band);
            let area_m2: Vec<f64> = cells.map(area).collect();
            assert_eq!(*found, total_area_steps(&area_m2).unwrap(), "{band}");
        }
    }

    #[test]
    fn poles_belong_to_the_outermost_bands_and_a_chunk_that_is_none_to_nothing() {
        let globe = Grid {
            rows: 180,
            cols: 360,
            north_deg: 90.0,
            west_deg: -180.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        };
        assert_eq!((band_of(&globe, 0), band_of(&globe, 179)), (35, 0));
        assert_eq!((band_of(&globe, 89), band_of(&globe, 90)), (18, 17));
        let none = band_areas(&globe, [(9, &vec![1.0; 7200][..])].into_iter()).unwrap();
        assert!(none.iter().all(|area| *area == 0));
    }
}
