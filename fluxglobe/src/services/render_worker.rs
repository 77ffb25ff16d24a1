//! `fluxglobe render-worker`: pictures on demand over gRPC, and those of `render.job`.

use anyhow::Result;
use render_worker::batch::BatchService;
use render_worker::server::Server;

use crate::cli::{RenderWorker, Settings};
use crate::deployment;
use crate::services::ServiceContext;

pub(crate) async fn run(settings: &Settings, options: RenderWorker) -> Result<()> {
    // Settings and secrets are looked at before anything is waited for.
    options.kafka.check()?;
    let parts = ["store", "renderer", "event log"];
    let context =
        ServiceContext::take(settings, "render-worker", Some(options.admin), &parts).await?;
    if context.store().await?.is_none() {
        return context.leave().await;
    }
    // Whoever asks for a picture is told within seconds that the store is away; the batch tries again by itself.
    let store = deployment::open_interactive(context.store_url())?;
    let limits = options.render.limits();
    let desk = deployment::desk(settings, store, limits, &context.registry).await?;
    let asked = desk.clone();
    context.board.set("renderer", move || {
        let asked = asked.clone();
        async move { asked.ready().await }
    });
    let server = Server::bind(desk.clone(), &options.render)?;
    tracing::info!(address = %server.address(), "render worker");
    let mut parts = context.parts();
    parts.start("render worker", server.run(context.stop.clone()));
    let own = context.clone();
    parts.start("render jobs", async move {
        if let Some(log) = own.log(&options.kafka).await? {
            let batch = BatchService::new(desk, log, options.render.drain());
            batch.run(own.stop.clone()).await?;
        }
        Ok::<_, anyhow::Error>(())
    });
    context.run(parts).await
}
