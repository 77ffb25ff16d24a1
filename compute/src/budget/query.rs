//! A budget: a region's weights, exact sums of every step, calendar rows.

use std::sync::Arc;

use contract::earth::Earth;
use contract::manifest::{Manifest, ManifestId, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::region::{Cells, Region};
use contract::time::{Period, TimeMs};
use serde::{Deserialize, Serialize};

use super::accumulated;
use super::gaps::BASIS;
use super::over_region::{AskedArea, over_region};
use super::rows::{Asked, BudgetRow, BudgetStep, row_periods, rows};
use super::sums::Measure;
use crate::{ComputeError, Engine, catalogue};

/// What a budget is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct BudgetQuery {
    /// Product with a carbon flux, or one of accumulated carbon.
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
    /// How cells on the coast count.
    pub cells: Cells,
    /// A version of a product on the same grid that says how much of every cell is sea or land; Natural Earth if absent.
    pub ocean: Option<Arc<Manifest>>,
}

impl BudgetQuery {
    pub(super) fn area(&self) -> AskedArea<'_> {
        AskedArea {
            region: &self.region,
            earth: self.earth,
            ocean: self.ocean.as_deref(),
        }
    }
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
    /// How cells on the coast count.
    pub cells: Cells,
    /// What says which part of a cell is sea.
    #[serde(default)]
    pub ocean_source: String,
    /// Unit of `budget_tg` and `gap_tg`.
    pub unit: String,
    /// Area of the region, land included, m².
    pub region_area_m2: f64,
    /// Area of the sea in it, m².
    pub ocean_area_m2: f64,
    /// What estimates of gaps are made of.
    pub gap_basis: String,
    /// How the region was taken where that may surprise.
    pub notes: Vec<String>,
    /// Rows in the order of time.
    pub rows: Vec<BudgetRow>,
}

/// Computes a budget.
pub async fn budget(engine: &Engine, query: &BudgetQuery) -> Result<BudgetAnswer, ComputeError> {
    let manifest = catalogue::product(engine.store(), &query.product).await?;
    budget_of(engine, query, &manifest).await
}

/// Computes a budget of one version of a product.
pub async fn budget_of(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
) -> Result<BudgetAnswer, ComputeError> {
    if manifest.quantity == Quantity::AccumulatedCarbon {
        return accumulated::budget_of(engine, query, manifest).await;
    }
    if manifest.quantity != Quantity::CarbonFlux {
        return Err(ComputeError::NotAFlux {
            product: manifest.product.clone(),
            quantity: manifest.quantity,
        });
    }
    let (window, steps) = steps_inside(manifest, query.from, query.to)?;
    let over = over_region(engine, manifest, &steps, query.area(), Measure::Mass).await?;
    let (sums, extent) = (over.sums, over.extent);
    let asked = Asked {
        region_area_m2: extent.area_m2,
        ocean_area_m2: extent.ocean_m2,
        sea_steps: sums.sea_steps,
        cells: query.cells,
    };
    let rows = rows(&row_periods(window, query.step)?, &sums.steps, &asked).ok_or_else(|| {
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
        cells: query.cells,
        ocean_source: over.ocean_source,
        unit: "Tg C".to_owned(),
        region_area_m2: extent.area_m2,
        ocean_area_m2: extent.ocean_m2,
        gap_basis: BASIS.to_owned(),
        notes: extent.notes,
        rows,
    })
}

/// The asked period and the steps that reach into it.
pub(crate) fn steps_inside(
    manifest: &Manifest,
    from: Option<TimeMs>,
    to: Option<TimeMs>,
) -> Result<(Period, Vec<&Step>), ComputeError> {
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
    let steps: Vec<_> = inside.collect();
    if steps.is_empty() {
        Err(none(window.to_string()))
    } else {
        Ok((window, steps))
    }
}
