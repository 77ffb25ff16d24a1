//! What is known of a file before its values are read in, the memory that they will take out.
//!
//! Cells count, not bytes of the file: a map of one value everywhere is a thousand times smaller packed than read. The
//! numbers are upper bounds for this process and the reader together, beside what each has anyway.

use contract::time::Period;

use crate::commit::{MAX_SEGMENT_STEPS, MAX_SEGMENT_VALUES};
use crate::inspect::file::description::Description;
use crate::observation::{MAX_OBSERVATIONS, MAX_VALUES, OBSERVATION_BYTES};
use crate::plan::PlannedGranule;
use crate::put::StoredGranule;

/// Bytes of a cell while its map is worked on. At most at once: 8 as the reader has it and 8 as it comes here; 8 as it
/// came and 4 as it is stored; 4 as it is stored, up to 12 in a list that grows, 4 and 4 in pages and in the object.
const CELL_BYTES: u64 = 24;
/// The file as it is stored: as it is sent, and as it is compared with one that is there.
const RAW_COPIES: u64 = 2;
/// Bytes of a value of an observation file: as the reader has it, or as it came and as it is unpacked.
const VALUE_BYTES: u64 = 16;
/// Bytes of a value of a series: 4 as a map, up to 12 in a list that grows, 4 in the object.
const SERIES_BYTES: u64 = 20;
/// A leap year, seconds.
const YEAR_S: f64 = 366.0 * 86_400.0;
/// Fewest bytes of a text that an observation is read from: a number, what parts it from the next, and its share of place
/// and time.
const TEXT_BYTES_PER_OBSERVATION: u64 = 4;

/// A file of maps: one map at a time, whatever their number.
pub(crate) fn of_grids(planned: &PlannedGranule) -> u64 {
    let map = planned.plane_cells().saturating_mul(CELL_BYTES);
    let reading = map.saturating_add(planned.session.library_bytes());
    reading.max(planned.raw.size_bytes.saturating_mul(RAW_COPIES))
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

/// Files of one product that are published together: the series of a year, as maps and as runs of cells.
///
/// How many steps a year has is taken from the files themselves: a product has steps of one length.
pub(crate) fn of_series(granules: &[StoredGranule]) -> u64 {
    let values = granules.iter().map(|granule| {
        let periods = granule.reading.steps.iter().map(|step| step.period);
        let shortest_s = periods.map(Period::seconds).fold(YEAR_S, f64::min);
        let steps = (YEAR_S / shortest_s.max(1.0)).ceil() as usize;
        let cells = granule.reading.grid.cell_count();
        let most = MAX_SEGMENT_VALUES.max(cells);
        cells.saturating_mul(steps.min(MAX_SEGMENT_STEPS)).min(most)
    });
    of_segment(values.max().unwrap_or(0))
}

/// A segment of a series of so many values, as maps and as runs of cells.
pub(crate) fn of_segment(values: usize) -> u64 {
    (values as u64).saturating_mul(SERIES_BYTES)
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
