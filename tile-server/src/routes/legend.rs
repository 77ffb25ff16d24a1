//! `/api/products/{product}/legend.json`, `.svg` and `.png`: what the colours of a layer mean.

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use contract::digest::Digest;
use contract::job::Mode;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::error::ServerError;
use crate::extract::{NoOthers, UrlPath, UrlQuery};
use crate::look::LookQuery;
use crate::openapi::words;
use crate::request;
use crate::routes::picture::{CACHE_CONTROL, has_tag};
use crate::state::AppState;
use legend::{Form, Legend};

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct LegendQuery {
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
    /// Mode of the pictures: a flow is coloured by its speed.
    #[param(value_type = Option<words::Mode>)]
    mode: Option<String>,
    #[serde(flatten)]
    #[param(ignore)]
    look: LookQuery,
    #[serde(flatten)]
    #[param(ignore)]
    _others: NoOthers,
}

/// What the colours of a layer mean: numbers, a drawing or pixels.
#[utoipa::path(
    get,
    path = "/api/products/{product}/legend.{form}",
    operation_id = "legend",
    tag = "catalogue",
    params(
        ("product" = String, Path, description = "Name of the product"),
        ("form" = words::LegendForm, Path, description = "What the legend is written as"),
        LegendQuery,
        LookQuery,
    ),
    responses(
        (status = 200, description = "The legend in the form that was asked for", content(
            (Legend = "application/json"),
            ("image/svg+xml"),
            ("image/png"),
        ), headers(("etag" = String, description = "Weak; names the content"))),
    ),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath((product, file)): UrlPath<(String, String)>,
    query: Result<UrlQuery<LegendQuery>, ServerError>,
    asked: HeaderMap,
) -> Result<Response, ServerError> {
    let form = file.strip_prefix("legend.").and_then(Form::named);
    // Of an address that is none, parameters are the lesser matter.
    let form = form.ok_or(ServerError::UnknownAddress)?;
    let UrlQuery(query) = query?;
    let layer = state
        .catalogue
        .version(&product, query.manifest.as_deref())
        .await?;
    let quantity = layer.manifest.quantity;
    let mode = match &query.mode {
        Some(text) => request::mode(&layer, text)?,
        None => Mode::Map,
    };
    let style = query
        .look
        .parse()?
        .options()
        .style(quantity, mode, layer.extent.end)?;
    let content = Legend::of_mode(mode, quantity, &style.transfer).encoded(form)?;
    // Weak: the same text may be sent compressed or not.
    let tag = format!("W/\"{}\"", Digest::of(&content));
    let headers = [
        (header::ETAG, tag.clone()),
        (header::CACHE_CONTROL, CACHE_CONTROL.to_owned()),
    ];
    if has_tag(&asked, &tag) {
        return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
    }
    let content_type = [(header::CONTENT_TYPE, form.content_type())];
    Ok((headers, content_type, content).into_response())
}
