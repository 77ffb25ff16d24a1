//! `fluxglobe bench stream`: how fresh a cluster is. One notice at a time; the time from the notice to a volume tile drawn
//! from what landed, and the share of each stage.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use contract::event::{Body, Event};
use contract::manifest::ManifestId;
use contract::product::ProductId;
use contract::topic::Topic;
use serde::Serialize;
use storage::log::{EventLog, Follower, Start};

use crate::bench::quantile;
use crate::cli::BenchStream;
use crate::command::notice;
use crate::progress;

/// Longest wait for one stage.
const STAGE_LIMIT: Duration = Duration::from_mins(2);
const POLL: Duration = Duration::from_millis(200);
/// Messages looked at together.
const MESSAGES: usize = 64;
/// Size of the synthetic grid against the full one: what is measured is the way, not the weight.
const SCALE: f64 = 0.05;
const PRODUCT: &str = "bench-stream";

/// Times of one notice, from its sending, seconds.
#[derive(Debug, Clone, Copy, Serialize)]
#[expect(clippy::struct_field_names, reason = "units last in names")]
struct Times {
    landed_s: f64,
    derived_s: f64,
    tile_s: f64,
}

/// What is printed.
#[derive(Debug, Serialize)]
struct Summary {
    notices: usize,
    stages: Vec<Stage>,
}

/// One stage.
#[derive(Debug, Clone, Serialize)]
struct Stage {
    name: &'static str,
    p50_s: f64,
    p95_s: f64,
    /// Of the mean time from notice to tile, percent.
    share_percent: f64,
}

pub(crate) async fn run(log: &dyn EventLog, options: &BenchStream) -> Result<()> {
    let product: ProductId = PRODUCT.parse()?;
    std::fs::create_dir_all(&options.inbox)?;
    let mut landed = log.follow(Topic::GranuleLanded, Start::Now).await?;
    let mut derived = log.follow(Topic::ProductDerived, Start::Now).await?;
    let bar = progress::bar("notices to tiles", u64::from(options.notices.get()));
    let mut all = vec![];
    // The first one also warms compilers, caches and connections: it is not counted.
    for number in 0..=options.notices.get() {
        let file = granule(options, u64::from(number)).await?;
        let begun = Instant::now();
        let event = send(log, &file, &product).await?;
        let manifest = until_landed(landed.as_mut(), &event).await?;
        let landed_s = begun.elapsed().as_secs_f64();
        until_derived(derived.as_mut(), &manifest).await?;
        let derived_s = begun.elapsed().as_secs_f64();
        until_tile(&options.tiles, &manifest).await?;
        let tile_s = begun.elapsed().as_secs_f64();
        if number > 0 {
            all.push(Times {
                landed_s,
                derived_s,
                tile_s,
            });
            bar.inc(1);
        }
        tokio::fs::remove_file(&file).await?;
    }
    let summary = summarise(&all);
    progress::done(&bar, "measured");
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&summary)?);
    }
    progress::result(&table(&summary).to_string())
}

/// A synthetic granule with weather of its own.
async fn granule(options: &BenchStream, seed: u64) -> Result<PathBuf> {
    let file = options.inbox.join(format!("bench-stream-{seed:06}.h5"));
    if file.exists() {
        // Of a run that was ended: the same seed is the same bytes.
        return Ok(file);
    }
    let target = file.clone();
    tokio::task::spawn_blocking(move || {
        let months = ingest::GeneratedSteps::Months;
        ingest::generate_china_sea(&target, SCALE, seed + 1, months, &|_done, _all| ())
    })
    .await??;
    Ok(file)
}

async fn send(log: &dyn EventLog, file: &std::path::Path, product: &ProductId) -> Result<Event> {
    let body = Body::GranuleNotice {
        path: file.display().to_string(),
        profile: None,
        product: Some(product.clone()),
        variable: None,
        indexes: vec![],
        sha256: None,
        size_bytes: None,
        attempt: 1,
    };
    let mut event = Event::new(uuid::Uuid::new_v4().to_string(), body);
    event.noticed = Some(notice::now()?);
    log.append(std::slice::from_ref(&event)).await?;
    Ok(event)
}

async fn until_landed(follower: &mut dyn Follower, notice: &Event) -> Result<ManifestId> {
    wait(follower, "granule.landed", |event| match &event.body {
        Body::GranuleLanded { manifest, .. } if event.trace == notice.trace => {
            Some(manifest.clone())
        }
        _ => None,
    })
    .await
}

async fn until_derived(follower: &mut dyn Follower, source: &ManifestId) -> Result<()> {
    wait(follower, "product.derived", |event| match &event.body {
        Body::ProductDerived { derived_from, .. } if derived_from == source => Some(()),
        _ => None,
    })
    .await
}

async fn wait<T>(
    follower: &mut dyn Follower,
    what: &str,
    wanted: impl Fn(&Event) -> Option<T>,
) -> Result<T> {
    let begun = Instant::now();
    while begun.elapsed() < STAGE_LIMIT {
        for message in follower.next(MESSAGES, POLL).await? {
            if let Some(found) = message.event().ok().as_ref().and_then(&wanted) {
                return Ok(found);
            }
        }
    }
    bail!("no {what} within {STAGE_LIMIT:?}; does the cluster run? (deploy/cluster.sh status)")
}

/// Asks for the tile until it is one of the new manifest.
async fn until_tile(tiles: &str, manifest: &ManifestId) -> Result<()> {
    let begun = Instant::now();
    let client = reqwest::Client::new();
    let address = format!("{tiles}/api/products");
    while begun.elapsed() < STAGE_LIMIT {
        let answer = client.get(&address).send().await?.bytes().await?;
        let products: serde_json::Value = serde_json::from_slice(&answer)?;
        if products.to_string().contains(&manifest.to_string()) {
            // China Sea: tile 3/6/3 holds it.
            let tile = format!(
                "{tiles}/tiles/{}/volume/3/6/3.png?time=2009-07-15",
                manifest.product
            );
            let answer = client
                .get(&tile)
                .send()
                .await?
                .error_for_status()
                .context("the tile was refused")?;
            answer.bytes().await?;
            return Ok(());
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    bail!("the tile server did not show {manifest} within {STAGE_LIMIT:?}")
}

/// A stage and how long it took.
type Part = (&'static str, fn(&Times) -> f64);

fn summarise(all: &[Times]) -> Summary {
    let stages: [Part; 4] = [
        ("notice to landed", |t| t.landed_s),
        ("landed to derived", |t| t.derived_s - t.landed_s),
        ("derived to tile", |t| t.tile_s - t.derived_s),
        ("notice to tile", |t| t.tile_s),
    ];
    let whole: f64 = all.iter().map(|t| t.tile_s).sum();
    let stage = |(name, of): Part| {
        let mut values: Vec<f64> = all.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        Stage {
            name,
            p50_s: quantile(&values, 0.5),
            p95_s: quantile(&values, 0.95),
            share_percent: 100.0 * values.iter().sum::<f64>() / whole,
        }
    };
    Summary {
        notices: all.len(),
        stages: stages.map(stage).to_vec(),
    }
}

fn table(summary: &Summary) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(["stage", "p50 s", "p95 s", "share"]);
    for column in 1..=3 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for stage in &summary.stages {
        table.add_row([
            stage.name.to_owned(),
            format!("{:.3}", stage.p50_s),
            format!("{:.3}", stage.p95_s),
            format!("{:.0} %", stage.share_percent),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_the_stages_add_up_to_the_whole() {
        let times = [Times {
            landed_s: 1.0,
            derived_s: 3.0,
            tile_s: 4.0,
        }];
        let shares: Vec<f64> = summarise(&times)
            .stages
            .iter()
            .map(|s| s.share_percent)
            .collect();
        assert_eq!(shares, [25.0, 50.0, 25.0, 100.0]);
    }
}
