//! The viewer's built files from a folder, with cache headers by how they are named, and a clear page without them.

use std::path::PathBuf;

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{Html, IntoResponse as _, Response};
use tower_http::services::ServeDir;

use crate::config::Settings;
use crate::error::ServerError;
use crate::state::AppState;

/// Files the bundler names by their content: what is under such a name never changes.
const HASHED: &str = "/assets/";
/// Files of the globe library, named by its version's build only.
const LIBRARY: &str = "/cesium/";

const NOT_BUILT: &str = "<!doctype html>
<html lang=\"en\">
<meta charset=\"utf-8\">
<title>Fluxglobe</title>
<h1>The viewer has not been built</h1>
<p>This server has tiles and data, but no folder with the built viewer in it.
Build the viewer (<code>make demo</code> does) and name its folder with <code>--viewer</code>.</p>
<p>What is here: <a href=\"/api/products\">products</a>, <a href=\"/api/regions\">regions</a>,
<a href=\"/readyz\">state of the parts</a>.</p>
</html>
";

/// Is there a page to serve?
pub(crate) async fn is_built(settings: &Settings) -> bool {
    match index(settings) {
        Some(index) => tokio::fs::try_exists(index).await.unwrap_or(false),
        None => false,
    }
}

fn index(settings: &Settings) -> Option<PathBuf> {
    settings
        .viewer
        .as_ref()
        .map(|folder| folder.join("index.html"))
}

/// A file of the viewer; everything that is none is an unknown address.
pub(crate) async fn get(
    State(state): State<AppState>,
    mut request: Request,
) -> Result<Response, ServerError> {
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return Err(ServerError::ReadOnly);
    }
    let path = request.uri().path().to_owned();
    if !asks_for_a_part(&request) {
        request.headers_mut().remove(header::RANGE);
    }
    let Some(folder) = &state.settings.viewer else {
        return absent(&path);
    };
    // Path parts that leave the folder, in whatever spelling, are refused by this service.
    let found = ServeDir::new(folder)
        .redirect_to_trailing_slash(false)
        .try_call(request)
        .await;
    let mut response = match found {
        Ok(response) if response.status() == StatusCode::NOT_FOUND => return absent(&path),
        // The service says neither in words.
        Ok(response) if response.status() == StatusCode::RANGE_NOT_SATISFIABLE => {
            let length = length_of(response.headers()).unwrap_or_default();
            return Err(ServerError::NoRange { length });
        }
        Ok(response) if response.status() == StatusCode::PRECONDITION_FAILED => {
            return Err(ServerError::Changed);
        }
        Ok(response) => response.map(Body::new),
        Err(error) => {
            tracing::debug!(%error, "a file of the viewer cannot be read");
            return absent(&path);
        }
    };
    let cache_control = if path.starts_with(HASHED) {
        "public, max-age=31536000, immutable"
    } else if path.starts_with(LIBRARY) {
        "public, max-age=3600"
    } else {
        "no-cache"
    };
    if response.status().is_success() || response.status() == StatusCode::NOT_MODIFIED {
        response.headers_mut().insert(
            header::CACHE_CONTROL,
            HeaderValue::from_static(cache_control),
        );
    }
    Ok(response)
}

/// Is it one range of bytes? To HEAD none means anything, and several may be answered with all (RFC 9110, 14.2).
fn asks_for_a_part(request: &Request) -> bool {
    let is_one = |range: &HeaderValue| !range.as_bytes().contains(&b',');
    let range = request.headers().get(header::RANGE);
    request.method() == Method::GET && range.is_none_or(is_one)
}

/// How many bytes there are, by an answer that has none of them.
fn length_of(headers: &HeaderMap) -> Option<u64> {
    let place = headers.get(header::CONTENT_RANGE)?.to_str().ok()?;
    place.strip_prefix("bytes */")?.parse().ok()
}

fn absent(path: &str) -> Result<Response, ServerError> {
    if path == "/" || path == "/index.html" {
        return Ok((
            StatusCode::NOT_FOUND,
            [(header::CACHE_CONTROL, "no-store")],
            Html(NOT_BUILT),
        )
            .into_response());
    }
    Err(ServerError::UnknownAddress)
}
