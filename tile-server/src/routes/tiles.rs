//! `/tiles/{product}/{mode}/{z}/{x}/{y}.png`: one map tile at any instant.

use axum::extract::{FromRequestParts as _, Request, State};
use axum::http::request::Parts;
use axum::http::uri::PathAndQuery;
use axum::response::Response;
use contract::job::{Mode, RenderJob, View};
use contract::picture::PictureRequest;
use contract::tile::Tile;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::addresses::KnownTile;
use crate::annotations::AnnotationsQuery;
use crate::edition::{Edition, Named};
use crate::error::ServerError;
use crate::extract::{NoOthers, UrlPath, UrlQuery, time, whole_number};
use crate::look::LookQuery;
use crate::openapi::words;
use crate::request;
use crate::routes::picture::{Head, Shown};
use crate::state::AppState;
use crate::surroundings::SurroundingsQuery;

/// Pixels a side unless told otherwise.
const SIZE_PX: u32 = 256;
/// Pixels a side of a tile for screens with double resolution.
const SIZE_2X_PX: u32 = 512;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct TileQuery {
    /// Instant, ISO 8601 UTC (a year, month or day means its start); the middle of the last step unless one is given.
    #[param(example = "2000-01-16T12:00:00Z")]
    time: Option<String>,
    /// Pixels a side, 256 or 512.
    #[param(value_type = Option<u32>)]
    size: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
    /// Everything else that shapes the picture, as TileJSON and the list of products name it: with `time`, `manifest` and the
    /// edition of now the answer may be kept for ever.
    #[param(example = "0123456789abcdef")]
    edition: Option<String>,
    /// Anything: it is not read. Another one is another address to caches on the way.
    #[expect(dead_code, reason = "it tells addresses apart, and nothing else")]
    revision: Option<String>,
    #[serde(flatten)]
    #[param(ignore)]
    look: LookQuery,
    #[serde(flatten)]
    #[param(ignore)]
    surroundings: SurroundingsQuery,
    /// Told apart from what nobody ever understood.
    #[serde(flatten)]
    #[param(ignore)]
    annotations: AnnotationsQuery,
    #[serde(flatten)]
    #[param(ignore)]
    _others: NoOthers,
}

/// A map tile at any instant: Web Mercator (EPSG:3857), XYZ scheme, PNG with alpha.
#[utoipa::path(
    get,
    path = "/tiles/{product}/{mode}/{z}/{x}/{y}.png",
    operation_id = "tile",
    tag = "pictures",
    params(
        ("product" = String, Path, description = "Name of the product"),
        ("mode" = words::Mode, Path, description = "How it is drawn; a product lists its modes"),
        ("z" = u32, Path, description = "Zoom, 0 to 16"),
        ("x" = u32, Path, description = "Column, from the west"),
        ("y" = String, Path, description = "Row, from the north; `@2x` after it asks for 512 pixels", pattern = r"^\d+(@2x)?$"),
        TileQuery,
        LookQuery,
        SurroundingsQuery,
    ),
    responses(
        (status = 200, description = "The tile; transparent where there is no data", content(("image/png")),
            headers(
                ("etag" = String, description = "Names the job: the same tag is the same picture, byte for byte"),
                ("cache-control" = String, description = "`immutable` where the address names `time`, `manifest` and the edition of now"),
                ("fluxglobe-time" = String, description = "The instant that is shown, ISO 8601"),
                ("fluxglobe-time-covered" = String, description = "`start/end` of what there is, where another instant is shown than was asked for"),
                ("fluxglobe-heights-end" = String, description = "Accumulated carbon at which heights end, where particles are lifted by it: columns of more are drawn no higher or deeper"),
                ("fluxglobe-heights-within" = String, description = "Pixels that heights end at: where to scale they would be more, all heights of the zoom level are drawn lower alike"),
            )),
    ),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    request: Request,
) -> Result<Response, ServerError> {
    let (mut parts, _body) = request.into_parts();
    if let Some(answer) = again(&state, &parts).await? {
        return Ok(answer);
    }
    let UrlPath(path) = UrlPath::from_request_parts(&mut parts, &state).await?;
    let UrlQuery(query) = UrlQuery::of(&parts.uri)?;
    let Read { tile, job, lasts } = read(&state, path, &query).await?;
    asked(&state, &tile);
    let asked = &parts.headers;
    let answer = tile.head.answer(&state.pictures, asked, job).await?;
    served(&state, &tile);
    if lasts {
        state.addresses.remember(address(&parts), tile);
    }
    Ok(answer)
}

fn address(parts: &Parts) -> &str {
    parts.uri.path_and_query().map_or("", PathAndQuery::as_str)
}

/// The answer to an address that was read before and whose picture lies in memory, or is the client's own.
async fn again(state: &AppState, parts: &Parts) -> Result<Option<Response>, ServerError> {
    let Some(tile) = state.addresses.known(address(parts)) else {
        return Ok(None);
    };
    if !state.catalogue.is_still(&tile.layer).await? {
        return Ok(None);
    }
    let answer = tile.head.at_once(&state.pictures, &parts.headers);
    if answer.is_some() {
        asked(state, &tile);
        served(state, &tile);
    }
    Ok(answer)
}

/// Counts that somebody asks for a tile.
fn asked(state: &AppState, tile: &KnownTile) {
    if let Some((view, time)) = &tile.hot {
        let product = &tile.layer.manifest.product;
        state.hot.asked(product, tile.mode, view, *time);
    }
}

/// Notes that somebody gets it.
fn served(state: &AppState, tile: &KnownTile) {
    if tile.mode == Mode::Volume {
        state.freshness.served(&tile.layer.id);
    }
}

/// What an address comes to.
struct Read {
    tile: KnownTile,
    job: RenderJob,
    /// Is it so as long as its product has no newer version?
    lasts: bool,
}

async fn read(
    state: &AppState,
    (product, mode, z, x, y): (String, String, String, String, String),
    query: &TileQuery,
) -> Result<Read, ServerError> {
    query.annotations.refused_on_tiles()?;
    let manifest = query.manifest.as_deref();
    let layer = state.catalogue.version(&product, manifest).await?;
    let mode = request::mode(&layer, &mode)?;
    let (tile, named_size_px) = parse_tile(&z, &x, &y)?;
    let size_px = match query.size.as_deref() {
        Some(text) => parse_size(text)?,
        None => named_size_px,
    };
    let time = time(query.time.as_deref())?;
    let look = query.look.parse()?;
    let around = &query.surroundings;
    let request = PictureRequest {
        mode,
        view: View::Tile { tile, size_px },
        time,
        options: around.around(&look.options())?,
    };
    let beside = around.beside(&state.catalogue).await?;
    let job = request::job_of(&layer, &request, &beside)?;
    let named = Named {
        time,
        manifest,
        edition: query.edition.as_deref(),
    };
    let is_pinned =
        named.is_everything(|| Edition::of(&layer, &request, &beside, &reference_views()))?;
    let shown = Shown::of(&layer, time);
    let lasts = around.is_empty() && state.catalogue.is_newest(&layer);
    // Who looks at an old version, in colours of their own or at what is not drawn ahead, is no reason to draw a new one.
    let hot = (lasts && look.is_usual()).then(|| (job.view, time.map(|_asked| shown.time)));
    let tile = KnownTile {
        mode,
        hot,
        head: Head::of(&job, &shown, is_pinned),
        layer,
    };
    Ok(Read { tile, job, lasts })
}

/// The views that editions go by: a tile of every size.
pub(crate) fn reference_views() -> [View; 2] {
    let tile = Tile { z: 0, x: 0, y: 0 };
    [SIZE_PX, SIZE_2X_PX].map(|size_px| View::Tile { tile, size_px })
}

fn parse_size(text: &str) -> Result<u32, ServerError> {
    let valid = "256 or 512";
    let size_px = whole_number("size", text, valid)?;
    if [SIZE_PX, SIZE_2X_PX].contains(&size_px) {
        Ok(size_px)
    } else {
        Err(ServerError::invalid("size", text, valid))
    }
}

/// A tile of `z`, `x` and `y.png` or `y@2x.png`, and the size the name asks for.
fn parse_tile(z: &str, x: &str, y: &str) -> Result<(Tile, u32), ServerError> {
    let address = format!("{z}/{x}/{y}");
    let Some(name) = y.strip_suffix(".png") else {
        return Err(ServerError::invalid(
            "tile",
            &address,
            "tiles are z/x/y.png",
        ));
    };
    let (row, size_px) = name
        .strip_suffix("@2x")
        .map_or((name, SIZE_PX), |row| (row, SIZE_2X_PX));
    let part = |text: &str| {
        let valid = "zoom, column and row are whole numbers, as in 2/1/3.png";
        whole_number("tile", text, valid)
            .map_err(|_named_by_its_address| ServerError::invalid("tile", &address, valid))
    };
    let (z, x, y) = (part(z)?, part(x)?, part(row)?);
    // A zoom no byte holds is too deep like any other that is.
    Ok((Tile::new(z.try_into().unwrap_or(u8::MAX), x, y)?, size_px))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_parse_with_their_size() {
        assert_eq!(
            parse_tile("2", "1", "3.png").unwrap(),
            (Tile { z: 2, x: 1, y: 3 }, 256)
        );
        assert_eq!(
            parse_tile("2", "1", "3@2x.png").unwrap(),
            (Tile { z: 2, x: 1, y: 3 }, 512)
        );
    }

    #[test]
    fn addresses_that_are_none_say_why() {
        let reason = |z, x, y| parse_tile(z, x, y).unwrap_err().to_string();
        assert!(reason("99", "0", "0.png").contains("zoom is 0 to 16"));
        assert!(reason("256", "0", "0.png").contains("zoom is 0 to 16"));
        assert!(reason("1", "2", "0.png").contains("0 to 1"));
        assert!(reason("a", "0", "0.png").contains("whole numbers"));
        assert!(reason("0", "-1", "0.png").contains("whole numbers"));
        assert!(reason("0", "0", "0.jpg").contains("z/x/y.png"));
        assert!(reason("0", "0", "@2x.png").contains("whole numbers"));
    }
}
