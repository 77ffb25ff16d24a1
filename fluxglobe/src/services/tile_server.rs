//! `fluxglobe tile-server`: HTTP over the cluster's render workers, engines, observations and events.

use std::sync::Arc;

use anyhow::Result;
use compute::Engine;
use kafka_log::KafkaSettings;
use render_worker::fleet::Fleet;
use tile_server::{AppState, Server};

use crate::cli::{Settings, TileServer};
use crate::ports::{Analyst, FleetDrawer, Observer};
use crate::services::ServiceContext;
use crate::{deployment, file_handles, viewer};

pub(crate) async fn run(settings: &Settings, options: TileServer) -> Result<()> {
    // Settings and secrets are looked at before anything is waited for.
    options.kafka.check()?;
    options.observations.database()?;
    let context = ServiceContext::take(settings, "tile-server", None, &[]).await?;
    // Opening asks nobody: /healthz is answered while the store is waited for, and /readyz says so.
    let store = deployment::open_interactive(context.store_url())?;
    let fleet = Fleet::start(&options.fleet, store.clone(), &context.registry)?;
    let measured = observations::open(&options.observations, &store)?;
    let regions = deployment::region_engine(settings, store.clone())?;
    let analyst = Analyst::new(Engine::local(store.clone()), &regions, None);
    let mut serve = options.serve;
    serve.viewer = serve.viewer.or_else(viewer::built);
    file_handles::fit(&mut serve);
    let state = AppState::new(
        &serve,
        store,
        Arc::new(FleetDrawer(fleet)),
        Arc::new(analyst),
        context.registry.clone(),
    )?
    .with_observations(Arc::new(Observer(measured)));
    let server = Server::bind(&serve, state.clone()).await?;
    tracing::info!(address = %server.address(), "tile server");
    let mut parts = context.parts();
    parts.start("tile server", server.run(context.stop.said()));
    let own = context.clone();
    parts.start(
        "news",
        async move { live(&own, &options.kafka, state).await },
    );
    context.run(parts).await
}

/// Follows the event log once store and log are there and of this version.
async fn live(context: &ServiceContext, kafka: &KafkaSettings, state: AppState) -> Result<()> {
    if context.store().await?.is_some()
        && let Some(log) = context.log(kafka).await?
    {
        state.live(log).run(context.stop.clone()).await?;
    }
    Ok(())
}
