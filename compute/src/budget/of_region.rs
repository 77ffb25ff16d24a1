//! The budget of one region: its weights, exact sums of every step, calendar rows with how uncertain they are.

use contract::budget::{BudgetAnswer, BudgetQuery, BudgetRow};
use contract::manifest::{Manifest, Step};
use contract::quantity::Quantity;
use contract::time::{Period, TimeStep};
use storage::manifests;

use super::accumulated;
use super::closure::of_time;
use super::gaps::BASIS;
use super::measure::Measure;
use super::over_region::{AskedArea, over_region};
use super::rows::{RegionAreas, rows};
use super::uncertainty;
use crate::derive::accumulated_from;
use crate::summed::check_summed;
use crate::{ComputeError, Engine};

/// The budget of one region, without what is held against it.
pub(super) async fn of_region(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
) -> Result<BudgetAnswer, ComputeError> {
    let (window, steps) = query.steps(manifest)?;
    if manifest.quantity != Quantity::AccumulatedCarbon {
        return of_flux(engine, query, manifest, (window, &steps)).await;
    }
    let (Some(source), Some(extent)) = (accumulated_from(manifest), manifest.extent()) else {
        return Err(ComputeError::NotAFlux {
            product: manifest.product.clone(),
            quantity: manifest.quantity,
        });
    };
    let source = manifests::load(engine.store(), source).await?;
    let since = Some(window.start.max(extent.start));
    let (window, steps) = source.steps_inside(since, Some(window.end))?;
    let answer = of_flux(engine, query, &source, (window, &steps)).await?;
    accumulated::completed(engine, query, manifest, answer).await
}

async fn of_flux(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
    (window, steps): (Period, &[&Step]),
) -> Result<BudgetAnswer, ComputeError> {
    check_summed(engine.store(), manifest).await?;
    let over = over_region(engine, manifest, steps, AskedArea::of(query), Measure::Mass).await?;
    let (sums, extent) = (over.sums, over.extent);
    let asked = RegionAreas {
        region_area_m2: extent.area_m2,
        ocean_area_m2: extent.ocean_m2,
        sea_steps: sums.sea_steps,
        cells: query.cells,
    };
    let too_large =
        || ComputeError::inconsistent(manifest.id().to_string(), "its sums exceed 128 bits");
    let rows_of = |periods: &[Period]| rows(periods, &sums.steps, &asked).ok_or_else(too_large);
    let periods = query
        .step
        .bins(window, steps.iter().map(|step| step.period))?;
    let mut rows = rows_of(&periods)?;
    let mut notes = extent.notes;
    notes.extend(without_rows(&periods, &rows));
    let closure = match query.step {
        TimeStep::Total => None,
        _ => Some(of_time(&rows, &rows_of(&[window])?).ok_or_else(too_large)?),
    };
    let mut basis = None;
    if let Some(errors) = &query.errors {
        let flux = (manifest, steps);
        let uncertain = uncertainty::of_rows(engine, query, errors, flux, &rows);
        let uncertain = Box::pin(uncertain).await?;
        for (row, own) in rows.iter_mut().zip(uncertain.rows) {
            row.uncertainty = Some(own);
        }
        basis = Some(uncertain.basis);
    }
    Ok(BudgetAnswer {
        product: manifest.product.clone(),
        manifest: manifest.id(),
        title: manifest.title.clone(),
        source: manifest.source.clone(),
        synthetic: manifest.synthetic,
        region: query.region_name.clone(),
        earth: query.earth,
        cells: query.cells,
        ocean_source: over.ocean_source,
        unit: "Tg C".to_owned(),
        region_area_m2: extent.area_m2,
        ocean_area_m2: extent.ocean_m2,
        gap_basis: BASIS.to_owned(),
        notes,
        uncertainty: basis,
        river: None,
        rows,
        regions: vec![],
        closure,
    })
}

/// What is to be said of periods that no step reaches into.
fn without_rows(periods: &[Period], rows: &[BudgetRow]) -> Option<String> {
    let mut with_rows = rows.iter().map(|row| row.start).peekable();
    let is_without = |period: &&Period| with_rows.next_if_eq(&period.start).is_none();
    let without: Vec<&Period> = periods.iter().filter(is_without).collect();
    let first = without.first()?;
    Some(format!(
        "no step of the product reaches into {} of the {} periods, the first of them {first}: they have no row, and nothing of them is in a sum of rows",
        without.len(),
        periods.len()
    ))
}
