//! `/api/observations/platforms`: buoys, ships, stations and profiles as GeoJSON: points, and the tracks of ships.
//!
//! The types are not those of the crate `geojson`, which regions are read with: `/api/openapi.json` describes these member
//! by member.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use contract::observation::{Filter, Platform, PlatformKind, Quality, TrackPoint, TrackQuery};
use contract::region::Region;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::backend::Observe;
use crate::error::ServerError;
use crate::extract::{UrlQuery, parsed, time};
use crate::routes::observations::check_dataset;
use crate::state::AppState;

/// Platforms of one answer: as many points as a globe still shows apart.
const MOST_PLATFORMS: u32 = 10_000;
/// Places of one track; more are thinned out by the observation store.
const TRACK_POINTS: u32 = 2000;
/// Tracks of one answer: one question is about all of them.
const MOST_TRACKS: usize = 50;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlatformParameters {
    /// Where: a region as budgets take it, such as `west,south,east,north` in degrees; everywhere unless one is given.
    region: Option<String>,
    /// What it was called before; told apart from what nobody ever understood.
    #[param(ignore)]
    bbox: Option<String>,
    /// First instant, ISO 8601 UTC.
    from: Option<String>,
    /// First instant after the period.
    to: Option<String>,
    /// What was measured, such as `sea_surface_temperature`.
    property: Option<String>,
    /// What carries the instruments.
    #[param(value_type = Option<PlatformKind>)]
    kind: Option<String>,
    /// Data set.
    dataset: Option<String>,
    /// Worst quality of the observations that count; all do unless one is given.
    #[param(value_type = Option<Quality>)]
    worst: Option<String>,
}

/// Platforms as GeoJSON (RFC 7946).
#[derive(Debug, Serialize, ToSchema)]
struct Platforms {
    #[serde(rename = "type")]
    #[schema(inline)]
    kind: Collection,
    /// By data set and name, the first 10,000.
    features: Vec<PlatformFeature>,
    /// Are these all that the question is about? Where they are not, ask for one data set, a region or a period.
    is_complete: bool,
}

#[derive(Debug, Serialize, ToSchema)]
enum Collection {
    FeatureCollection,
}

#[derive(Debug, Serialize, ToSchema)]
enum Member {
    Feature,
}

/// A platform.
#[derive(Debug, Serialize, ToSchema)]
struct PlatformFeature {
    #[serde(rename = "type")]
    #[schema(inline)]
    kind: Member,
    /// `dataset/platform`.
    id: String,
    geometry: Geometry,
    /// What there is of it.
    properties: Platform,
}

/// Places as longitude and latitude, degrees: the last one, or the track of a ship, of at most 2,000 places from its first to its
/// last, of the first 50 ships.
#[derive(Debug, PartialEq, Serialize, ToSchema)]
#[serde(tag = "type")]
enum Geometry {
    Point {
        #[schema(value_type = (f64, f64))]
        coordinates: [f64; 2],
    },
    MultiLineString {
        #[schema(value_type = Vec<Vec<(f64, f64)>>)]
        coordinates: Vec<Vec<[f64; 2]>>,
    },
}

/// Buoys, ships, stations and profiles, with the tracks of ships.
#[utoipa::path(
    get,
    path = "/api/observations/platforms",
    operation_id = "platforms",
    tag = "observations",
    params(PlatformParameters),
    responses(
        (status = 200, description = "Those with observations that the question is about", body = Platforms),
        (status = 304, description = "The copy that `If-None-Match` names is still right"),
        (status = 404, description = "This server has no observations, or none of this data set", body = crate::error::Refusal),
    ),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlQuery(asked): UrlQuery<PlatformParameters>,
) -> Result<Response, ServerError> {
    let observer = state.observer.get().ok_or(ServerError::NoObservations)?;
    let filter = asked.filter()?;
    let _pass = state
        .observing
        .enter()
        .await
        .inspect_err(|_busy| state.metrics.refused.inc())?;
    let found = observer.platforms(&filter).await?;
    if let (true, [dataset]) = (found.platforms.is_empty(), filter.datasets.as_slice()) {
        check_dataset(observer.as_ref(), dataset).await?;
    }
    let mut tracks = tracks(observer.as_ref(), &found.platforms, &filter)
        .await?
        .into_iter();
    let with_track = |platform: Platform| {
        let track = if platform.kind == PlatformKind::Ship {
            tracks.next().unwrap_or_default()
        } else {
            vec![]
        };
        feature(platform, &track)
    };
    let answer = Platforms {
        kind: Collection::FeatureCollection,
        features: found.platforms.into_iter().map(with_track).collect(),
        is_complete: found.is_complete,
    };
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(answer)).into_response())
}

impl PlatformParameters {
    fn filter(&self) -> Result<Filter, ServerError> {
        if let Some(text) = &self.bbox {
            return Err(ServerError::invalid(
                "bbox",
                text,
                "it is written region=... now",
            ));
        }
        Ok(Filter {
            region: parsed(self.region.as_deref())?.unwrap_or(Region::Global),
            from: time(self.from.as_deref())?,
            to: time(self.to.as_deref())?,
            datasets: parsed(self.dataset.as_deref())?.into_iter().collect(),
            kinds: parsed(self.kind.as_deref())?.into_iter().collect(),
            properties: self.property.clone().into_iter().collect(),
            worst: parsed(self.worst.as_deref())?.unwrap_or(Quality::Bad),
            limit: MOST_PLATFORMS,
            ..Filter::default()
        })
    }
}

/// Tracks of the first ships among platforms, in their order.
async fn tracks(
    observer: &dyn Observe,
    platforms: &[Platform],
    filter: &Filter,
) -> Result<Vec<Vec<TrackPoint>>, ServerError> {
    let query = |platform: &Platform| TrackQuery {
        from: filter.from,
        to: filter.to,
        limit: TRACK_POINTS,
        ..TrackQuery::new(platform.dataset.clone(), platform.platform.as_str())
    };
    let ships = platforms
        .iter()
        .filter(|platform| platform.kind == PlatformKind::Ship);
    let queries: Vec<TrackQuery> = ships.take(MOST_TRACKS).map(query).collect();
    if queries.is_empty() {
        return Ok(vec![]);
    }
    Ok(observer.tracks(&queries).await?)
}

fn feature(platform: Platform, track: &[TrackPoint]) -> PlatformFeature {
    let geometry = if track.len() > 1 {
        Geometry::MultiLineString {
            coordinates: lines(track),
        }
    } else {
        Geometry::Point {
            coordinates: [platform.lon_deg, platform.lat_deg],
        }
    };
    PlatformFeature {
        kind: Member::Feature,
        id: format!("{}/{}", platform.dataset, platform.platform),
        geometry,
        properties: platform,
    }
}

/// A track as lines that stay on one side of the date line, each ending where it crosses (RFC 7946, 3.1.9).
fn lines(track: &[TrackPoint]) -> Vec<Vec<[f64; 2]>> {
    let mut all = vec![vec![]];
    let mut before: Option<TrackPoint> = None;
    for point in track {
        if let Some(last) = before
            && (point.lon_deg - last.lon_deg).abs() > 180.0
        {
            let edge = if last.lon_deg > 0.0 { 180.0 } else { -180.0 };
            let beyond = point.lon_deg + 2.0 * edge;
            let span = beyond - last.lon_deg;
            let share = if span == 0.0 {
                0.0
            } else {
                (edge - last.lon_deg) / span
            };
            let lat = last.lat_deg + share * (point.lat_deg - last.lat_deg);
            push(&mut all, [edge, lat]);
            all.push(vec![[-edge, lat]]);
        }
        push(&mut all, [point.lon_deg, point.lat_deg]);
        before = Some(*point);
    }
    all.retain(|line| line.len() > 1);
    all
}

fn push(lines: &mut [Vec<[f64; 2]>], place: [f64; 2]) {
    if let Some(line) = lines.last_mut() {
        line.push(place);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(lon_deg: f64, lat_deg: f64) -> TrackPoint {
        TrackPoint {
            time: "2000".parse().unwrap(),
            lon_deg,
            lat_deg,
        }
    }

    #[test]
    fn a_track_over_the_date_line_is_cut_there_both_ways() {
        let eastwards = lines(&[
            at(170.0, 0.0),
            at(178.0, 0.0),
            at(-178.0, 4.0),
            at(-170.0, 4.0),
        ]);
        let west = vec![[170.0, 0.0], [178.0, 0.0], [180.0, 2.0]];
        let east = vec![[-180.0, 2.0], [-178.0, 4.0], [-170.0, 4.0]];
        assert_eq!(eastwards, [west, east]);
        let westwards = lines(&[at(-179.0, 1.0), at(179.0, 1.0)]);
        assert_eq!(
            westwards,
            [[[-179.0, 1.0], [-180.0, 1.0]], [[180.0, 1.0], [179.0, 1.0]]]
        );
    }
}
