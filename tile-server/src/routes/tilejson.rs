//! `/tiles/{product}/{mode}.json`: what a map client needs to know of a layer, as TileJSON 3.0.0.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse as _, Response};
use contract::grid::Grid;
use contract::job::Mode;
use contract::manifest::ManifestId;
use contract::picture::PictureRequest;
use contract::tile::{MAX_LAT_DEG, MAX_ZOOM};
use contract::time::TimeMs;
use legend::svg::escaped;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::annotations::AnnotationsQuery;
use crate::catalogue::{Catalogue, Layer};
use crate::edition::Edition;
use crate::error::ServerError;
use crate::extract::{NoOthers, UrlPath, UrlQuery, time};
use crate::look::LookQuery;
use crate::openapi::words;
use crate::request;
use crate::routes::tiles;
use crate::state::AppState;
use crate::surroundings::SurroundingsQuery;

/// Pixels a cell is wide at the deepest level that is offered: deeper levels would only magnify it.
const CELL_PX: f64 = 64.0;
/// Width of a tile, pixels.
const TILE_PX: f64 = 256.0;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct TileJsonQuery {
    /// Instant that the tiles show, ISO 8601 UTC.
    #[param(example = "2000-01-16T12:00:00Z")]
    time: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
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

/// The queries of tiles, in their canonical form.
struct TileQueries {
    /// What was asked for.
    asked: String,
    /// The same with version and edition, and `{time}` for the instant.
    pinned: Option<String>,
}

impl TileJsonQuery {
    /// The same query as tiles take it.
    async fn of_tiles(
        &self,
        catalogue: &Catalogue,
        layer: &Layer,
        mode: Mode,
    ) -> Result<TileQueries, ServerError> {
        self.annotations.refused_on_tiles()?;
        let time = time(self.time.as_deref())?;
        let look = self.look.parse()?;
        let options = self.surroundings.around(&look.options())?;
        // What cannot be drawn is refused here, not by every tile.
        options.style(layer.manifest.quantity, mode, layer.extent.end)?;
        let beside = self.surroundings.beside(catalogue).await?;
        let views = tiles::reference_views();
        let request = PictureRequest {
            mode,
            view: views[0],
            time,
            options,
        };
        let edition = Edition::of(layer, &request, &beside, &views).ok();
        let around = self.surroundings.of_tiles()?;
        let look: Vec<_> = look.parameters().into_iter().chain(around).collect();
        let query = |pins: Vec<String>| query_of(&[pins, look.clone()].concat());
        let named = self.manifest.as_ref().map(|_named| {
            // Named as it was found, not as it was written.
            let manifest = format!("manifest={}", layer.id);
            let edition = edition.as_ref().map(Edition::parameter);
            [Some(manifest), edition].into_iter().flatten()
        });
        let time = time.map(|time| format!("time={time}"));
        let asked = time.into_iter().chain(named.into_iter().flatten());
        let pinned = edition.as_ref().map(|edition| {
            let pins = edition.parameters("{time}", layer);
            query(pins.into())
        });
        Ok(TileQueries {
            asked: query(asked.collect()),
            pinned,
        })
    }

    /// The drawing of the colours as HTML, which is one of the two things clients take a legend for.
    fn legend(&self, origin: &str, layer: &Layer, mode: Mode) -> Result<String, ServerError> {
        // Versions of quantities that are not built in may have colours over other ranges.
        let named = self.manifest.as_ref();
        let version = named.map(|_named| format!("manifest={}", layer.id));
        let look = self.look.parse()?.parameters();
        let mut parameters: Vec<String> = version.into_iter().chain(look).collect();
        if mode == Mode::Flow {
            parameters.push(format!("mode={mode}"));
        }
        let query = query_of(&parameters);
        let product = &layer.manifest.product;
        let address = escaped(&format!(
            "{origin}/api/products/{product}/legend.svg{query}"
        ));
        // Files state it in any letters.
        let title = escaped(layer.manifest.quantity.title());
        Ok(format!("<img src=\"{address}\" alt=\"{title}\">"))
    }
}

fn query_of(parts: &[String]) -> String {
    if parts.is_empty() {
        String::new()
    } else {
        format!("?{}", parts.join("&"))
    }
}

/// TileJSON 3.0.0, and beyond it the version and the instants of the layer.
#[derive(Debug, Serialize, ToSchema)]
struct TileJson<'a> {
    /// Version of the format, `3.0.0`.
    tilejson: &'static str,
    /// For people.
    name: String,
    /// The quantity.
    description: &'a str,
    /// The source, as HTML.
    attribution: String,
    /// `xyz`.
    scheme: &'static str,
    /// Address of the tiles with `{z}`, `{x}` and `{y}`, everything that was asked for in it.
    tiles: [String; 1],
    /// The same of this version and look at any instant, with `{time}` (ISO 8601 UTC) as well: what it answers may be kept for
    /// ever. Absent where the parts of a vector do not fit together.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pinned_tiles: Option<[String; 1]>,
    /// Least zoom.
    minzoom: u8,
    /// Zoom beyond which tiles would only be magnified.
    maxzoom: u8,
    /// West, south, east, north, degrees, within the map's world.
    #[schema(value_type = (f64, f64, f64, f64))]
    bounds: [f64; 4],
    /// The drawn legend, as HTML.
    legend: String,
    /// Version.
    #[schema(value_type = String)]
    manifest: &'a ManifestId,
    /// Middles of the steps; every instant between the first and the last is valid as well.
    #[schema(value_type = Vec<String>)]
    times: Vec<TimeMs>,
}

/// What a map client needs to know of a layer: TileJSON 3.0.0 with its version and instants.
#[utoipa::path(
    get,
    path = "/tiles/{product}/{mode}.json",
    operation_id = "tilejson",
    tag = "pictures",
    params(
        ("product" = String, Path, description = "Name of the product"),
        ("mode" = words::Mode, Path, description = "How it is drawn; a product lists its modes"),
        TileJsonQuery,
        LookQuery,
        SurroundingsQuery,
    ),
    responses((status = 200, description = "The layer", body = TileJson<'static>)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath((product, file)): UrlPath<(String, String)>,
    UrlQuery(query): UrlQuery<TileJsonQuery>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let name = file
        .strip_suffix(".json")
        .ok_or(ServerError::UnknownAddress)?;
    let named = query.manifest.as_deref();
    let layer = state.catalogue.version(&product, named).await?;
    let mode = request::mode(&layer, name)?;
    let queries = query.of_tiles(&state.catalogue, &layer, mode).await?;
    let manifest = &layer.manifest;
    let origin = origin(&headers);
    let tiles = format!(
        "{origin}/tiles/{}/{mode}/{{z}}/{{x}}/{{y}}.png",
        manifest.product
    );
    let answer = TileJson {
        tilejson: "3.0.0",
        name: format!("{}, {mode}", manifest.title),
        description: manifest.quantity.title(),
        attribution: attribution(manifest.synthetic, &manifest.source),
        scheme: "xyz",
        tiles: [format!("{tiles}{}", queries.asked)],
        pinned_tiles: queries.pinned.map(|query| [format!("{tiles}{query}")]),
        minzoom: 0,
        maxzoom: max_zoom(&manifest.grid),
        bounds: bounds(&manifest.grid),
        legend: query.legend(&origin, &layer, mode)?,
        manifest: &layer.id,
        times: manifest
            .steps
            .iter()
            .map(|step| step.period.mid())
            .collect(),
    };
    Ok((
        [(header::CACHE_CONTROL, "no-cache"), (header::VARY, "host")],
        Json(answer),
    )
        .into_response())
}

/// The source as HTML, which is what clients take an attribution for.
fn attribution(synthetic: bool, source: &str) -> String {
    let source = source
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;");
    match (synthetic, source.is_empty()) {
        (true, true) => "SYNTHETIC data".to_owned(),
        (true, false) => format!("SYNTHETIC data: {source}"),
        (false, _) => source,
    }
}

/// `http://host` as the client sees this server, or nothing, which makes addresses relative to this one's.
///
/// The header comes from outside and goes into an answer: only what can be a name or an address with a port is used.
fn origin(headers: &HeaderMap) -> String {
    let host = headers
        .get(header::HOST)
        .and_then(|host| host.to_str().ok())
        .unwrap_or_default();
    let plain = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'-' | b':' | b'[' | b']');
    let safe = host.len() <= 255
        && host.bytes().all(plain)
        && host.parse::<axum::http::uri::Authority>().is_ok();
    // A proxy that speaks TLS says so; anything else it may say is of no use here.
    let secure = headers
        .get("x-forwarded-proto")
        .is_some_and(|proto| proto == "https");
    let scheme = if secure { "https" } else { "http" };
    if safe {
        format!("{scheme}://{host}")
    } else {
        String::new()
    }
}

/// The deepest level offered: a cell is at least [`CELL_PX`] pixels wide there.
fn max_zoom(grid: &Grid) -> u8 {
    let zoom = (360.0 * CELL_PX / (TILE_PX * grid.dlon_deg.min(grid.dlat_deg)))
        .log2()
        .ceil();
    zoom.clamp(0.0, f64::from(MAX_ZOOM)) as u8
}

/// West, south, east, north within the map's world; a grid across the date line is on both sides of it.
fn bounds(grid: &Grid) -> [f64; 4] {
    let [west, south, east, north] = grid.shown_bounds_deg();
    let (west, east) = if east > 180.0 {
        (-180.0, 180.0)
    } else {
        (west, east)
    };
    [
        west,
        south.clamp(-MAX_LAT_DEG, MAX_LAT_DEG),
        east,
        north.clamp(-MAX_LAT_DEG, MAX_LAT_DEG),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        rows: 180,
        cols: 360,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    #[test]
    fn finer_grids_are_offered_deeper() {
        assert_eq!(max_zoom(&GRID), 7); // 2^7 * 256 px / 360 = 91 px a degree; one level up 45
        assert_eq!(
            max_zoom(&Grid {
                dlat_deg: 1.0 / 60.0,
                dlon_deg: 1.0 / 60.0,
                ..GRID
            }),
            13
        );
        assert_eq!(
            max_zoom(&Grid {
                dlat_deg: 1e-9,
                dlon_deg: 1e-9,
                ..GRID
            }),
            MAX_ZOOM
        );
    }

    #[test]
    fn bounds_stay_on_the_map() {
        let text = |grid: &Grid| format!("{:?}", bounds(grid));
        assert_eq!(
            text(&GRID),
            format!("[-180.0, -{MAX_LAT_DEG:?}, 180.0, {MAX_LAT_DEG:?}]")
        );
        let pacific = Grid {
            rows: 10,
            cols: 20,
            north_deg: 5.0,
            west_deg: 170.0,
            ..GRID
        };
        assert_eq!(text(&pacific), "[-180.0, -5.0, 180.0, 5.0]");
    }

    #[test]
    fn only_a_plain_host_becomes_part_of_an_address() {
        let of = |host: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::HOST, host.parse().unwrap());
            origin(&headers)
        };
        assert_eq!(of("localhost:8080"), "http://localhost:8080");
        assert_eq!(of("[::1]:8080"), "http://[::1]:8080");
        for hostile in [
            "",
            "a/b",
            "a@b",
            "a b",
            "\"><script>",
            "a?b",
            "a#b",
            "a:b:c",
            "..//",
            &"a".repeat(300),
        ] {
            assert_eq!(of(hostile), "", "{hostile:?}");
        }
    }

    #[test]
    fn synthetic_data_say_so_first() {
        assert_eq!(attribution(true, "made up"), "SYNTHETIC data: made up");
        assert_eq!(
            attribution(false, "<b>T & al.</b>"),
            "&lt;b&gt;T &amp; al.&lt;/b&gt;"
        );
    }
}
