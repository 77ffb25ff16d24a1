//! How uncertain the rows of a budget are: standard errors of the flux, propagated with what cells and steps have in common.
//!
//! variance = the sum over every two cells and every two steps of `w w' exp(-d / length) exp(-t / days)`, where w is area x time x
//! standard error. Nothing is left out (docs/decisions/030).

mod drawing;
mod draws;
mod errors;
mod in_time;
mod pairs;
mod philox;
mod plane;
mod scheme;
mod summing;
mod transform;

use std::pin::pin;
use std::sync::Arc;

use contract::budget::{
    BudgetErrors, BudgetQuery, BudgetRow, BudgetUncertainty, RowUncertainty, StatedError,
};
use contract::chunk;
use contract::grid::Grid;
use contract::manifest::{Manifest, Step};
use contract::region::Cells;
use contract::time::Period;
use cube::Values;
use futures::TryStreamExt as _;

use self::drawing::Drawing;
use self::errors::Source;
use self::in_time::RowSum;
use self::plane::Window;
use self::scheme::Scheme;
use self::summing::Summing;
use super::over_region::{AskedArea, weights};
use super::rows::KG_PER_TG;
use crate::region::loaded::{RegionWeights, weights_failed};
use crate::step_range::step_range;
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
    rows: &[BudgetRow],
) -> Result<Uncertain, ComputeError> {
    let (manifest, steps) = flux;
    let mut source = Source::of(errors, manifest)?;
    let region = region(engine, query, manifest).await?;
    let Some(window) = Window::of(&manifest.grid, &region) else {
        let sums = vec![RowSum::default(); rows.len()];
        let scheme = "nothing: no sea lies in the region".to_owned();
        return Ok(Uncertain {
            basis: basis(errors, scheme, &sums),
            rows: sums.iter().map(row).collect(),
        });
    };
    let mut sums = vec![RowSum::default(); rows.len()];
    let periods: Vec<Period> = rows.iter().map(period).collect();
    let overlaps = |step: &Step| {
        periods
            .iter()
            .filter(|row| row.overlaps(step.period))
            .count()
    };
    let form_count = steps.iter().map(|step| overlaps(step)).sum();
    let scheme = Scheme::of(&manifest.grid, &window, errors.length_km, form_count)?;
    let mut drawing = Drawing::new(&manifest.grid, &window, &region, errors, steps.len())?;
    let words = scheme.words.clone();
    let mut summing = Summing::new(&manifest.grid, scheme, region, errors);
    let chunks = chunks_of(&manifest.grid, &summing.region);
    let values = Values::of(engine.store(), &Arc::new(manifest.clone())).await?;
    let mut read = pin!(values.each(step_range(manifest, steps)?, &chunks));
    for step in steps {
        let own = source.read(engine.store(), &chunks, step.period).await?;
        let values = read.try_next().await?;
        let values = values
            .ok_or_else(|| ComputeError::inconsistent(step.field.as_str(), "it was not read"))?;
        let values = Arc::new(values);
        let weighed = summing.weighed(&values, &own).await?;
        for (row, period) in periods.iter().enumerate() {
            if period.overlaps(step.period) {
                let form = sums[row].add(*period, step.period, &weighed, errors.days);
                summing.take(row, form, &mut sums).await?;
            } else if period.end <= step.period.start {
                sums[row].finish();
            }
        }
        if let Some(drawing) = &mut drawing {
            drawing.take(step, rows, (&values, &own)).await?;
        }
    }
    summing.finish(&mut sums).await?;
    let mut uncertain: Vec<RowUncertainty> = sums.iter().map(row).collect();
    if let Some(drawing) = drawing {
        let drawn = drawing.run(rows).await?;
        for (own, drawn) in uncertain.iter_mut().zip(drawn) {
            own.monte_carlo = Some(drawn);
        }
    }
    Ok(Uncertain {
        basis: basis(errors, words, &sums),
        rows: uncertain,
    })
}

/// The chunks that a region touches, in its order: all of a step that is read.
fn chunks_of(grid: &Grid, region: &RegionWeights) -> Vec<chunk::Window> {
    let all = chunk::field_chunks(grid);
    let touched = region.chunks().map(|(number, _)| all[number as usize]);
    touched.collect()
}

/// Areas of what counts of the region.
async fn region(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
) -> Result<Arc<RegionWeights>, ComputeError> {
    let address = weights(engine, manifest, AskedArea::of(query)).await?;
    let address = match query.cells {
        Cells::Whole => address.all,
        Cells::OceanShare => address.ocean,
    };
    let region = engine.objects().weights(&address).await;
    region.map_err(weights_failed)
}

fn period(row: &BudgetRow) -> Period {
    Period {
        start: row.start,
        end: row.end,
    }
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
        draws: errors.monte_carlo.map(|own| own.draws),
        seed: errors.monte_carlo.map(|own| own.seed),
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
        StatedError::Absolute { .. } => {
            "the error is the same in every cell with a flux, whatever its flux"
        }
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
    if errors.monte_carlo.is_some() {
        all.push("drawn errors are normal".to_owned());
    }
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
