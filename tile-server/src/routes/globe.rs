//! `/globe/{product}/{mode}.png`: the globe from somewhere above, or from below the sea, as a picture of any size.

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use contract::camera::CameraAngles;
use contract::grid::LonLatDeg;
use contract::job::{RenderJob, View};
use contract::look_at::LookAt;
use contract::picture::PictureRequest;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::annotations::AnnotationsQuery;
use crate::error::ServerError;
use crate::extract::{UrlPath, UrlQuery, number, time, whole_number};
use crate::ground::GroundQuery;
use crate::look::LookQuery;
use crate::openapi::words;
use crate::request;
use crate::routes::picture::{self, Shown};
use crate::state::AppState;
use crate::surroundings::SurroundingsQuery;

/// Height that shows the whole disc with a margin, km.
const HEIGHT_KM: f64 = 15_000.0;
/// Width and height unless told otherwise, pixels.
const SIZE_PX: u32 = 512;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(crate) struct GlobeQuery {
    /// Longitude below the camera, degrees east; 0 unless one is given. Not with `look_at`.
    #[param(value_type = Option<f64>)]
    lon: Option<String>,
    /// Latitude below the camera, degrees north; 0 unless one is given. Not with `look_at`.
    #[param(value_type = Option<f64>, minimum = -90, maximum = 90)]
    lat: Option<String>,
    /// Height of the camera above the ground, km, 1 to 1e6, or below the sea surface, -1 to -1000, among what sank as deep
    /// as it is drawn; 15000 unless one is given. Not with `look_at`.
    #[param(value_type = Option<f64>, minimum = -1000, maximum = 1e6)]
    height_km: Option<String>,
    /// `LON,LAT`: the place in the middle of the picture, instead of the one below the camera; `tilt` is then that of the
    /// line of sight against the vertical there: 0 from straight above, 180 from straight below through the sea.
    #[param(example = "-95,0")]
    look_at: Option<String>,
    /// From the camera to the place that is looked at, km; 15000 unless one is given. Only with `look_at`.
    #[param(value_type = Option<f64>, minimum = 1, maximum = 1e6)]
    distance_km: Option<String>,
    /// Direction of view, clockwise from north, degrees; 0 unless one is given.
    #[param(value_type = Option<f64>, minimum = -360, maximum = 360)]
    heading: Option<String>,
    /// 0 looks straight down, 90 along the ground, 180 straight up, degrees; 0 unless one is given. With `look_at` 0 to 90,
    /// or more from below the sea surface.
    #[param(value_type = Option<f64>, minimum = 0, maximum = 180)]
    tilt: Option<String>,
    /// Lean of the camera to the right, degrees; 0 unless one is given.
    #[param(value_type = Option<f64>, minimum = -180, maximum = 180)]
    roll: Option<String>,
    /// Field of view across the shorter side of the picture, degrees; 45 unless one is given.
    #[param(value_type = Option<f64>, minimum = 1, maximum = 120)]
    fov: Option<String>,
    /// Instant, ISO 8601 UTC (a year, month or day means its start); the middle of the last step unless one is given.
    #[param(example = "2000-01-16T12:00:00Z")]
    time: Option<String>,
    /// Width of the picture, pixels; 512 unless one is given.
    #[param(value_type = Option<u32>, minimum = 1, maximum = 4096)]
    width: Option<String>,
    /// Height of the picture, pixels; 512 unless one is given.
    #[param(value_type = Option<u32>, minimum = 1, maximum = 4096)]
    height: Option<String>,
    /// Version, as answers name it; the newest unless one is given.
    manifest: Option<String>,
    #[serde(flatten)]
    #[param(ignore)]
    look: LookQuery,
    #[serde(flatten)]
    #[param(ignore)]
    surroundings: SurroundingsQuery,
    #[serde(flatten)]
    #[param(ignore)]
    ground: GroundQuery,
    #[serde(flatten)]
    #[param(ignore)]
    annotations: AnnotationsQuery,
}

/// The globe from a camera over a place or looking at one, as a PNG of any size.
#[utoipa::path(
    get,
    path = "/globe/{product}/{mode}.png",
    operation_id = "globe_view",
    tag = "pictures",
    params(
        ("product" = String, Path, description = "Name of the product"),
        ("mode" = words::Mode, Path, description = "How it is drawn; a product lists its modes"),
        GlobeQuery,
        LookQuery,
        SurroundingsQuery,
        GroundQuery,
        AnnotationsQuery,
    ),
    responses(
        (status = 200, description = "The view", content(("image/png")),
            headers(
                ("etag" = String, description = "Names the job: the same tag is the same picture, byte for byte"),
                ("fluxglobe-time" = String, description = "The instant that is shown, ISO 8601"),
                ("fluxglobe-time-covered" = String, description = "`start/end` of what there is, where another instant is shown than was asked for"),
            )),
        (status = 304, description = "The copy that `If-None-Match` names is still right"),
    ),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath((product, file)): UrlPath<(String, String)>,
    UrlQuery(query): UrlQuery<GlobeQuery>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let (job, shown) = job(&state, &product, &file, &query).await?;
    picture::respond(&state, &headers, job, shown).await
}

/// The job of a view, and the instant that it shows.
pub(crate) async fn job(
    state: &AppState,
    product: &str,
    file: &str,
    query: &GlobeQuery,
) -> Result<(RenderJob, Shown), ServerError> {
    let name = file
        .strip_suffix(".png")
        .ok_or(ServerError::UnknownAddress)?;
    let manifest = query.manifest.as_deref();
    let layer = state.catalogue.version(product, manifest).await?;
    let mode = request::mode(&layer, name)?;
    let view = query.view()?;
    let time = time(query.time.as_deref())?;
    let mut options = query.surroundings.around(&query.look.parse()?.options())?;
    options = query.ground.below(&options)?;
    options.annotations = query.annotations.wishes()?;
    let request = PictureRequest {
        mode,
        view,
        time,
        options,
    };
    let beside = query.surroundings.beside(&state.catalogue).await?;
    let job = request::job_of(&layer, &request, beside)?;
    Ok((job, Shown::of(&layer, time)))
}

impl GlobeQuery {
    fn view(&self) -> Result<View, ServerError> {
        let pixels = |name, text: Option<&str>| {
            text.map_or(Ok(SIZE_PX), |text| {
                whole_number(name, text, "whole pixels, 1 to 4096")
            })
        };
        let size_px = [
            pixels("width", self.width.as_deref())?,
            pixels("height", self.height.as_deref())?,
        ];
        let angles = self.angles()?;
        let Some(target) = self.look_at.as_deref() else {
            return self.standing_over(angles, size_px);
        };
        for (name, given) in [
            ("lon", &self.lon),
            ("lat", &self.lat),
            ("height_km", &self.height_km),
        ] {
            if let Some(text) = given {
                let valid = "either the place below the camera, or look_at with distance_km";
                return Err(ServerError::invalid(name, text, valid));
            }
        }
        let look_at = LookAt {
            target: target.parse()?,
            distance_m: 1000.0
                * real(
                    "distance_km",
                    self.distance_km.as_deref(),
                    HEIGHT_KM,
                    "kilometres from the place, 1 to 1e6",
                )?,
            angles,
        };
        Ok(look_at.view(size_px)?)
    }

    fn angles(&self) -> Result<CameraAngles, ServerError> {
        let usual = CameraAngles::NADIR;
        Ok(CameraAngles {
            heading_deg: real(
                "heading",
                self.heading.as_deref(),
                usual.heading_deg,
                "degrees clockwise from north, -360 to 360",
            )?,
            tilt_deg: real(
                "tilt",
                self.tilt.as_deref(),
                usual.tilt_deg,
                "degrees from straight down, 0 to 180",
            )?,
            roll_deg: real(
                "roll",
                self.roll.as_deref(),
                usual.roll_deg,
                "degrees, -180 to 180",
            )?,
            field_of_view_deg: real(
                "fov",
                self.fov.as_deref(),
                usual.field_of_view_deg,
                "degrees across the shorter side, 1 to 120",
            )?,
        })
    }

    fn standing_over(
        &self,
        angles: CameraAngles,
        [width_px, height_px]: [u32; 2],
    ) -> Result<View, ServerError> {
        if let Some(text) = &self.distance_km {
            let valid = "only with look_at=LON,LAT; height_km is that above the ground";
            return Err(ServerError::invalid("distance_km", text, valid));
        }
        let place = LonLatDeg::new(
            real("lon", self.lon.as_deref(), 0.0, "degrees east")?,
            real("lat", self.lat.as_deref(), 0.0, "degrees north, -90 to 90")?,
        )?;
        Ok(View::Globe {
            lon_deg: place.lon,
            lat_deg: place.lat,
            height_m: 1000.0
                * real(
                    "height_km",
                    self.height_km.as_deref(),
                    HEIGHT_KM,
                    "kilometres above the ground, 1 to 1e6, or below the sea surface, -1 to -1000",
                )?,
            width_px,
            height_px,
            angles,
        })
    }
}

fn real(
    name: &'static str,
    text: Option<&str>,
    default: f64,
    valid: &'static str,
) -> Result<f64, ServerError> {
    text.map_or(Ok(default), |text| number(name, text, valid))
}
