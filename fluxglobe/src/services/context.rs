//! What every service stands on: its health address, the store and the event log, waited for until they are there.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, Result, bail};
use contract::kind::Kind;
use kafka_log::{KafkaLog, KafkaSettings};
use service::admin::Admin;
use service::{Board, Parts, Registry, ServiceError, Stop, until_there};
use storage::log::EventLog;
use storage::{StorageError, Store};

use tokio::task::JoinHandle;

use crate::cli::Settings;
use crate::{deployment, protocol};

/// A service that lives and is not yet ready; clones are of the same one.
#[derive(Clone)]
pub(crate) struct ServiceContext {
    pub(crate) registry: Registry,
    pub(crate) board: Arc<Board>,
    /// Said when the service is asked to stop.
    pub(crate) stop: Stop,
    store_url: String,
    /// Said when everything else has ended, so that the end can be watched.
    end: Stop,
    admin: Admins,
}

/// The health address at work, until it is waited for.
type Admins = Arc<Mutex<Option<JoinHandle<Result<(), ServiceError>>>>>;

impl ServiceContext {
    /// Takes the health address, if the service has one of its own. `parts` are what it waits for.
    pub(crate) async fn take(
        settings: &Settings,
        service: &'static str,
        admin: Option<SocketAddr>,
        parts: &[&'static str],
    ) -> Result<Self> {
        let stop = service::when_asked_to_stop()?;
        let registry = service::admin::registry(service, protocol::PROGRAM)?;
        storage::sound::damage::register(&registry)?;
        let board = Board::waiting_for(parts);
        let store_url = match &settings.store {
            Some(url) => url.clone(),
            None => bail!(
                "{service} needs an object store that all services share: give --store or FLUXGLOBE_STORE"
            ),
        };
        let end = Stop::new();
        let admin = match admin {
            Some(address) => {
                let admin = Admin::bind(address, registry.clone(), Arc::clone(&board) as _).await?;
                tracing::info!(address = %admin.address(), service, "health and metrics");
                let (end, stop) = (end.clone(), stop.clone());
                Some(tokio::spawn(async move {
                    let ended = admin.run(end).await;
                    // A service that cannot be asked is not left to itself.
                    stop.now();
                    ended
                }))
            }
            None => None,
        };
        Ok(Self {
            registry,
            board,
            stop,
            store_url,
            end,
            admin: Arc::new(Mutex::new(admin)),
        })
    }

    /// Where the object store is.
    pub(crate) fn store_url(&self) -> &str {
        &self.store_url
    }

    /// The object store, once it is there and proven to hold what it is given. None if asked to stop before.
    pub(crate) async fn store(&self) -> Result<Option<Store>> {
        let open = || async {
            let store = deployment::with_attached(&Store::open(&self.store_url)?);
            store.check_writable().await?;
            protocol::agree(&store).await?;
            Ok::<_, protocol::ProtocolError>(store)
        };
        let there = until_there(
            "object store",
            &self.stop,
            protocol::ProtocolError::is_retryable,
            open,
        )
        .await;
        let Some(store) = there.context("the object store cannot be used")? else {
            return Ok(None);
        };
        let asked = store.clone();
        self.board.set("store", move || {
            let asked = asked.clone();
            async move {
                asked
                    .folders(Kind::Manifest.folder())
                    .await
                    .map(|found| format!("products: {}", found.len()))
            }
        });
        Ok(Some(store))
    }

    /// The event log on Kafka, once it is there with all its topics.
    pub(crate) async fn log(&self, kafka: &KafkaSettings) -> Result<Option<Arc<dyn EventLog>>> {
        let connect = || KafkaLog::connect(kafka);
        let there = until_there("event log", &self.stop, StorageError::is_retryable, connect).await;
        let Some(log) = there.context("the event log cannot be used")? else {
            return Ok(None);
        };
        let log: Arc<dyn EventLog> = Arc::new(log);
        let asked = Arc::clone(&log);
        self.board.set("event log", move || {
            let asked = Arc::clone(&asked);
            async move { asked.ready().await.map(|()| "it answers".to_owned()) }
        });
        Ok(Some(log))
    }

    /// Parts to come: they are told when the service is asked to stop, and `/readyz` says no once one of them is dead.
    pub(crate) fn parts(&self) -> Parts {
        Parts::new(&self.stop, &self.board)
    }

    /// The service at work: until it is asked to stop, or until one of its parts ends, which is its error.
    pub(crate) async fn run(self, parts: Parts) -> Result<()> {
        let ended = parts.run().await;
        let left = self.leave().await;
        ended?;
        left
    }

    /// Ends the health address; the last thing that a service does.
    pub(crate) async fn leave(self) -> Result<()> {
        self.end.now();
        // Taken once, whole.
        let admin = self
            .admin
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if let Some(admin) = admin {
            admin.await??;
        }
        tracing::info!("stopped");
        Ok(())
    }
}
