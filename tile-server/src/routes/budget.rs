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
use utoipa::{IntoParams, ToSchema};

use crate::backend::{BudgetRequest, BudgetRow, BudgetStep};
use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, time};
use crate::openapi::words;
use crate::routes::products::rounded;
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct BudgetQuery {
    /// `global` (the default), a name that `/api/regions` lists, `west,south,east,north` in degrees, GeoJSON or
    /// well-known text.
    region: Option<String>,
    /// First instant, ISO 8601 UTC; the product's own unless one is given.
    from: Option<String>,
    /// First instant after the period; the product's own unless one is given.
    to: Option<String>,
    /// How the period is cut into rows; `month` unless told otherwise.
    #[param(value_type = Option<BudgetStep>)]
    step: Option<String>,
    /// Figure of the earth for areas; `wgs84` unless one is given.
    #[param(value_type = Option<words::Earth>)]
    earth: Option<String>,
    /// How cells on the coast count; `whole` unless told otherwise.
    #[param(value_type = Option<words::Cells>)]
    cells: Option<String>,
    /// Landed product whose cells say how much of them is sea or land, in place of Natural Earth.
    ocean: Option<String>,
    /// Version, as answers name it; the newest unless one is given.
    manifest: Option<String>,
}

/// The carbon that a region gave off.
#[derive(Debug, Serialize, ToSchema)]
struct Budget<'a> {
    /// Name of the product.
    #[schema(value_type = String)]
    product: &'a ProductId,
    /// Version that was read, to be cited.
    #[schema(value_type = String)]
    manifest: &'a ManifestId,
    /// The region by its name, or as `west,south,east,north`.
    region: String,
    /// Figure of the earth for areas.
    #[schema(value_type = words::Earth)]
    earth: Earth,
    /// How cells on the coast counted.
    #[schema(value_type = words::Cells)]
    cells: Cells,
    /// Unit of budgets and gaps, `Tg C`.
    unit: &'static str,
    /// Area of the region, land included, m².
    region_area_m2: f64,
    /// Area of the sea in it, m².
    ocean_area_m2: f64,
    /// What said how much of each cell is sea.
    ocean_source: &'a str,
    /// What estimates of gaps are made of.
    gap_basis: &'a str,
    /// How the region was taken where that may surprise.
    notes: &'a [String],
    /// In the order of time.
    rows: Vec<Row>,
}

/// The budget of one period.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = BudgetRow)]
struct Row {
    /// First instant, ISO 8601 UTC.
    #[schema(value_type = String, format = DateTime)]
    start: TimeMs,
    /// First instant after it.
    #[schema(value_type = String, format = DateTime)]
    end: TimeMs,
    /// Carbon given off by the sea, Tg, positive out of the sea.
    budget: f64,
    /// Share of the region's sea with data, averaged over the period, percent.
    coverage_percent: f64,
    /// Area that counted, averaged over the period, m²: with whole cells also land on the coast.
    area_m2: f64,
    /// Area of the sea with data, averaged over the period, m².
    ocean_with_data_m2: f64,
    /// What the sea without data would add, Tg: an estimate, no part of the budget; none where nothing is known of it.
    #[schema(required)]
    gap: Option<f64>,
    /// Area of the sea without data that the estimate stands for, m².
    gap_area_m2: f64,
    /// Of accumulated carbon: area of cells with data in all of the period, m².
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    complete_m2: Option<f64>,
    /// Of accumulated carbon: area of cells with data in some of the period only, m².
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
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

/// The carbon budget of a region: by month, by year or in all, with its coverage and what gaps would add.
#[utoipa::path(
    get,
    path = "/api/products/{product}/budget",
    operation_id = "budget",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of a carbon flux or of accumulated carbon"), BudgetQuery),
    responses((status = 200, description = "One row for each step of time", body = Budget<'static>)),
)]
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
