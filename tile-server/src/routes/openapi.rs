//! `/api/openapi.json`: what this server can be asked, for programs.

use axum::http::header;
use axum::response::{IntoResponse as _, Response};

use crate::openapi;
use crate::routes::picture::CACHE_CONTROL;

/// This description.
#[utoipa::path(
    get,
    path = "/api/openapi.json",
    operation_id = "openapi",
    tag = "catalogue",
    responses((status = 200, description = "OpenAPI 3.1", body = Object)),
)]
pub(crate) async fn get() -> Response {
    let headers = [
        (header::CONTENT_TYPE, "application/json"),
        (header::CACHE_CONTROL, CACHE_CONTROL),
    ];
    (headers, openapi::json()).into_response()
}
