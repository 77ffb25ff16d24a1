//! Tiles of a product in a period: which are not stored, and drawing them here or on the render workers.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use contract::event::{Body, Event};
use contract::job::{Mode, RenderJob, View};
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::tile::Tile;
use contract::topic::Topic;
use render_worker::desk::{Order, Origin, Storing};
use storage::log::{EventLog, Start};
use storage::{Store, manifests, verify};
use tile_server::{Accumulated, Layer, picture_job};

use crate::cli::{Recompute, Settings};
use crate::{deployment, progress};

/// Jobs appended at once, and messages looked at together.
const AT_ONCE: usize = 64;
const POLL: Duration = Duration::from_millis(250);
/// Render workers that draw nothing for so long are not there.
const SILENCE: Duration = Duration::from_mins(5);
const TILE_PX: u32 = 256;

/// Pictures of a plan.
#[derive(Default)]
pub(super) struct Tiles {
    pub(super) missing: Vec<RenderJob>,
    pub(super) there: usize,
}

/// Volume tiles of every zoom level down to the one asked for, in the middle of every step of the period.
pub(super) async fn plan(store: &Store, options: &Recompute) -> Result<Tiles> {
    let Some(manifest) = manifests::latest(store, &options.product).await? else {
        return Ok(Tiles::default());
    };
    let Some(extent) = manifest.extent() else {
        return Ok(Tiles::default());
    };
    let id = manifest.id();
    let accumulated = match manifest.product.accumulated() {
        Ok(product) => manifests::latest(store, &product).await?,
        Err(_too_long) => None,
    };
    let accumulated = accumulated.filter(|derived| derived.derived_from.as_ref() == Some(&id));
    let layer = Layer {
        id,
        extent,
        accumulated: accumulated.map(|derived| Accumulated::new(derived.id(), derived.into())),
        northward: None,
        manifest: manifest.into(),
    };
    let mut stored: BTreeSet<ObjectKey> =
        store.list(Kind::Tile.folder()).await?.into_iter().collect();
    if options.verify {
        let damaged = verify::damaged(store, stored.iter().cloned()).await?;
        stored.retain(|tile| !damaged.contains(tile));
    }
    let mut tiles = Tiles::default();
    for step in &layer.manifest.steps {
        let time = step.period.mid();
        if options.from.is_some_and(|from| time < from) || options.to.is_some_and(|to| time >= to) {
            continue;
        }
        for tile in addresses(options.zoom)? {
            let view = View::Tile {
                tile,
                size_px: TILE_PX,
            };
            let job = picture_job(&layer, Mode::Volume, view, Some(time))?;
            if !options.force && stored.contains(&job.key()) {
                tiles.there += 1;
            } else {
                tiles.missing.push(job);
            }
        }
    }
    Ok(tiles)
}

fn addresses(zoom: u8) -> Result<Vec<Tile>> {
    let mut all = vec![];
    for z in 0..=zoom {
        let side = 1_u32 << z;
        for y in 0..side {
            for x in 0..side {
                all.push(Tile::new(z, x, y)?);
            }
        }
    }
    Ok(all)
}

/// Draws what is missing: through `render.job` where there is Kafka, else here.
pub(super) async fn draw(
    settings: &Settings,
    store: Store,
    log: Option<&dyn EventLog>,
    tiles: &Tiles,
) -> Result<()> {
    let bar = progress::bar("draw tiles", tiles.missing.len() as u64);
    if let Some(log) = log {
        on_workers(log, &tiles.missing, &|| bar.inc(1)).await?;
    } else {
        let desk = deployment::single_desk(settings, store).await?;
        let order = Order {
            storing: Storing::Keep,
            ..Order::batch()
        };
        for job in &tiles.missing {
            let drawn = desk.draw(job, order).await?;
            if drawn.origin == Origin::Stored {
                bail!("{} is stored with other bytes, which stay", job.key());
            }
            if !drawn.kept {
                // Whoever asks for tiles wants them stored: the reason ends the command.
                desk.keep(job, drawn.bytes).await?;
            }
            bar.inc(1);
        }
    }
    progress::done(&bar, &format!("{} drawn", tiles.missing.len()));
    Ok(())
}

async fn on_workers(
    log: &dyn EventLog,
    jobs: &[RenderJob],
    tick: &(dyn Fn() + Send + Sync),
) -> Result<()> {
    let mut done = log.follow(Topic::RenderDone, Start::Now).await?;
    let mut open: BTreeSet<ObjectKey> = jobs.iter().map(RenderJob::key).collect();
    for some in jobs.chunks(AT_ONCE) {
        let trace = uuid::Uuid::new_v4().to_string();
        let event = |job: &RenderJob| {
            Event::new(
                trace.clone(),
                Body::RenderJob {
                    job: job.clone().into(),
                },
            )
        };
        log.append(&some.iter().map(event).collect::<Vec<_>>())
            .await?;
    }
    let mut heard = Instant::now();
    while !open.is_empty() {
        for message in done.next(AT_ONCE, POLL).await? {
            let Ok(Event {
                body: Body::RenderDone { key, failure, .. },
                ..
            }) = message.event()
            else {
                continue;
            };
            if open.remove(&key) {
                heard = Instant::now();
                tick();
                if let Some(failure) = failure {
                    bail!("{key} cannot be drawn: {failure}");
                }
            }
        }
        if heard.elapsed() > SILENCE {
            bail!(
                "no tile was drawn for {SILENCE:?}, {} are left: do render workers run? Run the same command again to go on",
                open.len()
            );
        }
    }
    Ok(())
}
