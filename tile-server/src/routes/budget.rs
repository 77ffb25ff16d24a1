//! `/api/products/{product}/budget`: the carbon a region gave off, by month, by year or in all; `/history` below it: the same by
//! the versions of the product.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::budget::{
    AsOf, Besides, BudgetAnswer, BudgetHistory, BudgetQuery, BudgetWishes, BudgetWords, ErrorWords,
};
use contract::earth::Earth;
use contract::geometry_text;
use contract::manifest::Manifest;
use contract::region::{AskedRegion, Cells};
use contract::rows::RowsForm;
use contract::time::TimeStep;
use serde::Deserialize;
use utoipa::IntoParams;

use super::statistics::{form, response};
use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, left_out, number, parsed, time, whole_number};
use crate::masks;
use crate::openapi::words::GeoJson;
use crate::rooms::Room;
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct BudgetParameters {
    /// `global` (the default), a name that `/api/regions` lists, `west,south,east,north` in degrees, GeoJSON or well-known text, or
    /// `MASK:CODE`: the cells where a landed mask has a code, or what it means, such as `basins:5` or `basins:southern`.
    region: Option<String>,
    /// First instant, ISO 8601 UTC; the product's own unless one is given.
    from: Option<String>,
    /// First instant after the period; the product's own unless one is given.
    to: Option<String>,
    /// What a row covers; `total` unless told otherwise.
    #[param(value_type = Option<TimeStep>)]
    step: Option<String>,
    /// Figure of the earth for areas; `wgs84` unless one is given.
    #[param(value_type = Option<Earth>)]
    earth: Option<String>,
    /// How cells on the coast count; `whole` unless told otherwise.
    #[param(value_type = Option<Cells>)]
    cells: Option<String>,
    /// Landed product whose cells say how much of them is sea or land, in place of Natural Earth.
    ocean: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
    /// The newest version that was published at an instant (ISO 8601 UTC; a day is its first moment), or one by its name. In place
    /// of `manifest`.
    as_of: Option<String>,
    /// Standard error of the flux: `20%`, a number with its unit such as `0.3 mol m-2 year-1`, or a product of standard errors on
    /// the same grid. With it rows say how uncertain they are.
    error: Option<String>,
    /// How far errors of cells go together, km: exp(-d / length). 0 where the error of each cell is its own.
    #[param(value_type = Option<f64>, minimum = 0)]
    correlation_length_km: Option<String>,
    /// How long errors of steps go together, days: exp(-t / days). 0, the error of each step is its own, unless given.
    #[param(value_type = Option<f64>, minimum = 0)]
    correlation_days: Option<String>,
    /// Draws of a Monte Carlo, 10 to 10000: a check, and an interval that holds 95 % of the budgets. Not of a history.
    #[param(value_type = Option<u32>, minimum = 10, maximum = 10000)]
    monte_carlo: Option<String>,
    /// The same seed draws the same errors; 0 unless given.
    #[param(value_type = Option<u64>)]
    seed: Option<String>,
    /// Outgassing of river carbon that is taken off, Tg of carbon a year out of the sea, with its standard error if there is one
    /// (`650` or `650±300`), or a product that is summed over the same region. Not of a history.
    river_flux: Option<String>,
    /// Where the number is from; needed with it.
    river_source: Option<String>,
    /// Parts of the region that are asked for by themselves too, and held against the whole: a GeoJSON `FeatureCollection` whose
    /// features have names, or a product that is a mask, of which each code is a part.
    regions: Option<String>,
    /// Form of the answer: `json`, or its rows alone as `csv` or `arrow`, a file of Arrow; by the header `Accept` unless one is given.
    #[param(value_type = Option<RowsForm>)]
    format: Option<String>,
}

/// Where, and what is asked besides. The cells of a mask are still to be looked up.
struct Read {
    region: Option<AskedRegion>,
    besides: Besides,
}

impl BudgetParameters {
    /// What it is about, read from texts.
    fn read(&self) -> Result<Read, ServerError> {
        Ok(Read {
            region: parsed(self.written_region())?,
            besides: self.words()?.asked()?,
        })
    }

    /// A region that is written out, and no cells of a mask.
    fn written_region(&self) -> Option<&str> {
        let region = self.region.as_deref();
        region.filter(|text| masks::of_mask(text).is_none())
    }

    /// The question about a version, and the room that its region takes, to be kept as long as it is asked.
    async fn query(
        &self,
        state: &AppState,
        layer: &Layer,
        Read { region, besides }: Read,
    ) -> Result<(BudgetQuery, Option<Room>), ServerError> {
        let (region, room) = match region {
            Some(region) => (Some(region), None),
            None => masks::some_region(state, self.region.as_deref()).await?,
        };
        let wishes = BudgetWishes {
            region,
            from: time(self.from.as_deref())?,
            to: time(self.to.as_deref())?,
            step: parsed(self.step.as_deref())?,
            earth: parsed(self.earth.as_deref())?,
            cells: parsed(self.cells.as_deref())?,
            ocean: ocean(state, self.ocean.as_deref()).await?,
        };
        let query = wishes.query(layer.manifest.product.clone());
        let mut versions = BTreeMap::new();
        for product in besides.products() {
            let layer = state.catalogue.version(product.as_str(), None).await?;
            versions.insert(product, Arc::clone(&layer.manifest));
        }
        Ok((besides.of(query, &versions)?, room))
    }

    /// The same with the region, or the parts, of a body, what is read of all, and the room that it takes.
    async fn sent(
        mut self,
        state: &AppState,
        headers: &HeaderMap,
        body: Body,
    ) -> Result<((Self, Read), Room), ServerError> {
        let sent = state.bodies.take(headers, body).await?;
        let read = move |text: String| {
            let is_collection = geometry_text::is_collection(&text);
            let (name, own) = if is_collection {
                ("regions", &mut self.regions)
            } else {
                ("region", &mut self.region)
            };
            left_out(&[(name, own.is_some())])?;
            *own = Some(text);
            let read = self.read()?;
            // What it says is read.
            if is_collection {
                self.regions = None;
            } else {
                self.region = None;
            }
            Ok((self, read))
        };
        sent.read(read).await
    }

    fn words(&self) -> Result<BudgetWords<'_>, ServerError> {
        let optional =
            |what, text: Option<&str>, unit| text.map(|text| number(what, text, unit)).transpose();
        let length = self.correlation_length_km.as_deref();
        let days = self.correlation_days.as_deref();
        let draws = self.monte_carlo.as_deref();
        Ok(BudgetWords {
            errors: ErrorWords {
                error: self.error.as_deref(),
                correlation_length_km: optional("correlation_length_km", length, "km")?,
                correlation_days: optional("correlation_days", days, "days")?,
                monte_carlo: draws
                    .map(|text| whole_number("monte_carlo", text, DRAWS))
                    .transpose()?,
                seed: seed(self.seed.as_deref())?,
            },
            river_flux: self.river_flux.as_deref(),
            river_source: self.river_source.as_deref(),
            regions: self.regions.as_deref(),
        })
    }
}

const DRAWS: &str = "a number of draws, 10 to 10000";

fn seed(text: Option<&str>) -> Result<Option<u64>, ServerError> {
    let read = |text: &str| {
        let digits = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        let number = if digits { text.parse().ok() } else { None };
        number.ok_or_else(|| ServerError::invalid("seed", text, "a whole number below 2^64"))
    };
    text.map(read).transpose()
}

/// The carbon budget of a region: by month, by year or in all, with its coverage and what gaps would add.
#[utoipa::path(
    get,
    path = "/api/products/{product}/budget",
    operation_id = "budget",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of a carbon flux or of accumulated carbon"), BudgetParameters),
    responses((
        status = 200,
        description = "One row for each step of time",
        content(
            (BudgetAnswer = "application/json"),
            (String = "text/csv"),
            ("application/vnd.apache.arrow.file"),
        ),
    )),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<BudgetParameters>,
) -> Result<Response, ServerError> {
    let read = asked.read()?;
    answered(&state, &headers, &product, &asked, read).await
}

/// The same of a region that is sent along, or in parts that are: the answer of GET with the text as `region`, or as `regions` if it
/// is a `FeatureCollection`.
#[utoipa::path(
    post,
    path = "/api/products/{product}/budget",
    operation_id = "budget_of",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of a carbon flux or of accumulated carbon"), BudgetParameters),
    request_body(
        description = "The region, or a `FeatureCollection` of parts with names, in place of the parameter of that name, as GeoJSON of at most 64 MiB and a million vertices",
        content((GeoJson = "application/geo+json"), (GeoJson = "application/json")),
    ),
    responses((
        status = 200,
        description = "One row for each step of time",
        content(
            (BudgetAnswer = "application/json"),
            (String = "text/csv"),
            ("application/vnd.apache.arrow.file"),
        ),
    )),
)]
pub(crate) async fn post(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<BudgetParameters>,
    body: Body,
) -> Result<Response, ServerError> {
    let ((asked, read), _room) = asked.sent(&state, &headers, body).await?;
    answered(&state, &headers, &product, &asked, read).await
}

async fn answered(
    state: &AppState,
    headers: &HeaderMap,
    product: &str,
    asked: &BudgetParameters,
    read: Read,
) -> Result<Response, ServerError> {
    let form = form(asked.format.as_deref(), headers)?;
    // A plus sign of an offset is a space to a query, as in other times.
    let as_of = asked.as_of.as_deref().map(|text| text.replace(' ', "+"));
    let as_of: Option<AsOf> = parsed(as_of.as_deref())?;
    let layer = match (&as_of, asked.manifest.as_deref()) {
        (Some(_), Some(_)) => {
            return Err(ServerError::Address {
                reason: "manifest and as_of both say which version is meant: give one".to_owned(),
            });
        }
        (Some(as_of), None) => state.catalogue.as_of(product, as_of).await?,
        (None, named) => state.catalogue.version(product, named).await?,
    };
    let (query, _room) = asked.query(state, &layer, read).await?;
    // What cannot be asked waits for no turn.
    query.steps(&layer.manifest)?;
    let answer = state.analyses.budget(&layer, query).await?;
    Ok(response(state.analyses.written(&*answer, form)?, form))
}

/// One budget by every version of the product that changed it: what was known when, and what changed it.
#[utoipa::path(
    get,
    path = "/api/products/{product}/budget/history",
    operation_id = "budget_history",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of a carbon flux or of accumulated carbon"), BudgetParameters),
    responses((
        status = 200,
        description = "A line for each version that changed it",
        content(
            (BudgetHistory = "application/json"),
            (String = "text/csv"),
            ("application/vnd.apache.arrow.file"),
        ),
    )),
)]
pub(crate) async fn history(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<BudgetParameters>,
) -> Result<Response, ServerError> {
    let read = asked.read()?;
    history_of(&state, &headers, &product, &asked, read).await
}

/// The same of a region that is sent along: the answer of GET with the text as `region`.
#[utoipa::path(
    post,
    path = "/api/products/{product}/budget/history",
    operation_id = "budget_history_of",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of a carbon flux or of accumulated carbon"), BudgetParameters),
    request_body(
        description = "The region, or a `FeatureCollection` of parts with names, in place of the parameter of that name, as GeoJSON of at most 64 MiB and a million vertices",
        content((GeoJson = "application/geo+json"), (GeoJson = "application/json")),
    ),
    responses((
        status = 200,
        description = "A line for each version that changed it",
        content(
            (BudgetHistory = "application/json"),
            (String = "text/csv"),
            ("application/vnd.apache.arrow.file"),
        ),
    )),
)]
pub(crate) async fn post_history(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<BudgetParameters>,
    body: Body,
) -> Result<Response, ServerError> {
    let ((asked, read), _room) = asked.sent(&state, &headers, body).await?;
    history_of(&state, &headers, &product, &asked, read).await
}

async fn history_of(
    state: &AppState,
    headers: &HeaderMap,
    product: &str,
    asked: &BudgetParameters,
    read: Read,
) -> Result<Response, ServerError> {
    let form = form(asked.format.as_deref(), headers)?;
    if asked.manifest.is_some() || asked.as_of.is_some() {
        return Err(ServerError::Address {
            reason: "a history is of all versions: leave manifest and as_of out".to_owned(),
        });
    }
    let layer = state.catalogue.version(product, None).await?;
    let (query, _room) = asked.query(state, &layer, read).await?;
    let answer = state.analyses.budget_history(&layer, query).await?;
    Ok(response(state.analyses.written(&*answer, form)?, form))
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
