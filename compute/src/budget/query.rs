//! A budget as a query: frames joined with a region's weights on the engine, exact sums a step, calendar rows.

use std::collections::BTreeMap;

use contract::earth::Earth;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::region::Region;
use contract::time::{Period, TimeMs};
use datafusion::arrow::array::{AsArray as _, RecordBatch};
use datafusion::arrow::datatypes::{Decimal128Type, TimestampMillisecondType};
use serde::{Deserialize, Serialize};

use super::rows::{BudgetRow, BudgetStep, StepSum, row_periods, rows};
use crate::region::{area, weights};
use crate::{ComputeError, Engine, catalog, scan};

/// What a budget is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct BudgetQuery {
    /// Product with a carbon flux.
    pub product: ProductId,
    /// Region.
    pub region: Region,
    /// What the answer calls the region.
    pub region_name: String,
    /// First instant; the product's first if absent.
    pub from: Option<TimeMs>,
    /// First instant after the asked period; the product's end if absent.
    pub to: Option<TimeMs>,
    /// What a row covers.
    pub step: BudgetStep,
    /// Figure of the earth.
    pub earth: Earth,
}

/// A budget with all that is needed to cite it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BudgetAnswer {
    /// Product.
    pub product: ProductId,
    /// The version of the product that was summed.
    pub manifest: ManifestId,
    /// Title of the product.
    pub title: String,
    /// Citation of the product.
    pub source: String,
    /// Made up by a program rather than measured.
    pub synthetic: bool,
    /// Name of the region.
    pub region: String,
    /// Figure of the earth.
    pub earth: Earth,
    /// Unit of `budget_tg`.
    pub unit: String,
    /// Rows in the order of time.
    pub rows: Vec<BudgetRow>,
}

/// One row a step: the seconds are those of the whole step; parts of steps are shared out afterwards, exactly.
const STEP_SUMS: &str = "
    SELECT period_start,
           period_end,
           SUM(cell_mass(\"values\", area_m2, (CAST(period_end AS BIGINT) - CAST(period_start AS BIGINT)) / 1000.0)) AS mass,
           SUM(valid_area(\"values\", area_m2)) AS area
    FROM frames JOIN weights ON frames.chunk = weights.chunk
    GROUP BY period_start, period_end";

/// Computes a budget.
pub async fn budget(engine: &Engine, query: &BudgetQuery) -> Result<BudgetAnswer, ComputeError> {
    let manifest = catalog::product(engine.store(), &query.product).await?;
    budget_of(engine, query, &manifest).await
}

/// Computes a budget of one version of a product.
pub async fn budget_of(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
) -> Result<BudgetAnswer, ComputeError> {
    if manifest.quantity != Quantity::CarbonFlux {
        return Err(ComputeError::NotAFlux {
            product: manifest.product.clone(),
            quantity: manifest.quantity,
        });
    }
    let (window, keys) = steps_inside(manifest, query.from, query.to)?;
    let region_area_m2 = area::region_area_m2(&query.region, query.earth)?;
    let weights =
        weights::stored(engine.store(), &manifest.grid, &query.region, query.earth).await?;
    let Some(weights) = weights else {
        let (product, bounds) = (manifest.product.clone(), catalog::bounds_text(manifest));
        return Err(ComputeError::RegionOutside { product, bounds });
    };
    let sums = step_sums(engine, &keys, &weights).await?;
    let rows = rows(&row_periods(window, query.step)?, &sums, region_area_m2).ok_or_else(|| {
        ComputeError::inconsistent(manifest.id().to_string(), "its sums exceed 128 bits")
    })?;
    Ok(BudgetAnswer {
        product: manifest.product.clone(),
        manifest: manifest.id(),
        title: manifest.title.clone(),
        source: manifest.source.clone(),
        synthetic: manifest.synthetic,
        region: query.region_name.clone(),
        earth: query.earth,
        unit: "Tg C".to_owned(),
        rows,
    })
}

/// The asked period and the frames of the steps that reach into it.
fn steps_inside(
    manifest: &Manifest,
    from: Option<TimeMs>,
    to: Option<TimeMs>,
) -> Result<(Period, Vec<&ObjectKey>), ComputeError> {
    let covered = manifest.extent();
    let none = |asked: String| ComputeError::NoStep {
        product: manifest.product.clone(),
        asked,
        covered,
    };
    let Some(extent) = covered else {
        return Err(none("any period".to_owned()));
    };
    let (start, end) = (from.unwrap_or(extent.start), to.unwrap_or(extent.end));
    let window = match Period::new(start, end) {
        Ok(window) => window,
        // A start or end that the asker left out may fall on the wrong side of the one given.
        Err(_) if from.is_none() || to.is_none() => return Err(none(format!("{start}/{end}"))),
        Err(e) => return Err(e.into()),
    };
    let inside = manifest
        .steps
        .iter()
        .filter(|step| step.period.overlaps(window));
    let keys: Vec<_> = inside.map(|step| &step.frame).collect();
    if keys.is_empty() {
        Err(none(window.to_string()))
    } else {
        Ok((window, keys))
    }
}

/// Exact sums of every step, in the order of time.
async fn step_sums(
    engine: &Engine,
    frames: &[&ObjectKey],
    weights: &ObjectKey,
) -> Result<Vec<StepSum>, ComputeError> {
    let context = engine.context().await?;
    scan::register(
        &context,
        "frames",
        engine.store(),
        frames,
        &storage::frames::SCHEMA,
    )?;
    scan::register(
        &context,
        "weights",
        engine.store(),
        &[weights],
        &storage::weights::SCHEMA,
    )?;
    let failed = || ComputeError::engine("summing a budget");
    let batches = context
        .sql(STEP_SUMS)
        .await
        .map_err(failed())?
        .collect()
        .await
        .map_err(failed())?;
    let mut sums = BTreeMap::new();
    for batch in &batches {
        for sum in sums_of(batch)? {
            sums.insert(sum.period.start, sum);
        }
    }
    if sums.len() != frames.len() {
        let reason = format!(
            "the engine answered for {} steps of {}",
            sums.len(),
            frames.len()
        );
        return Err(ComputeError::inconsistent("budget", reason));
    }
    Ok(sums.into_values().collect())
}

fn sums_of(batch: &RecordBatch) -> Result<Vec<StepSum>, ComputeError> {
    let time = |column: usize| {
        batch
            .column(column)
            .as_primitive::<TimestampMillisecondType>()
    };
    let decimal = |column: usize| batch.column(column).as_primitive::<Decimal128Type>();
    let (starts, ends, masses, areas) = (time(0), time(1), decimal(2), decimal(3));
    (0..batch.num_rows())
        .map(|row| {
            let period = Period::new(
                TimeMs::new(starts.value(row))?,
                TimeMs::new(ends.value(row))?,
            )?;
            Ok(StepSum {
                period,
                mass_steps: masses.value(row),
                area_steps: areas.value(row),
            })
        })
        .collect()
}
