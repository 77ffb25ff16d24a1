//! Carbon budgets as people ask for them and as they are answered, the same on the command line and over HTTP.

mod besides;
mod closure;
mod history;
mod river;
mod uncertainty;
mod wishes;

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::earth::Earth;
use crate::manifest::{Manifest, ManifestId, Step};
use crate::product::ProductId;
use crate::quantity::Quantity;
use crate::region::{AskedRegion, Cells, Region};
use crate::time::{Period, TimeMs, TimeStep};

pub use besides::{Besides, BudgetWords};
pub use closure::{Closure, RegionBudget, RegionsClosure};
pub use history::{AsOf, BudgetHistory, VersionBudget};
pub use river::{AskedRiver, RiverFlux, RowRiver, StatedRiver};
pub use uncertainty::{
    BudgetErrors, BudgetUncertainty, ErrorWords, MonteCarlo, RowDraws, RowUncertainty, StatedError,
};
pub use wishes::BudgetWishes;

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
    pub step: TimeStep,
    /// Figure of the earth.
    pub earth: Earth,
    /// How cells on the coast count.
    pub cells: Cells,
    /// A version of a product on the same grid that says how much of every cell is sea or land; Natural Earth if absent.
    pub ocean: Option<Arc<Manifest>>,
    /// Errors of the flux, if the budget's uncertainty is asked for.
    pub errors: Option<BudgetErrors>,
    /// Outgassing of river carbon that is taken off.
    pub river: Option<AskedRiver>,
    /// Parts of the region that are asked for by themselves too, and held against the whole.
    pub parts: Option<BudgetParts>,
}

impl BudgetQuery {
    /// What a row covers where nothing is said.
    pub const USUAL_STEP: TimeStep = TimeStep::Total;

    /// The usual question about a region: one row of all there is.
    pub fn new(product: ProductId, asked: AskedRegion) -> Self {
        Self {
            product,
            region: asked.region,
            region_name: asked.name,
            from: None,
            to: None,
            step: Self::USUAL_STEP,
            earth: Earth::default(),
            cells: Cells::default(),
            ocean: None,
            errors: None,
            river: None,
            parts: None,
        }
    }

    /// The asked period of a version of the product, and its steps that reach into it.
    ///
    /// # Errors
    /// A product that is no carbon, or that has no step in the period.
    pub fn steps<'a>(
        &self,
        manifest: &'a Manifest,
    ) -> Result<(Period, Vec<&'a Step>), ContractError> {
        match manifest.quantity {
            Quantity::CarbonFlux | Quantity::AccumulatedCarbon => {
                manifest.steps_inside(self.from, self.to)
            }
            other => {
                let reason = format!("it is {}", other.without_budget());
                let name = manifest.product.as_str();
                Err(ContractError::invalid("product", name, reason))
            }
        }
    }
}

/// Parts of a region.
#[derive(Debug, Clone, PartialEq)]
pub enum BudgetParts {
    /// Regions with names, of GeoJSON say.
    Regions(Vec<AskedRegion>),
    /// Every code of a mask: a version of a product of one map.
    Mask(Arc<Manifest>),
}

impl BudgetParts {
    /// All that an answer depends on, for keys of answers.
    pub fn key(&self) -> impl Serialize + use<> {
        match self {
            Self::Regions(regions) => {
                let named = regions
                    .iter()
                    .map(|one| (one.name.clone(), one.region.clone()));
                (Some(named.collect::<Vec<_>>()), None)
            }
            Self::Mask(mask) => (None, Some(mask.id())),
        }
    }
}

/// The carbon that a region gave off, with all that is needed to cite it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BudgetAnswer {
    /// Product.
    pub product: ProductId,
    /// The version of the product that was summed.
    #[schema(value_type = String)]
    pub manifest: ManifestId,
    /// Title of the product.
    pub title: String,
    /// Citation of the product.
    pub source: String,
    /// Made up by a program rather than measured.
    pub synthetic: bool,
    /// The region by its name, or as `west,south,east,north`.
    pub region: String,
    /// Figure of the earth for areas.
    pub earth: Earth,
    /// How cells on the coast counted.
    pub cells: Cells,
    /// What says which part of a cell is sea.
    pub ocean_source: String,
    /// Unit of `budget_tg` and `gap_tg`, `Tg C`.
    pub unit: String,
    /// Area of the region, land included, m².
    pub region_area_m2: f64,
    /// Area of the sea in it, m².
    pub ocean_area_m2: f64,
    /// What estimates of gaps are made of.
    pub gap_basis: String,
    /// How the region was taken where that may surprise.
    pub notes: Vec<String>,
    /// How uncertainties were reckoned, if they were asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub uncertainty: Option<BudgetUncertainty>,
    /// The river flux that was taken off, if one was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub river: Option<RiverFlux>,
    /// Rows in the order of time.
    pub rows: Vec<BudgetRow>,
    /// The same of each part of the region that was asked for by itself.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false)]
    pub regions: Vec<RegionBudget>,
    /// Do rows sum to their period, and regions to the whole? None of a single row of one region.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub closure: Option<Closure>,
}

/// The budget of one period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BudgetRow {
    /// First instant.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// Carbon that left the sea, kg, exact, as decimal text; negative where the sea took it up.
    pub budget_kg: String,
    /// The same in Tg (10⁹ kg).
    pub budget_tg: f64,
    /// Share of the region's sea and of the row's time that holds data, percent; 0 where the region holds no sea.
    pub coverage_percent: f64,
    /// Area that counted, mean over the time that steps cover, m²: with whole cells also land on the coast.
    pub area_m2: f64,
    /// Area of the region, land included, m².
    pub region_area_m2: f64,
    /// Area of the sea in it, m².
    pub ocean_area_m2: f64,
    /// Area of the sea in it that holds data, mean over the time that steps cover, m².
    pub ocean_with_data_m2: f64,
    /// What the sea without data would add to the budget at the mean of its band of latitude, Tg: an estimate, never
    /// part of the budget. None where there are gaps and nothing to estimate any of them from.
    #[schema(required)]
    pub gap_tg: Option<f64>,
    /// Area of the sea without data that the estimate stands for, mean over the time that steps cover, m². What is
    /// missing besides has no estimate: bands without any data, sea beyond the grid, time without steps.
    pub gap_area_m2: f64,
    /// How complete the sums of accumulated carbon are; none for fluxes, and in versions that did not count it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub completeness: Option<Completeness>,
    /// How uncertain the budget is, if that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub uncertainty: Option<RowUncertainty>,
    /// The budget less a river flux, if one was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub river: Option<RowRiver>,
}

/// How complete a row of accumulated carbon is: a cell with one month of twelve is not a complete one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Completeness {
    /// Area of the cells that hold data in all of the row's time, m².
    pub complete_m2: f64,
    /// Area of those that hold data in some of it only, m².
    pub incomplete_m2: f64,
}

impl Completeness {
    /// Share of the area with data that holds them in all of the time, percent; none without data.
    pub fn percent(&self) -> Option<f64> {
        let all_m2 = self.complete_m2 + self.incomplete_m2;
        (all_m2 > 0.0).then(|| 100.0 * self.complete_m2 / all_m2)
    }
}
