//! Every address of the server, in one place.

use std::time::Duration;

use axum::error_handling::HandleErrorLayer;
use axum::http::{Method, header};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::get;
use axum::{BoxError, Router};
use tower::ServiceBuilder;
use tower::timeout::TimeoutLayer;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{DefaultPredicate, NotForContentType, Predicate};
use tower_http::cors::{Any, CorsLayer};

use crate::client;
use crate::error::ServerError;
use crate::middleware::body::{self, Takes};
use crate::middleware::{encoding, panics::CountPanics, security, tag, track};
use crate::routes::picture::{COVERED, HEIGHTS_END, HEIGHTS_WITHIN, SHOWN_TIME, TILT_WITH_GROUND};
use crate::routes::{
    analysis, area, budget, check, correlation, difference, events, globe, health, hovmoller,
    legend, line, metrics, observations, openapi, palettes, platforms, point, products, regions,
    stream, tilejson, tiles, viewer, zarr,
};
use crate::state::AppState;

/// Chunks of arrays are compressed as they are, and parts of them are what was asked for.
fn compressible() -> impl Predicate {
    let is_no_chunk = NotForContentType::const_new("application/octet-stream");
    DefaultPredicate::new().and(is_no_chunk)
}

/// Map clients on other pages may read everything here: nothing is private and nobody logs in.
fn other_origins(takes: Takes) -> CorsLayer {
    let layer = match takes {
        // Browsers ask first for ranges that end at the end of a chunk, and for conditions.
        Takes::Nothing => CorsLayer::new()
            .allow_methods([Method::GET, Method::HEAD])
            .allow_headers([header::RANGE, header::IF_RANGE, header::IF_NONE_MATCH]),
        Takes::Geometries => CorsLayer::new()
            .allow_methods([Method::GET, Method::HEAD, Method::POST])
            .allow_headers([header::CONTENT_TYPE]),
    };
    layer
        .allow_origin(Any)
        // Everybody gets the same headers: caches on the way need one copy for all pages.
        .vary([])
        .expose_headers([
            SHOWN_TIME,
            COVERED,
            HEIGHTS_END,
            HEIGHTS_WITHIN,
            TILT_WITH_GROUND,
            header::CONTENT_LOCATION,
            header::CONTENT_RANGE,
            header::ETAG,
        ])
}

/// Addresses that POST asks too: a geometry that no address has room for is sent along. Nothing is stored of it.
fn of_geometries() -> Router<AppState> {
    Router::new()
        .route(
            "/api/products/{product}/line",
            get(line::get).post(line::post),
        )
        .route(
            "/api/products/{product}/area",
            get(area::get).post(area::post),
        )
        .route(
            "/api/products/{product}/analysis",
            get(analysis::get).post(analysis::post),
        )
        .route(
            "/api/products/{product}/correlation",
            get(correlation::get).post(correlation::post),
        )
        .route(
            "/api/products/{product}/difference",
            get(difference::get).post(difference::post),
        )
        .route(
            "/api/products/{product}/hovmoller",
            get(hovmoller::get).post(hovmoller::post),
        )
        .route(
            "/api/products/{product}/budget",
            get(budget::get).post(budget::post),
        )
        .route(
            "/api/products/{product}/budget/history",
            get(budget::history).post(budget::post_history),
        )
        .method_not_allowed_fallback(async || ServerError::AskedOnly)
}

/// The whole server as one service.
pub fn router(state: AppState) -> Router {
    // What a request waited for goes on after its time only if somebody else waits for it too, or comes again (`pictures.rs`).
    let limit_s = state.settings.request_limit_s;
    let timed_out = move |_elapsed: BoxError| async move { ServerError::TimedOut { limit_s } };
    let layers = |takes: Takes| {
        ServiceBuilder::new()
            .layer(from_fn_with_state(state.clone(), track::count))
            .map_response(security::with_headers)
            .layer(other_origins(takes))
            .map_response(encoding::told)
            .layer(CompressionLayer::new().compress_when(compressible()))
            .layer(CatchPanicLayer::custom(CountPanics(
                state.metrics.panics.clone(),
            )))
            .layer(HandleErrorLayer::new(timed_out))
            .layer(TimeoutLayer::new(Duration::from_secs(limit_s)))
            .layer(from_fn_with_state(takes, body::limit))
            .layer(from_fn_with_state(
                state.settings.client_header.clone(),
                client::remember,
            ))
            .layer(from_fn(tag::tagged))
    };
    Router::new()
        .route("/tiles/{product}/{mode_json}", get(tilejson::get))
        .route("/tiles/{product}/{mode}/{z}/{x}/{y_png}", get(tiles::get))
        .route("/globe/{product}/{mode_png}", get(globe::get))
        .route("/stream", get(stream::get))
        .route("/api/products", get(products::list))
        .route("/api/products/{product}/point", get(point::get))
        .route("/api/products/{product}/{legend_file}", get(legend::get))
        .route("/api/regions", get(regions::list))
        .route("/api/palettes", get(palettes::list))
        .route("/api/check", get(check::get))
        .route("/api/openapi.json", get(openapi::get))
        .route("/api/events", get(events::get))
        .route("/api/observations/platforms", get(platforms::get))
        .route(
            "/api/observations/{dataset}/{platform}",
            get(observations::get),
        )
        .route("/zarr/{product}/{*key}", get(zarr::get))
        .route("/zarr2/{product}/{*key}", get(zarr::get_2))
        .route("/healthz", get(health::live))
        .route("/readyz", get(health::ready))
        .route("/metrics", get(metrics::get))
        .method_not_allowed_fallback(async || ServerError::ReadOnly)
        .fallback(viewer::get)
        .layer(layers(Takes::Nothing))
        .merge(of_geometries().layer(layers(Takes::Geometries)))
        .with_state(state)
}
