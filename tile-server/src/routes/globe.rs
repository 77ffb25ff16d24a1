//! `/globe/{product}/{mode}.png`: the globe from somewhere above, or from below the sea, as a picture of any size.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, Uri, header};
use axum::response::Response;
use contract::camera::CameraAngles;
use contract::grid::LonLatDeg;
use contract::job::{RenderJob, View};
use contract::look_at::LookAt;
use contract::picture::{PictureOptions, PictureRequest};
use serde::Deserialize;
use utoipa::IntoParams;

use crate::annotations::AnnotationsQuery;
use crate::catalogue::Layer;
use crate::edition::{Edition, Named};
use crate::error::ServerError;
use crate::extract::{NoOthers, UrlPath, UrlQuery, number, time, whole_number};
use crate::ground::GroundQuery;
use crate::look::LookQuery;
use crate::openapi::words;
use crate::request::{self, Beside};
use crate::routes::picture::{Head, Shown};
use crate::state::AppState;
use crate::surroundings::SurroundingsQuery;

/// Height that shows the whole disc with a margin, km.
const HEIGHT_KM: f64 = 15_000.0;
/// Width and height unless told otherwise, pixels.
const SIZE_PX: u32 = 512;

#[derive(Debug, Default, Deserialize, IntoParams)]
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
    #[param(value_type = Option<u32>, minimum = 1, maximum = 7680)]
    width: Option<String>,
    /// Height of the picture, pixels; 512 unless one is given.
    #[param(value_type = Option<u32>, minimum = 1, maximum = 7680)]
    height: Option<String>,
    /// Version, as answers name it, with or without its digest; the newest unless one is given.
    manifest: Option<String>,
    /// Everything else that shapes the picture, as `content-location` and the list of products name it: with `time`,
    /// `manifest` and the edition of now the answer may be kept for ever.
    #[param(example = "0123456789abcdef")]
    edition: Option<String>,
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
    #[serde(flatten)]
    #[param(ignore)]
    _others: NoOthers,
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
                ("cache-control" = String, description = "`immutable` where the address names `time`, `manifest` and the edition of now"),
                ("content-location" = String, description = "The address that names everything which shapes this picture, where the one asked does not"),
                ("fluxglobe-time" = String, description = "The instant that is shown, ISO 8601"),
                ("fluxglobe-time-covered" = String, description = "`start/end` of what there is, where another instant is shown than was asked for"),
                ("fluxglobe-heights-end" = String, description = "Accumulated carbon at which heights end, where particles are lifted by it: columns of more are drawn no higher or deeper"),
                ("fluxglobe-tilt-with-ground" = String, description = "Largest tilt that has some of the earth's surface in the picture, where this one has none: the camera looks past it, at the sky and at what rises over the horizon"),
            )),
    ),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    UrlPath((product, file)): UrlPath<(String, String)>,
    UrlQuery(query): UrlQuery<GlobeQuery>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let asked = asked(&state, &product, &file, &query).await?;
    let named = Named {
        time: asked.request.time,
        manifest: query.manifest.as_deref(),
        edition: query.edition.as_deref(),
    };
    let is_pinned = named.is_everything(|| asked.edition())?;
    let pinned = if is_pinned {
        None
    } else {
        asked.pinned_address(&uri)
    };
    let (job, shown) = (asked.job, asked.shown);
    let head = Head::of(&job, &shown, is_pinned);
    let mut response = head.answer(&state.pictures, &headers, job).await?;
    if let Some(address) = pinned {
        response
            .headers_mut()
            .insert(header::CONTENT_LOCATION, address);
    }
    Ok(response)
}

/// The job of a view, and the instant that it shows.
pub(crate) async fn job(
    state: &AppState,
    product: &str,
    file: &str,
    query: &GlobeQuery,
) -> Result<(RenderJob, Shown), ServerError> {
    let asked = asked(state, product, file, query).await?;
    Ok((asked.job, asked.shown))
}

/// What an address asks for, of which versions.
struct GlobeRequest {
    layer: Arc<Layer>,
    request: PictureRequest,
    beside: Beside,
    job: RenderJob,
    shown: Shown,
}

impl GlobeRequest {
    fn edition(&self) -> Result<Edition, ServerError> {
        let mut views = reference_views()?;
        // What is drawn over a picture depends on its camera.
        if !self.request.options.annotations.is_empty() {
            views.push(self.request.view);
        }
        Edition::of(&self.layer, &self.request, &self.beside, &views)
    }

    /// The address of the same picture for ever.
    fn pinned_address(&self, uri: &Uri) -> Option<HeaderValue> {
        let edition = self.edition().ok()?;
        let names = ["time=", "manifest=", "edition="];
        let query = uri.query().unwrap_or_default().split('&');
        let others = query.filter(|part| {
            !part.is_empty() && !names.into_iter().any(|name| part.starts_with(name))
        });
        let pins = edition.parameters(&self.shown.time.to_string(), &self.layer);
        let parts: Vec<_> = others.chain(pins.iter().map(String::as_str)).collect();
        format!("{}?{}", uri.path(), parts.join("&")).parse().ok()
    }
}

/// The views that editions go by: what is seen where an address says nothing of its camera, looks at a place, or looks
/// from below the sea.
pub(crate) fn reference_views() -> Result<Vec<View>, ServerError> {
    let looking = GlobeQuery {
        look_at: Some("10,20".to_owned()),
        tilt: Some("50".to_owned()),
        heading: Some("30".to_owned()),
        ..GlobeQuery::default()
    };
    let below = GlobeQuery {
        height_km: Some("-100".to_owned()),
        tilt: Some("180".to_owned()),
        ..GlobeQuery::default()
    };
    let all = [GlobeQuery::default(), looking, below];
    all.iter().map(GlobeQuery::view).collect()
}

/// The options of a picture at an address that says nothing of its look.
pub(crate) fn usual_options() -> Result<PictureOptions, ServerError> {
    GlobeQuery::default().options()
}

async fn asked(
    state: &AppState,
    product: &str,
    file: &str,
    query: &GlobeQuery,
) -> Result<GlobeRequest, ServerError> {
    let name = file
        .strip_suffix(".png")
        .ok_or(ServerError::UnknownAddress)?;
    let manifest = query.manifest.as_deref();
    let layer = state.catalogue.version(product, manifest).await?;
    let mode = request::mode(&layer, name)?;
    let view = query.view()?;
    let time = time(query.time.as_deref())?;
    let request = PictureRequest {
        mode,
        view,
        time,
        options: query.options()?,
    };
    let beside = query.surroundings.beside(&state.catalogue).await?;
    let job = request::job_of(&layer, &request, &beside)?;
    let shown = Shown::of(&layer, time);
    Ok(GlobeRequest {
        layer,
        request,
        beside,
        job,
        shown,
    })
}

impl GlobeQuery {
    fn options(&self) -> Result<PictureOptions, ServerError> {
        let around = self.surroundings.around(&self.look.parse()?.options())?;
        Ok(PictureOptions {
            annotations: self.annotations.wishes()?,
            ..self.ground.below(&around)?
        })
    }

    fn view(&self) -> Result<View, ServerError> {
        let pixels = |name, text: Option<&str>| {
            text.map_or(Ok(SIZE_PX), |text| {
                whole_number(name, text, "whole pixels, 1 to 7680")
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
