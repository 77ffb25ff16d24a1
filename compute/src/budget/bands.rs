//! Array kernels of the sea by bands of latitude: one chunk and the sea's areas in, exact sums of every band out.
//!
//! A cell belongs to the band that its middle lies in. Gaps are estimated band by band (`gaps.rs`).

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS};
use contract::grid::Grid;

use super::chunk::{ChunkSums, chunk_sums, total_area_steps};
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
    /// As [`ChunkSums`] has it.
    pub mass_steps: i128,
    /// As [`ChunkSums`] has it.
    pub area_steps: i128,
}

/// The band of a row of a grid.
fn band_of(grid: &Grid, row: u32) -> usize {
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

/// [`chunk_sums`] of every band; `values` and `area_m2` are `[cell]` of a chunk of the grid.
pub fn band_sums(
    grid: &Grid,
    chunk: u32,
    values: &[f32],
    area_m2: &[f64],
    seconds: f64,
) -> Result<[ChunkSums; BAND_COUNT], OutOfRange> {
    let mut sums = [ChunkSums::default(); BAND_COUNT];
    let Some((bands, cols)) = rows(grid, chunk) else {
        return Ok(sums);
    };
    let cells = values.chunks(cols).zip(area_m2.chunks(cols));
    for (band, (values, area_m2)) in bands.zip(cells) {
        let row = chunk_sums(values, area_m2, seconds)?;
        sums[band].mass_steps += row.mass_steps;
        sums[band].area_steps += row.area_steps;
    }
    Ok(sums)
}

/// Sums of bands as text, those without data left out: `band,mass_steps,area_steps`, with spaces between them.
pub fn bands_text(sums: &[ChunkSums; BAND_COUNT]) -> String {
    let held = sums
        .iter()
        .enumerate()
        .filter(|(_, sum)| sum.area_steps != 0);
    let words: Vec<String> = held
        .map(|(band, sum)| format!("{band},{},{}", sum.mass_steps, sum.area_steps))
        .collect();
    words.join(" ")
}

/// The sums that a text of any number of chunks says; none if it is no such text.
pub fn summed_bands(text: &str) -> Option<Vec<BandSum>> {
    let mut sums: Vec<BandSum> = vec![];
    for word in text.split_ascii_whitespace() {
        let mut numbers = word.split(',');
        let band = numbers
            .next()?
            .parse()
            .ok()
            .filter(|band| *band < BAND_COUNT)?;
        let mass_steps: i128 = numbers.next()?.parse().ok()?;
        let area_steps: i128 = numbers.next()?.parse().ok()?;
        if let Some(sum) = sums.iter_mut().find(|sum| sum.band == band) {
            sum.mass_steps = sum.mass_steps.checked_add(mass_steps)?;
            sum.area_steps = sum.area_steps.checked_add(area_steps)?;
        } else {
            sums.push(BandSum {
                band,
                mass_steps,
                area_steps,
            });
        }
    }
    sums.sort_unstable_by_key(|sum| sum.band);
    Some(sums)
}

/// Area of all sea in every band, m² in steps of 10⁻⁶, of the chunks of a region's sea.
pub fn band_areas<'a>(
    grid: &Grid,
    chunks: impl Iterator<Item = (u32, &'a [f64])>,
) -> Result<[i128; BAND_COUNT], OutOfRange> {
    let mut areas = [0; BAND_COUNT];
    for (chunk, area_m2) in chunks {
        let Some((bands, cols)) = rows(grid, chunk) else {
            continue;
        };
        for (band, area_m2) in bands.zip(area_m2.chunks(cols)) {
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
    fn bands_of_all_chunks_are_the_sums_of_their_cells() {
        let value = |i: usize| {
            if i.is_multiple_of(7) {
                f32::NAN
            } else {
                i as f32 * 1e-12
            }
        };
        let area = |i: usize| 1e9 + i as f64;
        let mut sums = [ChunkSums::default(); BAND_COUNT];
        let mut areas = [0; BAND_COUNT];
        for (chunk, window) in field_chunks(&GRID).into_iter().enumerate() {
            let cells: Vec<usize> = window.cell_indices(&GRID).collect();
            let values: Vec<f32> = cells.iter().map(|&i| value(i)).collect();
            let area_m2: Vec<f64> = cells.iter().map(|&i| area(i)).collect();
            let chunk = chunk as u32;
            let found = band_sums(&GRID, chunk, &values, &area_m2, 10.0).unwrap();
            for (sum, found) in sums.iter_mut().zip(found) {
                sum.mass_steps += found.mass_steps;
                sum.area_steps += found.area_steps;
            }
            let all = band_areas(&GRID, [(chunk, &area_m2[..])].into_iter()).unwrap();
            areas
                .iter_mut()
                .zip(all)
                .for_each(|(sum, area)| *sum += area);
        }
        for band in 0..BAND_COUNT {
            let south = BAND_DEG * band as f64 - 90.0;
            let in_band = |i: &usize| {
                let place = GRID.cell_center((i / 250) as u32, 0);
                (south..south + BAND_DEG).contains(&place.lat)
            };
            let cells: Vec<usize> = (0..GRID.cell_count()).filter(in_band).collect();
            let values: Vec<f32> = cells.iter().map(|&i| value(i)).collect();
            let area_m2: Vec<f64> = cells.iter().map(|&i| area(i)).collect();
            assert_eq!(
                sums[band],
                chunk_sums(&values, &area_m2, 10.0).unwrap(),
                "{band}"
            );
            assert_eq!(areas[band], total_area_steps(&area_m2).unwrap(), "{band}");
        }
    }

    #[test]
    fn texts_of_chunks_are_summed_in_any_order() {
        let mut sums = [ChunkSums::default(); BAND_COUNT];
        (sums[3].mass_steps, sums[3].area_steps) = (-7, 2);
        (sums[35].mass_steps, sums[35].area_steps) = (1 << 90, 5);
        let text = bands_text(&sums);
        assert_eq!(text, format!("3,-7,2 35,{},5", 1i128 << 90));
        let band = |band, mass_steps, area_steps| BandSum {
            band,
            mass_steps,
            area_steps,
        };
        for joined in [
            format!("{text}  4,1,1 3,6,1"),
            format!("3,6,1 4,1,1 {text}"),
        ] {
            let expected = [band(3, -1, 3), band(4, 1, 1), band(35, 1 << 90, 5)];
            assert_eq!(summed_bands(&joined).unwrap(), expected);
        }
        assert_eq!(summed_bands(" "), Some(vec![]));
        for wrong in ["3", "3,1", "36,1,1", "3,x,1"] {
            assert_eq!(summed_bands(wrong), None, "{wrong}");
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
        let none = band_sums(&globe, 9, &vec![1.0; 7200], &vec![1.0; 7200], 1.0).unwrap();
        assert!(none.iter().all(|sums| sums.area_steps == 0));
    }
}
