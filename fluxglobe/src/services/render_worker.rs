//! `fluxglobe render-worker`: pictures on demand over gRPC, and those of `render.job`.

use anyhow::Result;
use render_worker::batch::BatchService;
use render_worker::server::Server;

use crate::cli::{RenderWorker, Settings};
use crate::deployment;
use crate::services::Footing;

pub(crate) async fn run(settings: &Settings, options: RenderWorker) -> Result<()> {
    // Settings and secrets are looked at before anything is waited for.
    options.kafka.check()?;
    let parts = ["store", "renderer", "event log"];
    let footing = Footing::take(settings, "render-worker", Some(options.admin), &parts).await?;
    if footing.store().await?.is_none() {
        return footing.leave().await;
    }
    // Whoever asks for a picture is told within seconds that the store is away; the batch tries again by itself.
    let store = deployment::open_interactive(footing.store_url())?;
    let limits = options.render.limits();
    let desk = deployment::desk(settings, store, limits, &footing.registry).await?;
    let asked = desk.clone();
    footing.board.set("renderer", move || {
        let asked = asked.clone();
        async move { asked.ready().await }
    });
    let server = Server::bind(desk.clone(), &options.render)?;
    tracing::info!(address = %server.address(), "render worker");
    let mut parts = footing.parts();
    parts.start("render worker", server.run(footing.stop.clone()));
    let own = footing.clone();
    parts.start("render jobs", async move {
        if let Some(log) = own.log(&options.kafka).await? {
            let batch = BatchService::new(desk, log, options.render.drain());
            batch.run(own.stop.clone()).await?;
        }
        Ok::<_, anyhow::Error>(())
    });
    footing.run(parts).await
}
