//! `fluxglobe render animation`: a product, a span of time and a camera in, a film or a folder of pictures out.
//!
//! Every picture is a job like any other, so it is the same bytes wherever it is drawn and however often.

mod duration;
mod encoder;
mod film;
mod folder;
mod path;
mod shots;
mod strip;

use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use bytes::Bytes;
use contract::encoding::Encoding;
use contract::job::View;
use contract::manifest::Manifest;
use contract::picture::shown_time;
use contract::sun::SunChoice;
use contract::time::TimeMs;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use indicatif::ProgressBar;
use prometheus::Registry;
use render_worker::Limits;
use render_worker::fleet::{Fleet, FleetSettings, LARGE_PIXELS};
use storage::Store;
use tile_server::backend::{Draw, Keep, Turn};

use crate::cli::{RenderAnimation, Settings};
use crate::picture::Extras;
use crate::ports::{Drawer, FleetDrawer};
use crate::{deployment, heights, picture, progress, sky};
use duration::Pace;
use film::Film;
use path::CameraPath;
use shots::Shots;

/// Length of a film unless told otherwise.
const USUAL_SECONDS: f64 = 12.0;
/// Longest wait for one picture of a busy fleet, milliseconds.
const DEADLINE_MS: u32 = 120_000;
/// A worker that takes longer than this has the next one asked too, milliseconds.
const HEDGE_MS: u32 = 20_000;

pub(crate) async fn run(settings: &Settings, store: Store, options: RenderAnimation) -> Result<()> {
    if options.globe.picture.time.is_some() {
        bail!("an animation has no one --time: give --from and --to");
    }
    film::check(&options)?;
    let shots = Arc::new(shots(settings, &store, &options).await?);
    let jobs = (0..shots.count()).map(|number| shots.job(number));
    let jobs = jobs.collect::<Result<Vec<_>>>()?;
    let views: Vec<View> = jobs.iter().map(|job| job.view).collect();
    let notes = [
        sky::note_of_film(&views),
        heights::note_of_film(&store, &jobs).await?,
    ];
    for note in notes.into_iter().flatten() {
        progress::say(&note);
    }
    let drawer = drawer(settings, store, &options).await?;
    let mut film = Film::open(&options, &shots)?;
    let missing = film.missing(&shots)?;
    let bar = progress::bar("draw", shots.count().into());
    bar.inc(u64::from(shots.count()) - missing.len() as u64);
    let mut pace = Pace::new(missing.len(), options.at_once);
    let drawn = stream::iter(missing)
        .map(|number| {
            let (drawer, shots) = (Arc::clone(&drawer), Arc::clone(&shots));
            async move {
                let job = shots.job(number)?;
                let png = drawer
                    .draw(&job, Keep::No, Encoding::Png, Turn::default())
                    .await;
                let time = shots.time(number)?;
                let png = png.with_context(|| format!("picture {number}, {time}"))?;
                anyhow::Ok((number, png))
            }
        })
        // In order, whoever is done first.
        .buffered(usize::from(options.at_once));
    let drawn: Result<()> = drawn
        .try_fold(
            (&mut film, &mut pace),
            |(film, pace), (number, png): (u32, Bytes)| {
                let bar = &bar;
                async move {
                    film.add(number, png).await?;
                    bar.inc(1);
                    tell_rest(bar, pace);
                    Ok((film, pace))
                }
            },
        )
        .await
        .map(|_film| ());
    if let Err(error) = drawn {
        film.abandon().await;
        return Err(error);
    }
    let bytes = film.finish().await?;
    let outcome = format!("{} pictures, {bytes} bytes", shots.count());
    progress::done(&bar, &outcome);
    progress::result(&options.globe.picture.output.display().to_string())
}

/// Says how long the pictures to come take: beside the bar, and in one line where nobody sees a bar.
fn tell_rest(bar: &ProgressBar, pace: &mut Pace) {
    let Some(rest) = pace.picture(Instant::now()) else {
        return;
    };
    let said = duration::left(rest);
    if bar.is_hidden() && pace.is_told(rest) {
        progress::say(&said);
    }
    bar.set_message(said);
}

async fn shots(settings: &Settings, store: &Store, options: &RenderAnimation) -> Result<Shots> {
    let globe = &options.globe;
    let path = path(options)?;
    let size_px = [globe.size.0, globe.size.1];
    let view = match &path {
        Some(path) => path.view(0.0, size_px)?,
        None => picture::view_of(globe)?,
    };
    let product = picture::product(store, settings, &globe.picture).await?;
    let (from, to) = span(&product, options.from, options.to)?;
    let sun_of_time = globe.picture.surroundings.sun == Some(SunChoice::OfTime);
    let mut asked = picture::options(&globe.picture, Extras::of(globe));
    if sun_of_time {
        // Each picture has its own.
        asked.sun = None;
    }
    let style = asked.style_in(&view, product.quantity, globe.picture.mode, from)?;
    let last = shown_time(&product, Some(to))?;
    let lift = picture::lift(store, &product, globe.picture.mode, last).await?;
    let shots = Shots {
        accumulated_until: lift.as_ref().and_then(|lift| lift.until),
        accumulated: lift.map(|lift| lift.manifest),
        northward: picture::northward(store, &product, globe.picture.mode).await?,
        product,
        from,
        to,
        mode: globe.picture.mode,
        view,
        style,
        sun_of_time,
        annotations: asked.annotations,
        vector: picture::vector(store, &globe.picture).await?,
        relief: picture::relief(store, settings, &globe.picture).await?,
        fps: options.fps,
        count: Shots::count_of(seconds(options, path.as_ref()), options.fps)?,
        turn_deg: options.turn,
        path,
    };
    shots.validate()?;
    Ok(shots)
}

/// The way of the camera, if it has one.
fn path(options: &RenderAnimation) -> Result<Option<CameraPath>> {
    if let Some(file) = &options.key_frames {
        return Ok(Some(CameraPath::read(file)?));
    }
    let (Some(turn_deg), Some(look_at)) = (options.orbit, picture::look_at(&options.globe.camera))
    else {
        return Ok(None);
    };
    let path = CameraPath::orbit(&look_at, turn_deg, seconds(options, None))?;
    Ok(Some(path))
}

/// Length of the film: that asked for, else that of the camera's way.
fn seconds(options: &RenderAnimation, path: Option<&CameraPath>) -> f64 {
    let of_path = path.map_or(USUAL_SECONDS, CameraPath::seconds);
    options.seconds.unwrap_or(of_path)
}

/// The span of an animation, which must lie within a product's in part.
fn span(manifest: &Manifest, from: Option<TimeMs>, to: Option<TimeMs>) -> Result<(TimeMs, TimeMs)> {
    let [Some(first), Some(last)] = [manifest.steps.first(), manifest.steps.last()] else {
        bail!("{} has no step", manifest.product);
    };
    let covered = (first.period.start, last.period.end);
    let (from, to) = (from.unwrap_or(covered.0), to.unwrap_or(covered.1));
    if from >= to {
        bail!("an animation goes forward in time: {from} is not before {to}");
    }
    if to <= covered.0 || from >= covered.1 {
        bail!(
            "{} covers {} to {}, nothing of {from} to {to}",
            manifest.product,
            covered.0,
            covered.1
        );
    }
    Ok((from, to))
}

/// What draws: render workers if any are given, else the renderer in this process.
async fn drawer(
    settings: &Settings,
    store: Store,
    options: &RenderAnimation,
) -> Result<Arc<dyn Draw>> {
    if options.render_workers.is_empty() {
        let limits = Limits::default();
        let desk = deployment::desk(settings, store, limits, &Registry::new()).await?;
        let adapters = desk.pipeline().renderer().adapters();
        let adapters = adapters.iter().map(|one| (one.name(), one.is_software()));
        if let Some(note) = duration::note(adapters) {
            progress::say(&note);
        }
        return Ok(Arc::new(Drawer::new(desk)));
    }
    let fleet = FleetSettings {
        render_workers: options.render_workers.clone(),
        render_deadline_ms: DEADLINE_MS,
        render_hedge_ms: HEDGE_MS,
        render_in_flight: options.at_once,
        render_parts_above: LARGE_PIXELS,
    };
    let fleet = Fleet::start(&fleet, store, &Registry::new())?;
    Ok(Arc::new(FleetDrawer(fleet)))
}

#[cfg(test)]
mod tests;
