//! `fluxglobe ingestd`: notices and observations from Kafka in; products, observations and their events out.

use std::sync::Arc;
use std::time::Duration;

use anyhow::Result;
use ingest::{DecoderCommand, IngestService, Metrics, Quiet};
use observations::ObservationService;
use service::Red;

use crate::cli::{Ingestd, Settings};
use crate::services::Footing;
use crate::sink::Sink;

pub(crate) async fn run(settings: &Settings, options: Ingestd) -> Result<()> {
    // What can be refused without asking anybody is refused before anything is waited for.
    let ingest = options.ingest.resolve(DecoderCommand::current()?)?;
    options.kafka.check()?;
    options.observations.database()?;
    let parts = ["store", "event log", "observations", "ingest"];
    let footing = Footing::take(settings, "ingestd", Some(options.admin), &parts).await?;
    let Some(store) = footing.store().await? else {
        return footing.leave().await;
    };
    let Some(log) = footing.log(&options.kafka).await? else {
        return footing.leave().await;
    };
    let measured = observations::open(&options.observations, &store)?;
    let asked = Arc::clone(&measured);
    footing.board.set("observations", move || {
        let asked = Arc::clone(&asked);
        async move {
            asked
                .ready()
                .await
                .map(|()| "they can be stored".to_owned())
        }
    });
    let drain = Duration::from_secs(options.ingest.drain_s);
    let granules = IngestService::new(store, Arc::clone(&log), ingest)
        .with_metrics(Metrics::register(&footing.registry)?)
        .with_observations(Arc::new(Sink(Arc::clone(&measured))))
        .with_bounds(usize::from(options.ingest.parallel_notices), drain);
    let asked = granules.clone();
    footing.board.set("ingest", move || {
        let asked = asked.clone();
        async move { crate::services::worst(&asked).await }
    });
    let red = Red::register(&footing.registry, "observations")?;
    let observed = ObservationService::new(log, measured, red);
    let mut parts = footing.parts();
    let said = footing.stop.said();
    parts.start("ingest", async move { granules.run(&Quiet, said).await });
    let said = footing.stop.said();
    parts.start("observations", async move { observed.run(said).await });
    footing.run(parts).await
}
