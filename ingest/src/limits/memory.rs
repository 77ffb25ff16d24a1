//! What is known of a file before its values are read in, the memory that they will take out.
//!
//! Cells count, not bytes of the file: a map of one value everywhere is a thousand times smaller packed than read. The
//! numbers are upper bounds for this process and the reader together, beside what each has anyway.

use std::num::NonZeroUsize;

use contract::chunk::{BAND_CELLS, CHUNK_ROWS};
use contract::grid::Grid;

use super::Limits;
use crate::commit::FIELDS_AT_ONCE;
use crate::encode::HELD_BYTES;
use crate::fetch;
use crate::inspect::file::description::Description;
use crate::observation::{MAX_OBSERVATIONS, MAX_VALUES, OBSERVATION_BYTES};
use crate::plan::{Plan, PlannedGranule};

/// Bytes of a cell while its band is worked on. At most at once: 8 as the reader has it and 8 as it comes here; 8 as it
/// came and 4 as it is stored; 4 as it is stored, up to 12 in a list that grows, 4 and 4 in pages and in the object.
const CELL_BYTES: u64 = 24;
/// Memory of maps of one file that are worked on at a time, bytes, unless one alone needs more.
const MAPS_BYTES: u64 = 128 << 20;
/// Of these how many may wait for the store while processors work on others.
const MAPS_WAITING: usize = 2;
/// The file as it is stored: as it is sent, and as it is compared with one that is there.
const RAW_COPIES: u64 = 2;
/// Bands of one map that are held: one is worked on while the next is read.
const BANDS_HELD: u64 = 2;
/// Bytes of a value of an observation file: as the reader has it, or as it came and as it is unpacked.
const VALUE_BYTES: u64 = 16;
/// Bytes of a cell of a stored field: 4 in the object, 4 in its pages, 4 as a map and, while a cube follows, 4 in its chunks.
const FIELD_BYTES: u64 = 16;
/// Sets of the cells of a domain, a bit each: those before, those that are found, those that may be lost.
const DOMAIN_COPIES: u64 = 3;
/// Fewest bytes of a text that an observation is read from: a number, what parts it from the next, and its share of place
/// and time.
const TEXT_BYTES_PER_OBSERVATION: u64 = 4;

/// Maps of a file that are worked on at a time: as many as processors have something to do with, while the next is read, and
/// one of what is large.
pub(crate) fn grids_at_once(plan: &Plan, limits: &Limits) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let map = map_bytes(plan, limits).max(1);
    let most = plan.steps.len().min(processors + MAPS_WAITING);
    ((MAPS_BYTES / map) as usize).clamp(1, most.max(1))
}

/// A file of maps: a few at a time, whatever their number, and of each no more than its bands.
pub(crate) fn of_grids(planned: &PlannedGranule, limits: &Limits) -> u64 {
    let PlannedGranule { raw, plan } = planned;
    let map = map_bytes(plan, limits);
    let map = map.saturating_mul(grids_at_once(plan, limits) as u64);
    let reading = map.saturating_add(plan.values.library_bytes());
    let raw = raw.size_bytes.min(fetch::HELD_BYTES);
    reading.saturating_add(raw.saturating_mul(RAW_COPIES))
}

/// What is held of a map that is worked on.
fn map_bytes(plan: &Plan, limits: &Limits) -> u64 {
    of_map(
        plan.plane_cells(),
        plan.mapping.grid.cols,
        limits.band_cells,
    )
}

/// The same of a map of so many cells as it lies in the file, of so many columns.
fn of_map(plane_cells: u64, cols: u32, band_cells: u64) -> u64 {
    let band = band_cells.max(u64::from(CHUNK_ROWS) * u64::from(cols));
    if plane_cells <= band {
        return plane_cells.saturating_mul(CELL_BYTES);
    }
    let cells = plane_cells.min(band.saturating_mul(BANDS_HELD));
    cells.saturating_mul(CELL_BYTES).saturating_add(HELD_BYTES)
}

/// A NetCDF file of observations: all coordinates are held while each measured variable is read.
pub(crate) fn of_observations(file: &Description) -> u64 {
    let cells = file.variables.iter().map(|variable| {
        let cells = variable.cell_count().min(u128::from(MAX_VALUES));
        (cells as u64).saturating_mul(variable.numbers_a_value())
    });
    let cells = cells.fold(0, u64::saturating_add);
    cells
        .saturating_mul(VALUE_BYTES)
        .saturating_add(file.library_bytes)
        .saturating_add(gathered_bytes(cells))
}

/// A text of observations, which is held whole.
pub(crate) fn of_text(file_bytes: u64) -> u64 {
    file_bytes.saturating_add(gathered_bytes(file_bytes / TEXT_BYTES_PER_OBSERVATION))
}

/// Bands of stored fields that are read, a few at a time, while a version is made, and the cells of its domain.
pub(crate) fn of_fields(grid: &Grid) -> u64 {
    let cells = grid.cell_count() as u64;
    let band = BAND_CELLS.max(u64::from(CHUNK_ROWS) * u64::from(grid.cols));
    let held = cells.min(band).saturating_mul(FIELDS_AT_ONCE as u64 + 1);
    let domain = DOMAIN_COPIES.saturating_mul(cells.div_ceil(8));
    held.saturating_mul(FIELD_BYTES).saturating_add(domain)
}

/// Observations that are gathered before they are stored.
fn gathered_bytes(count: u64) -> u64 {
    count.min(MAX_OBSERVATIONS as u64) * OBSERVATION_BYTES
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::{Attributes, Dimension, Kind, Variable};

    #[test]
    fn of_a_large_map_bands_are_counted_and_of_a_small_one_all_of_it() {
        assert_eq!(of_map(1 << 20, 1 << 10, 1 << 23), CELL_BYTES << 20);
        let bands = BANDS_HELD * CELL_BYTES * (1 << 23) + HELD_BYTES;
        assert_eq!(of_map(648_000_000, 36_000, 1 << 23), bands);
        assert_eq!(of_map(1 << 31, 1 << 16, 1 << 23), bands);
        // A row of chunks is read whole, however wide.
        let wide = BANDS_HELD * CELL_BYTES * 60 * (1 << 20) + HELD_BYTES;
        assert_eq!(of_map(1 << 31, 1 << 20, 1 << 23), wide);
    }

    #[test]
    fn what_a_file_declares_is_counted_and_not_what_it_weighs() {
        let variable = |len| Variable {
            name: "v".into(),
            dimensions: vec![Dimension { name: None, len }],
            kind: Kind::Float(4),
            attributes: Attributes::default(),
        };
        let file = |lens: &[u64]| Description {
            variables: lens.iter().map(|len| variable(*len)).collect(),
            library_bytes: 1000,
            ..Description::default()
        };
        let per_value = VALUE_BYTES + OBSERVATION_BYTES;
        assert_eq!(of_observations(&file(&[100, 200])), 1000 + 300 * per_value);
        // What will be refused for its size is not waited for, and nothing overflows.
        let most = MAX_VALUES * VALUE_BYTES + 1000 + MAX_OBSERVATIONS as u64 * OBSERVATION_BYTES;
        assert_eq!(of_observations(&file(&[u64::MAX])), most);
        assert_eq!(of_text(400), 400 + 100 * OBSERVATION_BYTES);
        assert!(of_text(u64::MAX) == u64::MAX);
    }
}
