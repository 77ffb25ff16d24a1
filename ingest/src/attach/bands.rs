//! How an array is chunked in, the bands of rows that its maps are read by out: what is unpacked of a step at a time.

use std::ops::Range;

use contract::chunk::BAND_CELLS;

use crate::plan::cf::axis::Mapping;
use crate::plan::cf::coordinate::{Axis, Role};

/// Most cells of a band, whatever chunks are like: 12 bytes a cell as they come and as they are checked, and 8 of the next band.
const MOST_CELLS: u64 = 1 << 25;

/// Which of the axes of an array has its rows; none if it has none.
pub(super) fn rows_axis(axes: &[Axis]) -> Option<usize> {
    axes.iter().position(|axis| axis.role == Role::Latitude)
}

/// Bands of the rows of a grid, north to south.
///
/// - `starts`: first rows of chunks in the array, ascending
pub(super) fn of(mapping: &Mapping, starts: &[u64]) -> Vec<Range<u32>> {
    let rows_of = |cells: u64| (cells / u64::from(mapping.grid.cols).max(1)).max(1) as usize;
    cut(
        &mapping.file_rows,
        starts,
        [BAND_CELLS, MOST_CELLS].map(rows_of),
    )
}

/// Whole rows of chunks, as many as have at most `wanted` rows of the map, or one. A row of chunks of more than `most` rows is cut: each
/// of its chunks is unpacked for all of its bands, if it is kept, and else for each.
fn cut(file_rows: &[u32], starts: &[u64], [wanted, most]: [usize; 2]) -> Vec<Range<u32>> {
    let chunk = |row: &u32| starts.partition_point(|start| *start <= u64::from(*row));
    let mut lengths: Vec<usize> = vec![];
    for rows in file_rows.chunk_by(|row, next| chunk(row) == chunk(next)) {
        match lengths.last_mut() {
            Some(length) if *length + rows.len() <= wanted => *length += rows.len(),
            _ => lengths.push(rows.len()),
        }
    }
    let (mut bands, mut first) = (vec![], 0);
    for length in lengths {
        let end = first + length;
        for start in (first..end).step_by(most) {
            bands.push(start as u32..end.min(start + most) as u32);
        }
        first = end;
    }
    bands
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bands(file_rows: &[u32], starts: &[u64], rows: [usize; 2]) -> Vec<[u32; 2]> {
        let bands = cut(file_rows, starts, rows);
        bands.iter().map(|band| [band.start, band.end]).collect()
    }

    #[test]
    fn bands_end_where_chunks_do_from_either_end_of_the_array() {
        let north_first: Vec<u32> = (0..10).collect();
        let south_first: Vec<u32> = (0..10).rev().collect();
        let chunks = [0, 4, 8];
        let of = |rows: &[u32], wanted| bands(rows, &chunks, [wanted, 100]);
        assert_eq!(of(&north_first, 4), [[0, 4], [4, 8], [8, 10]]);
        assert_eq!(of(&north_first, 9), [[0, 8], [8, 10]]);
        // The short chunk is the northern one.
        assert_eq!(of(&south_first, 4), [[0, 2], [2, 6], [6, 10]]);
        assert_eq!(of(&south_first, 7), [[0, 6], [6, 10]]);
        for rows in [&north_first, &south_first] {
            assert_eq!(of(rows, 10), [[0, 10]]);
            // A row of chunks is read at once though it is more than is wanted.
            assert_eq!(of(rows, 1).len(), 3);
        }
    }

    #[test]
    fn a_row_of_chunks_that_is_too_large_is_cut() {
        let rows: Vec<u32> = (0..10).collect();
        let whole = [[0, 3], [3, 6], [6, 9], [9, 10]];
        assert_eq!(bands(&rows, &[0], [2, 3]), whole);
        assert_eq!(bands(&rows, &[], [2, 3]), whole, "of no known chunks");
        let two = bands(&rows, &[0, 5], [2, 3]);
        assert_eq!(two, [[0, 3], [3, 5], [5, 8], [8, 10]]);
    }
}
