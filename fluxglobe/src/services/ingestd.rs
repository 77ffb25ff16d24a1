//! `fluxglobe ingestd`: notices and observations from Kafka in; products, observations and their events out.

use std::sync::Arc;

use anyhow::Result;
use ingest::{DecoderCommand, IngestService};
use observations::ObservationService;

use crate::cli::{Ingestd, Settings};
use crate::services::Footing;
use crate::services::sink::Sink;

pub(crate) async fn run(settings: &Settings, options: Ingestd) -> Result<()> {
    // What can be refused without asking anybody is refused before anything is waited for.
    let ingest = options.ingest.resolve(DecoderCommand::current()?)?;
    let parts = ["store", "event log", "observations"];
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
    let granules = IngestService::new(store, Arc::clone(&log), ingest)
        .with_metrics(&footing.registry)?
        .with_observations(Arc::new(Sink(Arc::clone(&measured))));
    let observed = ObservationService::new(log, measured);
    tokio::join!(
        granules.run(footing.stop.clone()),
        observed.run(footing.stop.said())
    );
    footing.leave().await
}
