//! `/globe/{product}/{mode}.png`: the globe from somewhere above, as a picture of any size.

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::job::View;
use contract::picture::PictureRequest;
use serde::Deserialize;

use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, number, time, whole_number};
use crate::look::LookQuery;
use crate::request;
use crate::routes::picture::{self, Shown};
use crate::state::AppState;
use crate::surroundings::SurroundingsQuery;

/// Height that shows the whole disc with a margin, km.
const HEIGHT_KM: f64 = 15_000.0;
/// Width and height unless told otherwise, pixels.
const SIZE_PX: u32 = 512;

#[derive(Debug, Deserialize)]
pub(crate) struct GlobeQuery {
    lon: Option<String>,
    lat: Option<String>,
    height_km: Option<String>,
    time: Option<String>,
    width: Option<String>,
    height: Option<String>,
    surface: Option<String>,
    manifest: Option<String>,
    #[serde(flatten)]
    look: LookQuery,
    #[serde(flatten)]
    surroundings: SurroundingsQuery,
}

pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath((product, file)): UrlPath<(String, String)>,
    UrlQuery(query): UrlQuery<GlobeQuery>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let name = file
        .strip_suffix(".png")
        .ok_or(ServerError::UnknownAddress)?;
    let manifest = query.manifest.as_deref();
    let layer = state.catalogue.version(&product, manifest).await?;
    let mode = request::mode(&layer, name)?;
    let view = query.view()?;
    let time = time(query.time.as_deref())?;
    let mut options = query.surroundings.around(query.look.parse()?.options())?;
    options.globe_surface = match query.surface.as_deref() {
        None | Some("true") => true,
        Some("false") => false,
        Some(text) => return Err(ServerError::invalid("surface", text, "true or false")),
    };
    let request = PictureRequest {
        mode,
        view,
        time,
        options,
    };
    let relief = query.surroundings.relief(&state.catalogue).await?;
    let job = request::job_of(&layer, &request, relief)?;
    let shown = Shown::of(&layer, time);
    picture::respond(&state, &headers, job, shown).await
}

impl GlobeQuery {
    fn view(&self) -> Result<View, ServerError> {
        let real = |name, text: &Option<String>, default: f64, valid| {
            text.as_deref()
                .map_or(Ok(default), |text| number(name, text, valid))
        };
        let pixels = |name, text: &Option<String>| {
            text.as_deref().map_or(Ok(SIZE_PX), |text| {
                whole_number(name, text, "whole pixels, 1 to 4096")
            })
        };
        let place = contract::grid::LonLatDeg::new(
            real("lon", &self.lon, 0.0, "degrees east")?,
            real("lat", &self.lat, 0.0, "degrees north, -90 to 90")?,
        )?;
        Ok(View::Globe {
            lon_deg: place.lon,
            lat_deg: place.lat,
            height_m: 1000.0
                * real(
                    "height_km",
                    &self.height_km,
                    HEIGHT_KM,
                    "kilometres above the ground, 1 to 1e6",
                )?,
            width_px: pixels("width", &self.width)?,
            height_px: pixels("height", &self.height)?,
        })
    }
}
