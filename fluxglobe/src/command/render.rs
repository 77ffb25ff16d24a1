//! `fluxglobe render`: a product, an instant and a view in, a PNG file out.

use anyhow::{Context as _, Result};
use contract::context::{Context, Relief};
use contract::job::{Mode, RenderJob, Style, View};
use contract::manifest::Manifest;
use contract::tile::Tile;
use contract::time::{Period, TimeMs};
use render_worker::desk::{Order, Storing};
use storage::Store;

use crate::cli::{Picture, Render, RenderGlobe, Settings};
use crate::command::legend;
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
        Render::Legend(options) => return legend::run(settings, &store, &options).await,
    };
    let mut job = job(&store, settings, &picture, view).await?;
    job.style.globe_surface = surface;
    job.validate()?;
    let bar = progress::bar("draw", 1);
    let desk = deployment::single_desk(settings, store).await?;
    let order = Order::on_demand(Storing::Nothing);
    let png = desk.draw(&job, order).await?.png;
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
    let style = style(&manifest, picture)?;
    let time = picture.time.unwrap_or(last.period.mid());
    let extent = manifest.extent();
    let shown = extent.map_or(time, |Period { start, end }| time.clamp(start, end));
    if let Some(Period { start, end }) = extent
        && shown != time
    {
        progress::say(&format!(
            "{} covers {start} to {end} and has nothing of {time}; shown is {shown}",
            manifest.product
        ));
    }
    let style = sunlit(style, picture, shown);
    let job = if let Some(part) = northward(store, &manifest, picture.mode).await? {
        RenderJob::of_flow(&manifest, &part, time, view, style)?
    } else {
        let lift = accumulated(store, &manifest).await?;
        RenderJob::of(&manifest, lift.as_ref(), time, picture.mode, view, style)?
    };
    Ok(job.over(relief(store, settings, picture).await?)?)
}

/// The style with the sun that a picture of this instant asks for.
pub(crate) fn sunlit(mut style: Style, picture: &Picture, time: TimeMs) -> Style {
    if let Some(choice) = picture.surroundings.sun {
        style.sun = choice.instead_of(style.sun, time);
    }
    style
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

/// The newest version of a picture's product.
pub(crate) async fn product(
    store: &Store,
    settings: &Settings,
    picture: &Picture,
) -> Result<Manifest> {
    deployment::manifest(store, &picture.layer, &settings.data).await
}

/// The style that the options of a picture ask for.
pub(crate) fn style(product: &Manifest, picture: &Picture) -> Result<Style> {
    let (options, quantity) = (picture.look.options(), product.quantity);
    let mut style = match picture.mode {
        Mode::Flow => Style::of_flow(options.over_speed(quantity)?),
        Mode::Map | Mode::Points | Mode::Sprites | Mode::Volume => {
            Style::with_transfer(options.over(quantity)?)
        }
    };
    style.slices = picture.slices.unwrap_or(style.slices);
    style.particles_per_cell = picture.particles.unwrap_or(style.particles_per_cell);
    style.doubt = picture.doubt;
    let options = &picture.surroundings;
    let height_m = options.height_exaggeration;
    style.height_m_per_kg_m2 = height_m.unwrap_or(style.height_m_per_kg_m2);
    style.context = Context {
        sea_opacity: options.sea_opacity,
        coastlines: options.coastlines,
    };
    Ok(style)
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
