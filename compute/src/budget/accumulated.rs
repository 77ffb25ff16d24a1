//! A budget of accumulated carbon: that of the flux which it was accumulated from, exact, and how complete it is.

use contract::budget::{BudgetAnswer, BudgetQuery, Completeness};
use contract::chunk::field_chunks;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::time::TimeMs;
use storage::{Store, contributed};

use super::over_region::{AskedArea, weights};

use crate::region::loaded::{RegionWeights, weights_failed};
use crate::{ComputeError, Engine};

/// The budget of the flux as that of a version of the carbon that was accumulated from it.
pub(super) async fn completed(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
    mut answer: BudgetAnswer,
) -> Result<BudgetAnswer, ComputeError> {
    answer.product = manifest.product.clone();
    answer.manifest = manifest.id();
    answer.title.clone_from(&manifest.title);
    let address = weights(engine, manifest, AskedArea::of(query)).await?.all;
    let areas = engine.objects().weights(&address).await;
    let areas = areas.map_err(weights_failed)?;
    let mut counted = Counted::new(engine.store(), manifest);
    for row in &mut answer.rows {
        let (start, end) = (
            counted.until(row.start).await?,
            counted.until(row.end).await?,
        );
        row.completeness = start.zip(end).map(|(start, end)| {
            let row_ms = row.end.ms() - row.start.ms();
            let within: Vec<i64> = end
                .iter()
                .zip(&start)
                .map(|(end, start)| end - start)
                .collect();
            completeness(manifest, &areas, &within, row_ms)
        });
    }
    Ok(answer)
}

/// Areas of cells by whether `with_data_ms` (`[row, col]`) is all of a time, some or nothing.
fn completeness(
    manifest: &Manifest,
    areas: &RegionWeights,
    with_data_ms: &[i64],
    all_ms: i64,
) -> Completeness {
    let windows = field_chunks(&manifest.grid);
    let (mut complete_m2, mut incomplete_m2) = (0.0, 0.0);
    for (chunk, areas) in areas.chunks() {
        let cells = windows[chunk as usize].cell_indices(&manifest.grid);
        for (cell, area_m2) in cells.zip(areas) {
            match with_data_ms[cell] {
                0 => {}
                own_ms if own_ms == all_ms => complete_m2 += area_m2,
                _ => incomplete_m2 += area_m2,
            }
        }
    }
    Completeness {
        complete_m2,
        incomplete_m2,
    }
}

/// Time with data since the start of accumulation, ms, `[row, col]`.
type WithData = Vec<i64>;

/// Stored counts at any instant; the last two read are kept, because a row begins where the one before it ends, and an instant within a
/// step takes the counts of both of its ends.
struct Counted<'a> {
    store: &'a Store,
    manifest: &'a Manifest,
    /// The newest first.
    last: [Option<(ObjectKey, WithData)>; 2],
}

impl<'a> Counted<'a> {
    fn new(store: &'a Store, manifest: &'a Manifest) -> Self {
        Self {
            store,
            manifest,
            last: [None, None],
        }
    }

    /// Time with data until an instant; none where the version did not count it. A cell's part of a step that the
    /// instant lies in is the part of that step's time.
    async fn until(&mut self, time: TimeMs) -> Result<Option<WithData>, ComputeError> {
        let steps = &self.manifest.steps;
        let whole = steps.partition_point(|step| step.period.end <= time);
        let before = match whole.checked_sub(1) {
            Some(last) => self.after(&steps[last]).await?,
            None => Some(vec![0; self.manifest.grid.cell_count()]),
        };
        let cut = steps.get(whole).filter(|step| step.period.start < time);
        let (Some(mut with_data), Some(cut)) = (before.clone(), cut) else {
            return Ok(before);
        };
        let Some(after) = self.after(cut).await? else {
            return Ok(None);
        };
        let inside_ms = time.ms() - cut.period.start.ms();
        for (own, after) in with_data.iter_mut().zip(after) {
            if after > *own {
                *own += inside_ms;
            }
        }
        Ok(Some(with_data))
    }

    /// Time with data until the end of a step.
    async fn after(&mut self, step: &Step) -> Result<Option<WithData>, ComputeError> {
        let Some(counted) = &step.contributed else {
            return Ok(None);
        };
        let mut last = self.last.iter().flatten();
        if let Some((_, with_data)) = last.find(|(key, _)| *key == counted.counts) {
            return Ok(Some(with_data.clone()));
        }
        let grid = &self.manifest.grid;
        let counts = contributed::read(self.store, &counted.counts, grid).await?;
        let with_data = counts.milliseconds;
        self.last.rotate_right(1);
        self.last[0] = Some((counted.counts.clone(), with_data.clone()));
        Ok(Some(with_data))
    }
}
