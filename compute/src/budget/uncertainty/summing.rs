//! Steps of a flux as sums over pairs: cells weighed, forms transformed and summed some at a time.

use std::sync::Arc;

use contract::budget::BudgetErrors;
use contract::chunk::field_chunks;
use contract::grid::Grid;

use super::errors::Errors;
use super::in_time::{RowSum, StepErrors};
use super::pairs::{Form, Pairs, Spectrum};
use super::plane::Window;
use super::scheme::Scheme;
use crate::ComputeError;
use crate::region::loaded::RegionWeights;

/// Takes sums over pairs, some at a time, off the threads that others wait on.
pub(super) struct Summing {
    grid: Grid,
    pub(super) region: Arc<RegionWeights>,
    window: Window,
    at_once: usize,
    /// None where each cell's error is its own.
    pairs: Option<Arc<Pairs>>,
    waiting: Vec<(usize, Spectrum)>,
}

impl Summing {
    pub(super) fn new(
        grid: &Grid,
        scheme: Scheme,
        region: Arc<RegionWeights>,
        errors: &BudgetErrors,
    ) -> Self {
        let plane = scheme.window.plane(grid);
        let pairs = (errors.length_km > 0.0).then(|| Arc::new(Pairs::new(plane, errors.length_km)));
        Self {
            grid: *grid,
            region,
            window: scheme.window,
            at_once: scheme.at_once,
            pairs,
            waiting: vec![],
        }
    }

    /// What cells of a step weigh, by blocks.
    pub(super) async fn weighed(
        &self,
        values: &Arc<Vec<Vec<f32>>>,
        errors: &Errors,
    ) -> Result<StepErrors, ComputeError> {
        let (grid, window, region) = (self.grid, self.window.clone(), Arc::clone(&self.region));
        let (values, errors) = (Arc::clone(values), errors.clone());
        blocking(move || weighed(&grid, &window, &region, (&values, &errors))).await
    }

    /// Adds the sum over pairs of a form to a row, now or with others.
    pub(super) async fn take(
        &mut self,
        row: usize,
        form: Form,
        sums: &mut [RowSum],
    ) -> Result<(), ComputeError> {
        let Some(pairs) = &self.pairs else {
            let own: f64 = form.x.iter().zip(&form.y).map(|(x, y)| x * y).sum();
            sums[row].variance += own;
            return Ok(());
        };
        let pairs = Arc::clone(pairs);
        let spectrum = blocking(move || pairs.spectrum(&form)).await?;
        self.waiting.push((row, spectrum));
        if self.waiting.len() >= self.at_once {
            self.finish(sums).await?;
        }
        Ok(())
    }

    pub(super) async fn finish(&mut self, sums: &mut [RowSum]) -> Result<(), ComputeError> {
        let (rows, spectra): (Vec<_>, Vec<_>) = self.waiting.drain(..).unzip();
        let Some(pairs) = self.pairs.clone().filter(|_| !rows.is_empty()) else {
            return Ok(());
        };
        let found = blocking(move || pairs.sums(&spectra)).await?;
        for (row, own) in rows.into_iter().zip(found) {
            sums[row].variance += own;
        }
        Ok(())
    }
}

pub(super) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ComputeError> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|e| ComputeError::inconsistent("uncertainty", e))
}

/// Area x standard error of each block: `values` are `[row, col]` of each chunk of the region, kg m⁻² s⁻¹, NaN without a flux.
pub(super) fn weighed(
    grid: &Grid,
    window: &Window,
    region: &RegionWeights,
    (values, errors): (&[Vec<f32>], &Errors),
) -> StepErrors {
    let (rows, cols) = window.size();
    let mut own = StepErrors {
        blocks: vec![0.0; rows * cols],
        ..StepErrors::default()
    };
    let windows = field_chunks(grid);
    for (part, (chunk, areas_m2)) in region.chunks().enumerate() {
        let cells = windows[chunk as usize].cell_indices(grid);
        let cells = cells.zip(areas_m2.iter()).enumerate();
        for (at, (cell, area_m2)) in cells.filter(|(_, (_, area))| *area > 0.0) {
            let flux = f64::from(values[part][at]);
            if flux.is_nan() {
                continue;
            }
            own.flux_m2 += area_m2;
            let share = area_m2 * errors.of((part, at), flux);
            if share.is_nan() {
                continue;
            }
            own.error_m2 += area_m2;
            own.blocks[window.block_of(cell)] += share;
            own.sum += share;
            own.squares += share * share;
        }
    }
    own
}
