//! The domain of accumulated carbon: the steps that it is accumulated over in; the cells that hold data in any of them out. Cells with data
//! before a chosen start alone have accumulated nothing, and hold none.

use contract::chunk::bands;
use contract::manifest::Manifest;
use storage::contributed::Reader;
use storage::domain::{self, Cells};
use storage::fields;

use super::prior::Prior;
use super::source::SourceStep;
use crate::ComputeError;
use crate::workshop::Workshop;

/// Cells with data in any of some steps of a source: all of its domain where no step of it is left out, else those of the sums that are kept,
/// and of every step after these, which is read for it.
pub(super) async fn with_data(
    workshop: Workshop<'_>,
    source: &Manifest,
    steps: &[SourceStep<'_>],
    prior: &Prior<'_>,
) -> Result<Cells, ComputeError> {
    let (store, grid) = (workshop.store, &source.grid);
    if steps.len() == source.steps.len() {
        let cells = domain::read_cells(store, &source.domain).await?;
        if cells.map_count() != grid.cell_count() {
            return Err(ComputeError::inconsistent(
                source.domain.to_string(),
                "it does not fill its product's grid",
            ));
        }
        return Ok(cells);
    }
    let first_cell = |row: u32| row as usize * grid.cols as usize;
    let mut cells = Cells::none(grid.cell_count());
    let last_kept = prior.step_count.checked_sub(1);
    if let Some(kept) = last_kept.and_then(|last| prior.counts(last)) {
        let mut counts = Reader::open(store, &kept.counts, grid).await?;
        for rows in bands(grid, workshop.band_cells) {
            let own = counts.rows(rows.len() as u32)?;
            cells.add_where(first_cell(rows.start), &own.steps, |steps| *steps > 0);
        }
    }
    for step in &steps[prior.step_count..] {
        let band_cells = workshop.band_cells;
        let mut bands = fields::bands(store, &step.step.field, grid, band_cells).await?;
        while let Some((rows, values)) = bands.next().await? {
            cells.add_valued(first_cell(rows.start), &values);
        }
    }
    Ok(cells)
}
