//! `fluxglobe serve`: a data folder in, tiles, views, statistics and the viewer over HTTP out.

use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, Result};
use compute::Engine;
use contract::check::Check;
use observations::FileStore;
use render_worker::{Desk, Limits};
use storage::Store;
use tile_server::{AppState, ServeError, Server};

use crate::cli::Settings;
use crate::ports::{Analyst, Drawer, Observer};
use crate::{deployment, file_handles, progress, protocol, viewer};

/// How long a server that was asked to stop waits for its store.
const STORE_LIMIT: Duration = Duration::from_secs(10);

pub(crate) async fn run(settings: &Settings, options: tile_server::config::Settings) -> Result<()> {
    let store = deployment::interactive_store(settings)?;
    let check = crate::demo::check::stored(&store).await?;
    let server = bind(settings, store, options, check).await?;
    announce(&server);
    until_asked_to_stop(server).await
}

/// Can an address be listened on? Asked by those who have long work to do before they listen.
pub(crate) fn check_free(address: SocketAddr) -> Result<(), ServeError> {
    match TcpListener::bind(address) {
        Ok(_taken_for_a_moment) => Ok(()),
        Err(source) if source.kind() == ErrorKind::AddrInUse => {
            Err(ServeError::PortTaken { address })
        }
        Err(source) => Err(ServeError::Listen { address, source }),
    }
}

/// A server that listens but does not answer yet.
pub(crate) async fn bind(
    settings: &Settings,
    store: Store,
    mut options: tile_server::config::Settings,
    check: Option<Check>,
) -> Result<Serving> {
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
        Arc::new(Drawer::new(desk.clone())),
        Arc::new(analyst),
        registry,
    )?
    .with_observations(Arc::new(Observer(Arc::new(FileStore::new(store)))));
    let server = Server::bind(&options, state.clone()).await?;
    // The event log belongs to whoever lands: `fluxglobe ingest` beside this server. Ends with the server.
    tokio::spawn(state.watch().run());
    Ok(Serving { server, desk })
}

/// A server and the desk that draws for it.
pub(crate) struct Serving {
    pub(crate) server: Server,
    desk: Desk,
}

/// Says where to look.
pub(crate) fn announce(serving: &Serving) {
    let address = serving.server.address();
    progress::say(&format!("{:>24} http://{address}/", "open"));
}

/// Serves until Ctrl-C or a termination signal, then lets requests under way end.
pub(crate) async fn until_asked_to_stop(serving: Serving) -> Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut terminate = signal(SignalKind::terminate()).context("cannot listen for signals")?;
    let stop = async move {
        tokio::select! {
            _interrupted = tokio::signal::ctrl_c() => {}
            _terminated = terminate.recv() => {}
        }
        progress::say("stopping");
    };
    let served = serving.server.run(stop).await;
    // Pictures that were given out are stored too, by a store that answers.
    if tokio::time::timeout(STORE_LIMIT, serving.desk.settled())
        .await
        .is_err()
    {
        tracing::warn!("some pictures that were given out are not stored");
    }
    Ok(served?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_taken_port_is_told_before_anything_else_and_a_free_one_stays_free() {
        let taken = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap();
        let refused = check_free(address).unwrap_err().to_string();
        let expected = format!("port {} is in use by another program", address.port());
        assert!(refused.starts_with(&expected), "{refused}");
        drop(taken);
        check_free(address).unwrap();
        check_free(address).unwrap();
    }
}
