//! Connections to the database: bounded, with limits on every wait; the tables are made or brought up to date once.

use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use deadpool_postgres::{
    Client, Manager, ManagerConfig, Pool, PoolError, RecyclingMethod, Runtime, TimeoutType,
};
use tokio::sync::OnceCell;
use tokio::time::error::Elapsed;
use tokio_postgres::error::SqlState;

use crate::error::{ObservationError, words};
use crate::settings::DatabaseSettings;

/// Longest wait for a connection that is free, or new.
const WAIT: Duration = Duration::from_secs(5);
/// What the network may take beyond the server's own limit on a statement.
const NETWORK: Duration = Duration::from_secs(5);
/// Longest wait of a question whether the database is there.
const READY: Duration = Duration::from_millis(1800);
/// Session lock that is held while tables are made: two services may start at once.
const MIGRATION_LOCK: i64 = 0x666c_7578_676c_6f62;

/// The tables, version by version; a version that was published never changes.
mod tables {
    refinery::embed_migrations!("migrations");
}

/// Connections of one database; clones share them.
#[derive(Clone)]
pub(super) struct Connections {
    pool: Pool,
    schema: String,
    statement: Duration,
    /// Set when the tables are there in this version.
    is_set_up: Arc<OnceCell<()>>,
}

/// A connection that is lent out. One that is not handed back through [`Connections::settle`] is closed: the answer to
/// a question that nobody waited for may still come, and whoever was given the connection next would wait for it.
pub(super) struct Lease(Option<Client>);

impl std::ops::Deref for Lease {
    type Target = Client;

    fn deref(&self) -> &Client {
        self.0
            .as_ref()
            .expect("it is taken out when it is handed back")
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        if let Some(client) = self.0.take() {
            drop(Client::take(client));
        }
    }
}

impl Connections {
    pub(super) fn new(settings: &DatabaseSettings) -> Result<Self, ObservationError> {
        let recycling = ManagerConfig {
            recycling_method: RecyclingMethod::Fast,
        };
        let manager =
            Manager::from_config(settings.config.clone(), settings.tls.clone(), recycling);
        let pool = Pool::builder(manager)
            .max_size(settings.connections)
            .runtime(Runtime::Tokio1)
            .wait_timeout(Some(WAIT))
            .create_timeout(Some(WAIT))
            .recycle_timeout(Some(WAIT))
            .build()
            .map_err(|e| ObservationError::setup(e.to_string()))?;
        Ok(Self {
            pool,
            schema: settings.schema.clone(),
            statement: settings.statement,
            is_set_up: Arc::default(),
        })
    }

    /// A connection to a database whose tables are there.
    pub(super) async fn client(&self) -> Result<Lease, ObservationError> {
        self.is_set_up.get_or_try_init(|| self.set_up()).await?;
        Ok(Lease(Some(self.connect().await?)))
    }

    /// Waits for an answer, for as long as a statement may take.
    pub(super) fn within<A>(&self, asked: A) -> impl Future<Output = Result<A::Output, Elapsed>>
    where
        A: Future,
    {
        tokio::time::timeout(self.statement + NETWORK, asked)
    }

    /// Hands a connection back with the answer that it gave, or did not give in time.
    pub(super) fn settle<T>(
        &self,
        action: &'static str,
        mut client: Lease,
        answer: Result<Result<T, tokio_postgres::Error>, Elapsed>,
    ) -> Result<T, ObservationError> {
        let limit = self.statement + NETWORK;
        let answer = answer.map_err(|_late| ObservationError::Slow { action, limit })?;
        drop(client.0.take());
        answer.map_err(ObservationError::database(action))
    }

    pub(super) async fn ready(&self) -> Result<(), ObservationError> {
        let action = "asking whether it is there";
        let asked = async {
            let client = self.client().await?;
            let answer = self.within(client.simple_query("SELECT 1")).await;
            self.settle(action, client, answer)
        };
        match tokio::time::timeout(READY, asked).await {
            Ok(answer) => answer.map(|_rows| ()),
            Err(_late) => Err(ObservationError::Slow {
                action,
                limit: READY,
            }),
        }
    }

    async fn connect(&self) -> Result<Client, ObservationError> {
        let connection = |reason: String| ObservationError::Connection { reason };
        self.pool.get().await.map_err(|error| match error {
            PoolError::Timeout(TimeoutType::Wait) => connection("all of them are busy".to_owned()),
            PoolError::Timeout(TimeoutType::Create | TimeoutType::Recycle) => {
                connection(format!("no answer within {} s", WAIT.as_secs()))
            }
            PoolError::Backend(e) if is_refused(&e) => ObservationError::setup(format!(
                "the database refuses the connection: {}",
                words(&e)
            )),
            PoolError::Backend(e) if is_distrusted(&e) => ObservationError::setup(format!(
                "the database's certificate is not trusted ({}); give those it goes back to with --postgis-ca-file",
                words(&e)
            )),
            PoolError::Backend(e) => connection(words(&e)),
            other => connection(other.to_string()),
        })
    }

    /// Makes the schema and the tables, or brings them to this version.
    async fn set_up(&self) -> Result<(), ObservationError> {
        let mut client = self.connect().await?;
        let action = "making its tables";
        let limit = self.statement * 2;
        let lock = format!("SELECT pg_advisory_lock({MIGRATION_LOCK})");
        let work = async {
            let failed = || ObservationError::database(action);
            client.batch_execute(&lock).await.map_err(failed())?;
            check_postgis(&client).await?;
            let schema = format!("CREATE SCHEMA IF NOT EXISTS {}", self.schema);
            client.batch_execute(&schema).await.map_err(failed())?;
            let done = tables::migrations::runner().run_async(&mut **client).await;
            done.map_err(|e| ObservationError::Migration {
                source: Box::new(e),
            })
        };
        let done = tokio::time::timeout(limit, work).await;
        // The lock goes with the connection, whatever became of the work.
        drop(Client::take(client));
        match done {
            Ok(done) => done.map(|_report| ()),
            Err(_late) => Err(ObservationError::Slow { action, limit }),
        }
    }
}

/// Is PostGIS there? It is made if this user may.
async fn check_postgis(client: &Client) -> Result<(), ObservationError> {
    let failed = || ObservationError::database("looking for PostGIS");
    let row = client
        .query_one("SELECT to_regtype('geometry') IS NOT NULL", &[])
        .await
        .map_err(failed())?;
    if row.try_get::<_, bool>(0).map_err(failed())? {
        return Ok(());
    }
    let made = client
        .batch_execute("CREATE EXTENSION IF NOT EXISTS postgis SCHEMA public")
        .await;
    made.map_err(|e| match e.code() {
        Some(_) => ObservationError::setup(format!(
            "the database has no PostGIS and it cannot be made ({}); run CREATE EXTENSION postgis as its owner",
            words(&e)
        )),
        None => ObservationError::database("making PostGIS")(e),
    })
}

/// A user, password or database that the server does not know: waiting does not help.
fn is_refused(error: &tokio_postgres::Error) -> bool {
    let refusals = [
        SqlState::INVALID_PASSWORD,
        SqlState::INVALID_AUTHORIZATION_SPECIFICATION,
        SqlState::INVALID_CATALOG_NAME,
        SqlState::INSUFFICIENT_PRIVILEGE,
    ];
    error.code().is_some_and(|code| refusals.contains(code))
}

/// A certificate that goes back to none of ours, or is another host's: waiting does not help, and neither may the password
/// be sent.
fn is_distrusted(error: &tokio_postgres::Error) -> bool {
    const VERIFY_FAILED: &str = "certificate verify failed";
    let first: &(dyn std::error::Error + 'static) = error;
    std::iter::successors(Some(first), |cause| cause.source())
        .filter_map(|cause| cause.downcast_ref::<openssl::ssl::Error>()?.ssl_error())
        .flat_map(|stack| stack.errors())
        .any(|failed| failed.reason() == Some(VERIFY_FAILED))
}
