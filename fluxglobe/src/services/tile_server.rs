//! `fluxglobe tile-server`: HTTP over the cluster's render workers, engines, observations and events.

use std::sync::Arc;

use anyhow::Result;
use compute::Engine;
use render_worker::fleet::Fleet;
use tile_server::{AppState, Server};

use crate::cli::{Settings, TileServer};
use crate::ports::{Analyst, FleetDrawer, Observer};
use crate::services::Footing;
use crate::{deployment, viewer};

pub(crate) async fn run(settings: &Settings, options: TileServer) -> Result<()> {
    let footing = Footing::take(settings, "tile-server", None, &[]).await?;
    let Some(store) = footing.store().await? else { return footing.leave().await };
    let fleet = Fleet::start(&options.fleet, store.clone(), &footing.registry)?;
    let measured = observations::open(&options.observations, &store)?;
    let analyst = Analyst {
        local: Engine::local(store.clone()),
        cluster: deployment::engine(settings, store.clone())?,
        check: None,
    };
    let mut serve = options.serve;
    serve.viewer = serve.viewer.or_else(viewer::built);
    let state = AppState::new(
        &serve,
        store,
        Arc::new(FleetDrawer(fleet)),
        Arc::new(analyst),
        footing.registry.clone(),
    )?
    .with_observations(Arc::new(Observer(measured)));
    let server = Server::bind(&serve, state.clone()).await?;
    tracing::info!(address = %server.address(), "tile server");
    let serving = tokio::spawn(server.run(footing.stop.said()));
    // Tiles are served while the log is waited for.
    if let Some(log) = footing.log(&options.kafka).await? {
        state.live(log).run(footing.stop.clone()).await;
    }
    serving.await??;
    footing.leave().await
}
