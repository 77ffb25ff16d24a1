//! Every address of the server, in one place.

use axum::Router;
use axum::http::Method;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::get;
use tower::ServiceBuilder;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::cors::{Any, CorsLayer};

use crate::error::ServerError;
use crate::middleware::{limits, panics::CountPanics, security, track};
use crate::routes::picture::{COVERED, SHOWN_TIME};
use crate::routes::{
    area, budget, check, events, globe, health, legend, metrics, observations, openapi, palettes,
    platforms, point, products, regions, tilejson, tiles, viewer,
};
use crate::state::AppState;

/// The whole server as one service.
pub fn router(state: AppState) -> Router {
    // Map clients on other pages may read everything here: nothing is private and nobody logs in.
    let other_origins = CorsLayer::new()
        .allow_origin(Any)
        .allow_methods([Method::GET, Method::HEAD])
        .expose_headers([SHOWN_TIME, COVERED]);
    let layers = ServiceBuilder::new()
        .layer(from_fn_with_state(state.clone(), track::count))
        .layer(from_fn(security::headers))
        .layer(other_origins)
        .layer(CompressionLayer::new())
        .layer(CatchPanicLayer::custom(CountPanics(
            state.metrics.panics.clone(),
        )))
        .layer(from_fn_with_state(state.clone(), limits::time))
        .layer(from_fn(limits::body));
    Router::new()
        .route("/tiles/{product}/{mode_json}", get(tilejson::get))
        .route("/tiles/{product}/{mode}/{z}/{x}/{y_png}", get(tiles::get))
        .route("/globe/{product}/{mode_png}", get(globe::get))
        .route("/api/products", get(products::list))
        .route("/api/products/{product}/point", get(point::get))
        .route("/api/products/{product}/area", get(area::get))
        .route("/api/products/{product}/budget", get(budget::get))
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
        .route("/healthz", get(health::live))
        .route("/readyz", get(health::ready))
        .route("/metrics", get(metrics::get))
        .method_not_allowed_fallback(async || ServerError::ReadOnly)
        .fallback(viewer::get)
        .layer(layers)
        .with_state(state)
}
