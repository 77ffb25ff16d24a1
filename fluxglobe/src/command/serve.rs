//! `fluxglobe serve`: a data folder in, tiles, views, statistics and the viewer over HTTP out.

use std::num::NonZeroUsize;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use compute::Engine;
use contract::check::Check;
use observations::FileStore;
use render_worker::Limits;
use storage::Store;
use tile_server::{AppState, Server};

use crate::cli::Settings;
use crate::ports::{Analyst, Drawer, Observer};
use crate::{deployment, file_handles, progress, protocol, viewer};

pub(crate) async fn run(settings: &Settings, options: tile_server::config::Settings) -> Result<()> {
    let store = deployment::interactive_store(settings)?;
    let check = crate::demo::check::stored(&store).await?;
    let server = bind(settings, store, options, check).await?;
    announce(&server);
    until_asked_to_stop(server).await
}

/// A server that listens but does not answer yet.
pub(crate) async fn bind(
    settings: &Settings,
    store: Store,
    mut options: tile_server::config::Settings,
    check: Option<Check>,
) -> Result<Server> {
    options.viewer = options.viewer.or_else(viewer::built);
    file_handles::fit(&mut options);
    let registry = service::admin::registry("serve", protocol::PROGRAM)?;
    let limits = Limits {
        draws_at_once: options
            .draws_at_once
            .map(|count| NonZeroUsize::try_from(count).unwrap_or(NonZeroUsize::MAX)),
        draw_queue: options.draw_queue as usize,
        ..Limits::default()
    };
    let desk = deployment::desk(settings, store.clone(), limits, &registry).await?;
    let regions = deployment::region_engine(settings, store.clone())?;
    let analyst = Analyst::new(Engine::local(store.clone()), &regions, check);
    storage::sound::damage::register(&registry)?;
    let state = AppState::new(
        &options,
        store.clone(),
        Arc::new(Drawer::new(desk)),
        Arc::new(analyst),
        registry,
    )?
    .with_observations(Arc::new(Observer(Arc::new(FileStore::new(store)))));
    let server = Server::bind(&options, state.clone()).await?;
    // The event log belongs to whoever lands: `fluxglobe ingest` beside this server. Ends with the server.
    tokio::spawn(state.watch().run());
    Ok(server)
}

/// Says where to look.
pub(crate) fn announce(server: &Server) {
    progress::say(&format!("{:>24} http://{}/", "open", server.address()));
}

/// Serves until Ctrl-C or a termination signal, then lets requests under way end.
pub(crate) async fn until_asked_to_stop(server: Server) -> Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut terminate = signal(SignalKind::terminate()).context("cannot listen for signals")?;
    let stop = async move {
        tokio::select! {
            _interrupted = tokio::signal::ctrl_c() => {}
            _terminated = terminate.recv() => {}
        }
        progress::say("stopping");
    };
    Ok(server.run(stop).await?)
}
