//! `fluxglobe ingestd`: notices and observations from Kafka in; products, observations and their events out.

use std::sync::Arc;
use std::time::Duration;

use anyhow::Result;
use ingest::{DecoderCommand, IngestService, Metrics, Quiet};
use observations::ObservationService;
use service::Red;

use crate::cli::{Ingestd, Settings};
use crate::services::ServiceContext;
use crate::sink::Sink;

pub(crate) async fn run(settings: &Settings, options: Ingestd) -> Result<()> {
    // What can be refused without asking anybody is refused before anything is waited for.
    let ingest = options.ingest.resolve(DecoderCommand::current()?)?;
    options.kafka.check()?;
    options.observations.database()?;
    let parts = ["store", "event log", "observations", "ingest"];
    let context = ServiceContext::take(settings, "ingestd", Some(options.admin), &parts).await?;
    let Some(store) = context.store().await? else {
        return context.leave().await;
    };
    let Some(log) = context.log(&options.kafka).await? else {
        return context.leave().await;
    };
    let measured = observations::open(&options.observations, &store)?;
    let asked = Arc::clone(&measured);
    context.board.set("observations", move || {
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
        .with_metrics(Metrics::register(&context.registry)?)
        .with_observations(Arc::new(Sink(Arc::clone(&measured))))
        .with_bounds(usize::from(options.ingest.parallel_notices), drain);
    let asked = granules.clone();
    context.board.set("ingest", move || {
        let asked = asked.clone();
        async move { crate::services::worst(&asked).await }
    });
    let red = Red::register(&context.registry, "observations")?;
    let observed = ObservationService::new(log, measured, red);
    let mut parts = context.parts();
    let said = context.stop.said();
    parts.start("ingest", async move { granules.run(&Quiet, said).await });
    let said = context.stop.said();
    parts.start("observations", async move { observed.run(said).await });
    context.run(parts).await
}
