//! From the options of a picture to its render job: the same words and the same function as an address has.

use anyhow::{Context as _, Result, bail};
use contract::annotation::AnnotationWishes;
use contract::camera::CameraAngles;
use contract::context::Relief;
use contract::flow::northward_of;
use contract::grid::LonLatDeg;
use contract::job::{Mode, RenderJob, View};
use contract::look_at::LookAt;
use contract::manifest::Manifest;
use contract::picture::{PictureOptions, PictureRequest, PictureSources, shown_time};
use contract::time::{Period, TimeMs};
use contract::trails::{TrailSources, eastward_part, no_vector};
use serde::{Deserialize, Serialize};
use storage::Store;
use tile_server::equal_until;

use crate::cli::{Camera, GroundOptions, Picture, RenderGlobe, Settings};
use crate::{deployment, progress};

/// What pictures of the globe have and map tiles have not.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Extras {
    /// What lies below and beside the particles.
    pub(crate) ground: GroundOptions,
    /// What is drawn over the finished picture.
    pub(crate) annotations: AnnotationWishes,
}

impl Extras {
    /// Those of a picture of the globe.
    pub(crate) fn of(globe: &RenderGlobe) -> Self {
        Self {
            ground: globe.ground.options(),
            annotations: globe.annotations.wishes(),
        }
    }
}

/// The camera that looks at a place, where one is given.
pub(crate) fn look_at(camera: &Camera) -> Option<LookAt> {
    camera.look_at.map(|target| LookAt {
        target,
        distance_m: camera.distance * 1000.0,
        angles: angles(camera),
    })
}

fn angles(camera: &Camera) -> CameraAngles {
    CameraAngles {
        heading_deg: camera.heading,
        tilt_deg: camera.tilt,
        roll_deg: camera.roll,
        field_of_view_deg: camera.fov,
    }
}

/// The view that the options of a globe's picture ask for.
pub(crate) fn view_of(globe: &RenderGlobe) -> Result<View> {
    let camera = &globe.camera;
    let (width_px, height_px) = globe.size;
    if let Some(look_at) = look_at(camera) {
        return Ok(look_at.view([width_px, height_px])?);
    }
    let (Some(lon), Some(lat)) = (camera.lon, camera.lat) else {
        bail!("a picture of the globe needs a camera: --lon and --lat, or --look-at LON,LAT");
    };
    let place = LonLatDeg::new(lon, lat)?;
    Ok(View::Globe {
        lon_deg: place.lon,
        lat_deg: place.lat,
        height_m: camera.height * 1000.0,
        width_px,
        height_px,
        angles: angles(camera),
    })
}

/// The job that the options of a picture ask for, over the newest version of its product.
pub(crate) async fn job(
    store: &Store,
    settings: &Settings,
    picture: &Picture,
    view: View,
    extras: Extras,
) -> Result<RenderJob> {
    let product = product(store, settings, picture).await?;
    let shown = shown_time(&product, picture.time)?;
    if let Some(time) = picture.time
        && let Some(Period { start, end }) = product.extent()
        && shown != time
    {
        progress::say(&format!(
            "{} covers {start} to {end} and has nothing of {time}; shown is {shown}",
            product.product
        ));
    }
    let northward = northward(store, &product, picture.mode).await?;
    let lift = lift(store, &product, picture.mode, shown).await?;
    let vector = vector(store, picture).await?;
    let sources = PictureSources {
        product: &product,
        accumulated: lift.as_ref().and_then(|lift| lift.at(shown)),
        northward: northward.as_ref(),
        trails: vector.as_ref().map(Vector::trails),
        relief: relief(store, settings, picture).await?,
    };
    let request = PictureRequest {
        mode: picture.mode,
        view,
        time: picture.time,
        options: options(picture, extras),
    };
    Ok(request.job(&sources)?)
}

/// What the options of a picture ask of its look.
pub(crate) fn options(picture: &Picture, extras: Extras) -> PictureOptions {
    let surroundings = &picture.surroundings;
    PictureOptions {
        transfer: picture.look.options(),
        uncertainty: picture.uncertainty,
        slices: picture.slices,
        particles_per_cell: picture.particles,
        height_m_per_kg_m2: surroundings.height_exaggeration,
        sea_opacity: Some(surroundings.sea_opacity),
        coastlines: surroundings.coastlines,
        borders: extras.ground.borders,
        sea_floor: extras.ground.sea_floor,
        mask_land: extras.ground.mask_land,
        base_map: extras.ground.base_map,
        background: extras.ground.background,
        isolines: surroundings.isolines,
        sun: surroundings.sun,
        globe_surface: extras.ground.surface,
        annotations: extras.annotations,
    }
}

/// The newest version of the relief that a picture asks for.
pub(crate) async fn relief(
    store: &Store,
    settings: &Settings,
    picture: &Picture,
) -> Result<Option<Relief>> {
    let options = &picture.surroundings;
    let Some(product) = &options.relief else {
        return Ok(None);
    };
    let elevation = deployment::manifest(store, product, &settings.data).await?;
    Ok(Some(Relief::of(&elevation, options.relief_exaggeration)?))
}

/// The versions of both parts of a vector whose trails are drawn, and the instant if it is not the picture's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Vector {
    eastward: Manifest,
    northward: Manifest,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    time: Option<TimeMs>,
}

impl Vector {
    pub(crate) fn trails(&self) -> TrailSources<'_> {
        TrailSources {
            eastward: &self.eastward,
            northward: &self.northward,
            time: self.time,
        }
    }
}

/// The newest versions of the vector whose trails a picture asks for.
pub(crate) async fn vector(store: &Store, picture: &Picture) -> Result<Option<Vector>> {
    let options = &picture.surroundings;
    let Some(named) = &options.trails else {
        return Ok(None);
    };
    let part = eastward_part(named)?;
    let eastward = storage::manifests::latest(store, &part).await?;
    let northward = match eastward.as_ref().and_then(northward_of) {
        Some(part) => storage::manifests::latest(store, &part).await?,
        None => None,
    };
    let (Some(eastward), Some(northward)) = (eastward, northward) else {
        return Err(no_vector(named).into());
    };
    Ok(Some(Vector {
        eastward,
        northward,
        time: options.trails_time,
    }))
}

/// The newest version of a picture's product.
pub(crate) async fn product(
    store: &Store,
    settings: &Settings,
    picture: &Picture,
) -> Result<Manifest> {
    deployment::manifest(store, &picture.layer, &settings.data).await
}

/// The northward part of the vector whose eastward part a product is, if the mode needs one.
pub(crate) async fn northward(
    store: &Store,
    eastward: &Manifest,
    mode: Mode,
) -> Result<Option<Manifest>> {
    if mode != Mode::Flow {
        return Ok(None);
    }
    let name = &eastward.product;
    let product = contract::flow::northward_of(eastward).with_context(|| {
        format!("{name} is not drawn as a flow: name the eastward part of a current, NAME-east, which has landed beside NAME-north")
    })?;
    let latest = storage::manifests::latest(store, &product).await?;
    let latest = latest.with_context(|| {
        format!("{name} is not drawn as a flow before {product} has landed; ingest the same files with its profile")
    })?;
    Ok(Some(latest))
}

/// Accumulated carbon that lifts the particles of a version.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Lift {
    pub(crate) manifest: Manifest,
    /// The last instant at which it holds for that version: none if it was derived from exactly that one.
    pub(crate) until: Option<TimeMs>,
}

impl Lift {
    /// It, where it holds.
    fn at(&self, time: TimeMs) -> Option<&Manifest> {
        let holds = self.until.is_none_or(|until| time <= until);
        holds.then_some(&self.manifest)
    }
}

/// What lifts the particles of a version in a mode, as a server has it: the newest accumulated carbon, that of a version before as far as
/// nothing changed that it was summed from. It is said where none of it holds at `last`, the latest instant that is shown.
pub(crate) async fn lift(
    store: &Store,
    manifest: &Manifest,
    mode: Mode,
    last: TimeMs,
) -> Result<Option<Lift>> {
    let (Ok(product), false) = (
        manifest.product.accumulated(),
        matches!(mode, Mode::Map | Mode::Flow),
    ) else {
        return Ok(None);
    };
    let Some(derived) = storage::manifests::latest(store, &product).await? else {
        return Ok(None);
    };
    let Some(source) = derived.derived_from.clone() else {
        return Ok(None);
    };
    let own = manifest.id();
    if source == own {
        return Ok(Some(Lift {
            manifest: derived,
            until: None,
        }));
    }
    // One that was cleaned up cannot be compared.
    let before = storage::manifests::load(store, &source).await.ok();
    let until = before.and_then(|before| equal_until(&before, manifest));
    if until.is_none_or(|until| until < last) {
        let since = until.map_or_else(String::new, |until| format!(" after {until}"));
        let name = &manifest.product;
        progress::say(&format!(
            "{product} was added up from {source}, and nothing lifts the particles of {own}{since}: `fluxglobe derive accumulated --product {name}` brings it up to date"
        ));
    }
    Ok(until.map(|until| Lift {
        manifest: derived,
        until: Some(until),
    }))
}

/// Accumulated carbon of just this version of a product, if it was derived.
pub(crate) async fn accumulated(store: &Store, manifest: &Manifest) -> Result<Option<Manifest>> {
    let Ok(product) = manifest.product.accumulated() else {
        return Ok(None);
    };
    let latest = storage::manifests::latest(store, &product).await?;
    Ok(latest.filter(|derived| derived.derived_from == Some(manifest.id())))
}
