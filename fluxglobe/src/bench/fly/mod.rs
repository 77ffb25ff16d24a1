//! `fluxglobe bench fly`: what viewers see who fly over a running server's globe: pictures a second, the time from a camera
//! to its picture, and until one that rests is there in full.

mod camera;
mod path;
mod summary;

use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};

use crate::cli::BenchFly;
use crate::progress;
use camera::Flight;
use path::Path;
use summary::Summary;

/// Different reasons of failures that are told.
const MOST_REASONS: usize = 5;

pub(crate) async fn run(options: &BenchFly) -> Result<()> {
    let client = reqwest::Client::new();
    let path = Path::of(&client, options).await?;
    let address = options
        .url
        .strip_prefix("http")
        .map(|rest| format!("ws{rest}/stream"));
    let address = address.with_context(|| format!("{} is no http address", options.url))?;
    let counted_from = Instant::now() + Duration::from_secs(options.warm_up_seconds.into());
    let end = counted_from + Duration::from_secs(u64::from(options.seconds.get()));
    let bar = progress::bar("fly", u64::from(options.clients.get()));
    let flights = (0..options.clients.get()).map(|number| {
        let (address, path) = (address.clone(), path.of_viewer(number));
        let rate_hz = options.states_per_second.get();
        tokio::spawn(async move { camera::fly(&address, &path, rate_hz, counted_from, end).await })
    });
    let (mut flown, mut reasons) = (vec![], vec![]);
    for flight in flights.collect::<Vec<_>>() {
        match flight.await? {
            Ok(flight) => flown.push(flight),
            Err(error) => reasons.push(format!("{error:#}")),
        }
        bar.inc(1);
    }
    let pictures: usize = flown.iter().map(Flight::pictures).sum();
    progress::done(&bar, &format!("{pictures} pictures"));
    reasons.extend(flown.iter().flat_map(|flight| flight.errors.clone()));
    reasons.sort();
    reasons.dedup();
    reasons.truncate(MOST_REASONS);
    ensure!(
        pictures > 0,
        "no picture came while pictures were counted: {}",
        reasons.join("; ")
    );
    let summary = Summary::of(options, &flown);
    if options.json {
        progress::result(&serde_json::to_string_pretty(&summary)?)?;
    } else {
        progress::result(&summary.table().to_string())?;
    }
    if !reasons.is_empty() {
        bail!("not all went well: {}", reasons.join("; "));
    }
    Ok(())
}
