//! `/api/products/{product}/budget`: the carbon a region gave off, by month, by year or in all.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::earth::Earth;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::region::{Cells, NamedRegion, Region};
use contract::time::{Period, TimeMs};
use serde::{Deserialize, Serialize};

use crate::backend::{BudgetRequest, BudgetRow};
use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, time};
use crate::routes::products::rounded;
use crate::state::AppState;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BudgetQuery {
    region: Option<String>,
    from: Option<String>,
    to: Option<String>,
    step: Option<String>,
    earth: Option<String>,
    cells: Option<String>,
    ocean: Option<String>,
    manifest: Option<String>,
}

#[derive(Debug, Serialize)]
struct Budget<'a> {
    product: &'a ProductId,
    manifest: &'a ManifestId,
    region: String,
    earth: Earth,
    cells: Cells,
    unit: &'static str,
    region_area_m2: f64,
    ocean_area_m2: f64,
    ocean_source: &'a str,
    gap_basis: &'a str,
    notes: &'a [String],
    rows: Vec<Row>,
}

#[derive(Debug, Serialize)]
struct Row {
    start: TimeMs,
    end: TimeMs,
    budget: f64,
    coverage_percent: f64,
    area_m2: f64,
    ocean_with_data_m2: f64,
    gap: Option<f64>,
    gap_area_m2: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    complete_m2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    incomplete_m2: Option<f64>,
}

impl From<&BudgetRow> for Row {
    fn from(row: &BudgetRow) -> Self {
        let Period { start, end } = row.period;
        let BudgetRow {
            budget_tg,
            coverage_percent,
            area_m2,
            ocean_with_data_m2,
            gap_tg,
            gap_area_m2,
            complete_and_incomplete_m2,
            ..
        } = *row;
        Self {
            start,
            end,
            budget: budget_tg,
            coverage_percent,
            area_m2,
            ocean_with_data_m2,
            gap: gap_tg,
            gap_area_m2,
            complete_m2: complete_and_incomplete_m2.map(|[complete, _]| complete),
            incomplete_m2: complete_and_incomplete_m2.map(|[_, incomplete]| incomplete),
        }
    }
}

pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(query): UrlQuery<BudgetQuery>,
) -> Result<Response, ServerError> {
    let named = query.manifest.as_deref();
    let layer = state.catalogue.version(&product, named).await?;
    let manifest = &layer.manifest;
    if !matches!(
        manifest.quantity,
        Quantity::CarbonFlux | Quantity::AccumulatedCarbon
    ) {
        let quantity = manifest.quantity.title();
        return Err(ServerError::NotAFlux {
            product: manifest.product.to_string(),
            quantity,
        });
    }
    let region = query.region.as_deref().unwrap_or("global");
    let request = BudgetRequest {
        manifest: Arc::clone(manifest),
        region: region.parse()?,
        period: period(
            &layer,
            time(query.from.as_deref())?,
            time(query.to.as_deref())?,
        )?,
        step: query.step.as_deref().unwrap_or("month").parse()?,
        earth: query
            .earth
            .as_deref()
            .map_or(Ok(Earth::default()), str::parse)?,
        cells: query
            .cells
            .as_deref()
            .map_or(Ok(Cells::default()), str::parse)?,
        ocean: ocean(&state, query.ocean.as_deref()).await?,
    };
    let (region, earth) = (region_name(region, &request.region), request.earth);
    let cells = request.cells;
    let sums = state.analyses.budget(&layer, request).await?;
    let answer = Budget {
        product: &manifest.product,
        manifest: &layer.id,
        region,
        earth,
        cells,
        unit: "Tg C",
        region_area_m2: sums.region_area_m2,
        ocean_area_m2: sums.ocean_area_m2,
        ocean_source: &sums.ocean_source,
        gap_basis: &sums.gap_basis,
        notes: &sums.notes,
        rows: sums.rows.iter().map(Row::from).collect(),
    };
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(answer)).into_response())
}

/// The newest version of the product that says what is sea.
pub(crate) async fn ocean(
    state: &AppState,
    product: Option<&str>,
) -> Result<Option<Arc<Manifest>>, ServerError> {
    let Some(product) = product else {
        return Ok(None);
    };
    let layer = state.catalogue.version(product, None).await?;
    Ok(Some(Arc::clone(&layer.manifest)))
}

/// The part of `[from, to)` that the product covers; all it covers if nothing is said.
pub(crate) fn period(
    layer: &Layer,
    from: Option<TimeMs>,
    to: Option<TimeMs>,
) -> Result<Period, ServerError> {
    let extent = layer.extent;
    let outside = || ServerError::OutsidePeriod {
        product: layer.manifest.product.to_string(),
        covers: format!("{} to {}", extent.start, extent.end),
    };
    // With one end left open the other may lie beyond all there is: that is an empty answer, not a backward period.
    if (to.is_none() && from.is_some_and(|t| t >= extent.end))
        || (from.is_none() && to.is_some_and(|t| t <= extent.start))
    {
        return Err(outside());
    }
    let asked = Period::new(from.unwrap_or(extent.start), to.unwrap_or(extent.end))?;
    if !asked.overlaps(extent) {
        return Err(outside());
    }
    Ok(Period {
        start: asked.start.max(extent.start),
        end: asked.end.min(extent.end),
    })
}

/// A region as the answer names it: by its name, or as `west,south,east,north`.
pub(crate) fn region_name(asked: &str, region: &Region) -> String {
    let &Region::Box {
        west,
        south,
        east,
        north,
    } = region
    else {
        return asked.to_owned();
    };
    if NamedRegion::find(asked).is_some() {
        return asked.to_owned();
    }
    [west, south, east, north]
        .map(|edge| rounded(edge).to_string())
        .join(",")
}
