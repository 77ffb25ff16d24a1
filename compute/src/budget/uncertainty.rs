//! How uncertain the rows of a budget are: standard errors of the flux, propagated with what cells and steps have in common.
//!
//! variance = sum over cells i, j and steps s, t of w_is w_jt exp(-d_ij / length) exp(-|t_s - t_t| / days), where w is area x time x
//! standard error. Nothing is drawn and nothing left out (docs/decisions/030).

mod errors;
mod in_time;
mod pairs;
mod plane;
mod scheme;

use std::sync::Arc;

use contract::budget::{BudgetErrors, BudgetQuery, BudgetUncertainty, RowUncertainty, StatedError};
use contract::chunk::field_chunks;
use contract::grid::Grid;
use contract::manifest::{Manifest, Step};
use contract::region::Cells;
use contract::time::Period;
use storage::fields;

use self::errors::{Errors, Source};
use self::in_time::{RowSum, StepErrors};
use self::pairs::{Form, Pairs, Spectrum};
use self::plane::Window;
use self::scheme::Scheme;
use super::over_region::{AskedArea, weights};
use super::rows::KG_PER_TG;
use crate::region::loaded::{RegionWeights, weights_failed};
use crate::{ComputeError, Engine};

/// Rows with how uncertain they are, and how that was reckoned.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Uncertain {
    pub(super) basis: BudgetUncertainty,
    /// In the order of the periods that were asked for.
    pub(super) rows: Vec<RowUncertainty>,
}

/// The uncertainty of some rows of a budget.
///
/// # Errors
/// `Uncertainty` for errors that do not fit the flux, or a region with too much in it.
pub(super) async fn of_rows(
    engine: &Engine,
    query: &BudgetQuery,
    errors: &BudgetErrors,
    flux: (&Manifest, &[&Step]),
    periods: &[Period],
) -> Result<Uncertain, ComputeError> {
    let (manifest, steps) = flux;
    let mut source = Source::of(errors, manifest)?;
    let address = weights(engine, manifest, AskedArea::of(query)).await?;
    let address = match query.cells {
        Cells::Whole => address.all,
        Cells::OceanShare => address.ocean,
    };
    let region = engine.objects().weights(&address).await;
    let region = region.map_err(weights_failed)?;
    let (mut sums, mut words) = (
        vec![RowSum::default(); periods.len()],
        "nothing lies in the region".to_owned(),
    );
    if let Some(window) = Window::of(&manifest.grid, &region) {
        let overlaps = |step: &Step| periods.iter().filter(|row| row.overlaps(step.period)).count();
        let form_count = steps.iter().map(|step| overlaps(step)).sum();
        let scheme = Scheme::of(&manifest.grid, &window, errors.length_km, form_count)?;
        words.clone_from(&scheme.words);
        let mut summing = Summing::new(&manifest.grid, scheme, region, errors);
        for step in steps {
            let own = source.read(engine.store(), step.period).await?;
            let values = fields::read(engine.store(), &step.field, &manifest.grid).await?;
            let own = summing.weighed(values, own).await?;
            for (row, period) in periods.iter().enumerate() {
                if period.overlaps(step.period) {
                    let form = sums[row].add(*period, step.period, &own, errors.days);
                    summing.take(row, form, &mut sums).await?;
                } else if period.end <= step.period.start {
                    sums[row].finish();
                }
            }
        }
        summing.finish(&mut sums).await?;
    }
    Ok(Uncertain {
        basis: basis(errors, words, &sums),
        rows: sums.iter().map(row).collect(),
    })
}

/// Takes sums over pairs, some at a time, off the threads that others wait on.
struct Summing {
    grid: Grid,
    region: Arc<RegionWeights>,
    window: Window,
    at_once: usize,
    /// None where each cell's error is its own.
    pairs: Option<Arc<Pairs>>,
    waiting: Vec<(usize, Spectrum)>,
}

impl Summing {
    fn new(grid: &Grid, scheme: Scheme, region: Arc<RegionWeights>, errors: &BudgetErrors) -> Self {
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
    async fn weighed(&self, values: Vec<f32>, errors: Errors) -> Result<StepErrors, ComputeError> {
        let (grid, window, region) = (self.grid, self.window.clone(), Arc::clone(&self.region));
        blocking(move || weighed(&grid, &window, &region, (&values, &errors))).await
    }

    /// Adds the sum over pairs of a form to a row, now or with others.
    async fn take(
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

    async fn finish(&mut self, sums: &mut [RowSum]) -> Result<(), ComputeError> {
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

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ComputeError> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|e| ComputeError::inconsistent("uncertainty", e))
}

/// Area x standard error of each block: `values` are `[row, col]`, kg m⁻² s⁻¹, NaN without a flux.
fn weighed(
    grid: &Grid,
    window: &Window,
    region: &RegionWeights,
    (values, errors): (&[f32], &Errors),
) -> StepErrors {
    let (rows, cols) = window.size();
    let mut own = StepErrors {
        blocks: vec![0.0; rows * cols],
        ..StepErrors::default()
    };
    let windows = field_chunks(grid);
    for (chunk, areas_m2) in region.chunks() {
        let cells = windows[chunk as usize].cell_indices(grid);
        for (cell, area_m2) in cells.zip(areas_m2).filter(|(_, area)| **area > 0.0) {
            let flux = f64::from(values[cell]);
            if flux.is_nan() {
                continue;
            }
            own.flux_m2 += area_m2;
            let share = area_m2 * errors.of(cell, flux);
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

fn row(sum: &RowSum) -> RowUncertainty {
    let sigma_tg = |variance: f64| variance.max(0.0).sqrt() / KG_PER_TG;
    RowUncertainty {
        sigma_tg: sigma_tg(sum.variance),
        uncorrelated_tg: sigma_tg(sum.squares),
        fully_correlated_tg: sum.sum.abs() / KG_PER_TG,
        error_coverage_percent: if sum.flux > 0.0 {
            100.0 * sum.error / sum.flux
        } else {
            0.0
        },
        monte_carlo: None,
    }
}

fn basis(errors: &BudgetErrors, scheme: String, sums: &[RowSum]) -> BudgetUncertainty {
    BudgetUncertainty {
        error: errors.stated.to_string(),
        manifest: errors.of_product.as_ref().map(|own| own.id()),
        correlation_length_km: errors.length_km,
        correlation_days: errors.days,
        scheme,
        assumptions: assumptions(errors, sums),
        draws: None,
        seed: None,
    }
}

/// What is assumed, for who reads the number.
fn assumptions(errors: &BudgetErrors, sums: &[RowSum]) -> Vec<String> {
    let in_space = if errors.length_km > 0.0 {
        format!(
            "errors of two cells go together as exp(-d / {} km), d along the great circle between their middles on the sphere of \
             6371 km",
            errors.length_km
        )
    } else {
        "the error of each cell is its own".to_owned()
    };
    let in_time = if errors.days > 0.0 {
        format!(
            "those of two steps as exp(-t / {} days), t between their middles",
            errors.days
        )
    } else {
        "the error of each step is its own: no correlation time was given".to_owned()
    };
    let of_what = match &errors.stated {
        StatedError::Relative { .. } => {
            "the error is a share of the flux with its sign, as that of a factor is: where cells share it, sources and sinks grow \
             together"
        }
        StatedError::Absolute { .. } => "the error is the same in every cell with a flux, whatever its flux",
        StatedError::Product(_) => match errors.of_product.as_ref().map(|own| own.steps.len()) {
            Some(1) => "one map of errors holds for all steps",
            _ => "each step has the errors of its own period",
        },
    };
    let mut all = vec![
        in_space,
        in_time,
        of_what.to_owned(),
        "gaps are no part of the budget and add nothing; areas and time have no error; errors have no mean".to_owned(),
    ];
    let (flux, error) = sums.iter().fold((0.0, 0.0), |(flux, error), own| {
        (flux + own.flux, error + own.error)
    });
    if error < flux * (1.0 - 1e-9) {
        all.push(format!(
            "{:.1} % of the area and time with a flux has no error and is taken as exact: sigma is too small",
            100.0 * (1.0 - error / flux)
        ));
    }
    all
}
