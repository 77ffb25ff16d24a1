//! Sums over a region and what they are set against: its area, its sea, and who says what is sea.

use contract::budget::BudgetQuery;
use contract::digest::Digest;
use contract::earth::Earth;
use contract::manifest::{Manifest, Step};
use contract::region::Region;

use super::fixed::AREA_DECIMALS;
use super::measure::Measure;
use super::sums::{self, RegionSums};
use crate::awaited::Awaited;
use crate::region::address::RegionAddress;
use crate::region::extent::{Extent, extent_while, outline};
use crate::region::shares::{self, Shares};
use crate::region::weights::{OnGrid, Surface};
use crate::{ComputeError, Engine};

/// Share of a region that a grid must lack before a reader is told.
const OUTSIDE_SHARE: f64 = 1e-6;
/// Square metres in a million square kilometres.
const M2_PER_MILLION_KM2: f64 = 1e12;

/// A region as it is asked for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AskedArea<'a> {
    pub(crate) region: &'a Region,
    pub(crate) earth: Earth,
    /// A version of a product that says shares of sea or land; Natural Earth if none.
    pub(crate) ocean: Option<&'a Manifest>,
}

impl<'a> AskedArea<'a> {
    /// That of a budget.
    pub(crate) fn of(query: &'a BudgetQuery) -> Self {
        Self {
            region: &query.region,
            earth: query.earth,
            ocean: query.ocean.as_deref(),
        }
    }
}

/// Sums of steps over a region.
#[derive(Debug)]
pub(crate) struct OverRegion {
    pub(crate) sums: RegionSums,
    pub(crate) extent: Extent,
    /// What says which part of a cell is sea.
    pub(crate) ocean_source: String,
}

/// The weights of an area on a product's grid.
///
/// # Errors
/// `RegionOutside` where they have nothing in common, `OceanShares` for a product that cannot say what is sea.
pub(crate) async fn weights(
    engine: &Engine,
    manifest: &Manifest,
    asked: AskedArea<'_>,
) -> Result<RegionAddress, ComputeError> {
    let surface = match asked.ocean {
        Some(ocean) => Surface::Shares(Shares::of(ocean, manifest)?),
        None => Surface::Ocean,
    };
    let on_grid = OnGrid {
        grid: &manifest.grid,
        region: asked.region,
        earth: asked.earth,
        ocean: &surface,
    };
    let found = RegionAddress::of(engine, on_grid).await?;
    found.ok_or_else(|| ComputeError::RegionOutside {
        product: manifest.product.clone(),
        bounds: manifest.bounds_text(),
    })
}

/// The extent of an area; without its sea where a product says what is sea.
pub(crate) async fn extent_of(
    engine: &Engine,
    asked: AskedArea<'_>,
) -> Result<Extent, ComputeError> {
    let has_shares = asked.ocean.is_some();
    let (region, earth) = (asked.region.clone(), asked.earth);
    let name = Digest::of_json(&(&region, earth, has_shares));
    // Overlaid with all land, which takes a while.
    let measure = move |awaited: &Awaited| {
        if has_shares {
            outline(&region, earth, awaited)
        } else {
            extent_while(&region, earth, awaited)
        }
    };
    engine.objects().extent(&name, measure).await
}

/// What is to be said of a region of which a part lies beside the grid.
pub(crate) fn beside_grid(area_m2: f64, on_grid_m2: f64) -> Option<String> {
    (on_grid_m2 < area_m2 * (1.0 - OUTSIDE_SHARE)).then(|| {
        format!(
            "of the region's {:.6} million km² {:.6} lie on the grid",
            area_m2 / M2_PER_MILLION_KM2,
            on_grid_m2 / M2_PER_MILLION_KM2
        )
    })
}

/// The extent with the sea that a product says lies on its grid.
pub(crate) fn with_shares(mut extent: Extent, on_grid_m2: f64, sea_m2: f64) -> Extent {
    if let Some(beside) = beside_grid(extent.area_m2, on_grid_m2) {
        extent.notes.push(format!(
            "{beside}, and nobody says how much of the rest is sea: it is left out of the sea asked for"
        ));
    }
    extent.with_ocean(sea_m2)
}

/// The sums of some steps of a product over an area.
pub(crate) async fn over_region(
    engine: &Engine,
    manifest: &Manifest,
    steps: &[&Step],
    asked: AskedArea<'_>,
    measure: Measure,
) -> Result<OverRegion, ComputeError> {
    let mut extent = extent_of(engine, asked).await?;
    let weights = weights(engine, manifest, asked).await?;
    let sums = sums::of_steps(engine, manifest, steps, &weights, measure).await?;
    if asked.ocean.is_some() {
        let sea_steps: i128 = sums.sea_steps.iter().sum();
        let sea_m2 = sea_steps as f64 / 10f64.powi(AREA_DECIMALS as i32);
        extent = with_shares(extent, sums.on_grid_m2, sea_m2);
    }
    Ok(OverRegion {
        sums,
        extent,
        ocean_source: shares::source(asked.ocean),
    })
}
