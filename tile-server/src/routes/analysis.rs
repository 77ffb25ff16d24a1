//! `/api/products/{product}/analysis`: climatology, anomaly, trend, season and extremes of the series of a cell, a region or a line.

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse as _, Response};
use contract::analysis::{AnalysisPart, AnalysisWishes, SeriesAnalysis, SeriesQuery, SeriesWishes};
use contract::geometry::AskedLine;
use contract::geometry_text;
use contract::grid::LonLatDeg;
use contract::region::AskedRegion;
use contract::time::TimeStep;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::backend::{SeriesQuestion, Version};
use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, left_out, number, parsed, time};
use crate::masks;
use crate::openapi::words::GeoJson;
use crate::rooms::Room;
use crate::routes::budget::ocean;
use crate::state::AppState;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct AnalysisParameters {
    /// What is made of the series: `climatology`, `anomaly`, `trend`, `season`, `extremes`, several with commas.
    #[param(value_type = String)]
    parts: Option<String>,
    /// Years of the climatology and the anomaly, both part of it: `1991/2020`; all that are covered unless given. Of these parts alone.
    base: Option<String>,
    /// Parts of the year of the climatology and the anomaly: `month` (the default), `season` or `day`. Of these parts alone.
    bins: Option<String>,
    /// Means that the trend is drawn through; `month` unless told otherwise. Of the trend alone.
    #[param(value_type = Option<TimeStep>)]
    trend_step: Option<String>,
    /// Least coverage, percent: steps that hold data over less of the region's sea, or of the line, are left out, and the answer says
    /// how many; 0 unless told otherwise.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 100)]
    min_coverage: Option<String>,
    /// Longitude of a cell, degrees east, -180 to 360; with `lat`, in place of a region.
    #[param(value_type = Option<f64>)]
    lon: Option<String>,
    /// Latitude of a cell, degrees north.
    #[param(value_type = Option<f64>, minimum = -90, maximum = 90)]
    lat: Option<String>,
    /// `global`, a name that `/api/regions` lists, `west,south,east,north` in degrees, GeoJSON or well-known text, or `MASK:CODE`: the
    /// cells where a landed mask has a code, or what it means, such as `basins:5` or `basins:southern`.
    region: Option<String>,
    /// `LON,LAT;LON,LAT;...` in degrees, GeoJSON or well-known text, in place of a region: the mean along a line, each cell by the length
    /// in it.
    line: Option<String>,
    /// First instant, ISO 8601 UTC; the product's own unless one is given.
    from: Option<String>,
    /// First instant after the period; the product's own unless one is given.
    to: Option<String>,
    /// Figure of the earth for areas and lengths, of a region or a line; `wgs84` unless one is given.
    #[param(value_type = Option<contract::earth::Earth>)]
    earth: Option<String>,
    /// Landed product whose cells say how much of them is sea or land, in place of Natural Earth; of a region alone.
    ocean: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
}

/// Climatology, anomaly, trend, season and extremes of a series. What is not defined for it stands in `refused` with the reason.
#[utoipa::path(
    get,
    path = "/api/products/{product}/analysis",
    operation_id = "analysis",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), AnalysisParameters),
    responses((status = 200, description = "What was asked for, each part by itself", body = SeriesAnalysis)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<AnalysisParameters>,
) -> Result<Response, ServerError> {
    answered(&state, &product, &asked, None).await
}

/// The same of a region or a line that is sent along: the answer of GET with its text as `region` or `line`.
#[utoipa::path(
    post,
    path = "/api/products/{product}/analysis",
    operation_id = "analysis_of",
    tag = "statistics",
    params(("product" = String, Path, description = "Name of the product"), AnalysisParameters),
    request_body(
        description = "The region, or the line, in place of the parameter of that name, as GeoJSON of at most 64 MiB and a million vertices",
        content((GeoJson = "application/geo+json"), (GeoJson = "application/json")),
    ),
    responses((status = 200, description = "What was asked for, each part by itself", body = SeriesAnalysis)),
)]
pub(crate) async fn post(
    State(state): State<AppState>,
    headers: HeaderMap,
    UrlPath(product): UrlPath<String>,
    UrlQuery(asked): UrlQuery<AnalysisParameters>,
    body: Body,
) -> Result<Response, ServerError> {
    let (sent, _room) = SentPlace::take(&state, &asked.place(), &headers, body).await?;
    answered(&state, &product, &asked, Some(sent)).await
}

async fn answered(
    state: &AppState,
    product: &str,
    asked: &AnalysisParameters,
    sent: Option<SentPlace>,
) -> Result<Response, ServerError> {
    let layer = state
        .catalogue
        .version(product, asked.manifest.as_deref())
        .await?;
    let parts = asked.parts.as_deref().unwrap_or_default().split(',');
    let parts = parts
        .filter(|part| !part.is_empty())
        .map(str::parse::<AnalysisPart>);
    let wishes = AnalysisWishes {
        parts: parts.collect::<Result<_, _>>()?,
        base: parsed(asked.base.as_deref())?,
        bins: parsed(asked.bins.as_deref())?,
        trend_step: parsed(asked.trend_step.as_deref())?,
        min_coverage: parsed(asked.min_coverage.as_deref())?,
    };
    let options = wishes.options()?;
    let text = SeriesText {
        place: asked.place(),
        period: [asked.from.as_deref(), asked.to.as_deref()],
        earth: asked.earth.as_deref(),
        ocean: asked.ocean.as_deref(),
        sent,
    };
    let (series, _room) = text.query(state, &layer).await?;
    let of = version(&layer);
    answer(
        state,
        SeriesQuestion::Analysis {
            of,
            series,
            options,
        },
    )
    .await
}

impl AnalysisParameters {
    fn place(&self) -> PlaceText<'_> {
        PlaceText {
            lon: self.lon.as_deref(),
            lat: self.lat.as_deref(),
            region: self.region.as_deref(),
            line: self.line.as_deref(),
        }
    }
}

/// A cell, a region or a line as an address has it.
pub(crate) struct PlaceText<'a> {
    pub(crate) lon: Option<&'a str>,
    pub(crate) lat: Option<&'a str>,
    pub(crate) region: Option<&'a str>,
    pub(crate) line: Option<&'a str>,
}

/// A cell, a region or a line, and a period, as an address has them.
pub(crate) struct SeriesText<'a> {
    pub(crate) place: PlaceText<'a>,
    /// First instant, and the first one after it.
    pub(crate) period: [Option<&'a str>; 2],
    pub(crate) earth: Option<&'a str>,
    pub(crate) ocean: Option<&'a str>,
    /// What came with the request.
    pub(crate) sent: Option<SentPlace>,
}

/// Where a series is taken, as it is sent along with a request.
pub(crate) enum SentPlace {
    Region(AskedRegion),
    Line(AskedLine),
}

impl SentPlace {
    /// That of a body, whichever it is, and the room that it takes; the address names no other place.
    pub(crate) async fn take(
        state: &AppState,
        address: &PlaceText<'_>,
        headers: &HeaderMap,
        body: Body,
    ) -> Result<(Self, Room), ServerError> {
        left_out(&[
            ("region", address.region.is_some()),
            ("line", address.line.is_some()),
            ("lon", address.lon.is_some()),
            ("lat", address.lat.is_some()),
        ])?;
        let sent = state.bodies.take(headers, body).await?;
        let read = |text: String| {
            Ok(if geometry_text::is_line(&text) {
                Self::Line(text.parse()?)
            } else {
                Self::Region(text.parse()?)
            })
        };
        sent.read(read).await
    }
}

impl SeriesText<'_> {
    /// The question, if it can be asked of a version, and the room that its region takes, to be kept as long as it is asked.
    pub(crate) async fn query(
        self,
        state: &AppState,
        layer: &Layer,
    ) -> Result<(SeriesQuery, Option<Room>), ServerError> {
        let missing = ServerError::Missing {
            name: "region",
            wanted: "a region, a line, or lon and lat of a cell, and one of them alone",
        };
        let text = self.place;
        let place = match [text.lon, text.lat] {
            [None, None] => None,
            [Some(lon), Some(lat)] => {
                let lon = number("lon", lon, "degrees east")?;
                let lat = number("lat", lat, "degrees north, -90 to 90")?;
                Some(LonLatDeg::new(lon, lat)?)
            }
            [Some(_), None] | [None, Some(_)] => return Err(missing),
        };
        let (region, line, room) = match self.sent {
            Some(SentPlace::Region(region)) => (Some(region), None, None),
            Some(SentPlace::Line(line)) => (None, Some(line), None),
            None => {
                let (region, room) = masks::some_region(state, text.region).await?;
                (region, parsed(text.line)?, room)
            }
        };
        let wishes = SeriesWishes {
            place,
            region,
            line,
            from: time(self.period[0])?,
            to: time(self.period[1])?,
            earth: parsed(self.earth)?,
            ocean: ocean(state, self.ocean).await?,
        };
        // What cannot be asked waits for no turn.
        layer.manifest.steps_inside(wishes.from, wishes.to)?;
        let query = wishes
            .query(layer.manifest.product.clone())?
            .ok_or(missing)?;
        if let SeriesQuery::Cell { place, .. } = &query {
            layer.manifest.cell_inside(*place)?;
        }
        Ok((query, room))
    }
}

pub(crate) fn version(layer: &Layer) -> Version {
    Version {
        manifest: layer.manifest.clone(),
        id: layer.id.clone(),
    }
}

pub(crate) async fn answer(
    state: &AppState,
    question: SeriesQuestion,
) -> Result<Response, ServerError> {
    let made = state.analyses.made_of_series(question).await?;
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(&*made)).into_response())
}
