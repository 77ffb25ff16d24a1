//! `fluxglobe render`: a product, an instant and a view in, a PNG file out.

use anyhow::{Context as _, Result};
use contract::colour::TransferFunction;
use contract::job::{Mode, RenderJob, Style, View};
use contract::manifest::Manifest;
use contract::tile::Tile;
use contract::time::Period;
use storage::Store;

use crate::cli::{Picture, Render, RenderGlobe, Settings};
use crate::{animation, deployment, progress};

pub(crate) async fn run(settings: &Settings, options: Render) -> Result<()> {
    let store = deployment::store(settings)?;
    let (picture, view, surface) = match options {
        Render::Tile(tile) => {
            let address = Tile::new(tile.z, tile.x, tile.y)?;
            (
                tile.picture,
                View::Tile {
                    tile: address,
                    size_px: tile.size,
                },
                false,
            )
        }
        Render::Globe(globe) => {
            let view = view_of(&globe);
            (globe.picture, view, !globe.transparent)
        }
        Render::Animation(animation) => return animation::run(settings, store, animation).await,
    };
    let mut job = job(&store, settings, &picture, view).await?;
    job.style.globe_surface = surface;
    job.validate()?;
    let bar = progress::bar("draw", 1);
    let png = deployment::single_renderer(settings, store)
        .await?
        .draw(&job)
        .await?;
    std::fs::write(&picture.output, &png)
        .with_context(|| format!("cannot write {}", picture.output.display()))?;
    progress::done(&bar, &format!("{} bytes", png.len()));
    progress::result(&picture.output.display().to_string())
}

/// The view that the options of a globe's picture ask for.
pub(crate) fn view_of(globe: &RenderGlobe) -> View {
    View::Globe {
        lon_deg: globe.lon,
        lat_deg: globe.lat,
        height_m: globe.height * 1000.0,
        width_px: globe.size.0,
        height_px: globe.size.1,
    }
}

/// The job that the options of a picture ask for, over the newest version of its product.
pub(crate) async fn job(
    store: &Store,
    settings: &Settings,
    picture: &Picture,
    view: View,
) -> Result<RenderJob> {
    let manifest = product(store, settings, picture).await?;
    let last = manifest.steps.last().context("the product has no step")?;
    let style = style(&manifest, picture);
    let time = picture.time.unwrap_or(last.period.mid());
    if let Some(Period { start, end }) = manifest.extent()
        && (time < start || time > end)
    {
        let shown = time.clamp(start, end);
        progress::say(&format!(
            "{} covers {start} to {end} and has nothing of {time}; shown is {shown}",
            manifest.product
        ));
    }
    if let Some(part) = northward(store, &manifest, picture.mode).await? {
        return Ok(RenderJob::of_flow(&manifest, &part, time, view, style)?);
    }
    let lift = accumulated(store, &manifest).await?;
    let job = RenderJob::of(&manifest, lift.as_ref(), time, picture.mode, view, style)?;
    Ok(job)
}

/// The newest version of a picture's product.
pub(crate) async fn product(
    store: &Store,
    settings: &Settings,
    picture: &Picture,
) -> Result<Manifest> {
    deployment::manifest(store, &picture.layer, &settings.data).await
}

/// The style that the options of a picture ask for.
pub(crate) fn style(product: &Manifest, picture: &Picture) -> Style {
    let mut style = match picture.mode {
        Mode::Flow => Style::of_flow(product.quantity),
        Mode::Map | Mode::Points | Mode::Sprites | Mode::Volume => {
            Style::with_transfer(TransferFunction::default_for(product.quantity))
        }
    };
    style.slices = picture.slices.unwrap_or(style.slices);
    style.particles_per_cell = picture.particles.unwrap_or(style.particles_per_cell);
    style
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

/// Accumulated carbon of just this version of a product, if it was derived.
pub(crate) async fn accumulated(store: &Store, manifest: &Manifest) -> Result<Option<Manifest>> {
    let Ok(product) = manifest.product.accumulated() else {
        return Ok(None);
    };
    let latest = storage::manifests::latest(store, &product).await?;
    Ok(latest.filter(|derived| derived.derived_from == Some(manifest.id())))
}
