//! A database that is away, comes back, or says nothing: a switch between the store and the real server.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use observations::{ErrorClass, Filter, ObservationSettings, ObservationStore as _, PostgisStore};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};

use crate::homes::{drop_schema, settings};
use crate::sample::observation;

const OPEN: u8 = 0;
/// New connections are closed, and those that there are.
const CUT: u8 = 1;
/// Bytes are taken and go nowhere.
const SILENT: u8 = 2;

/// A way to the real server that can be cut.
pub(crate) struct Switch {
    state: Arc<AtomicU8>,
    /// Connections that were closed at once.
    refused: Arc<AtomicUsize>,
    pub(crate) settings: ObservationSettings,
    direct: ObservationSettings,
}

impl Switch {
    pub(crate) async fn new() -> Self {
        let direct = settings();
        let url = direct.postgis.clone().unwrap();
        let (head, rest) = url.split_once('@').unwrap();
        let (server, path) = rest.split_once('/').unwrap();
        let server: SocketAddr = server
            .parse()
            .expect("tests reach the server by address and port");
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let state = Arc::new(AtomicU8::new(OPEN));
        let refused = Arc::<AtomicUsize>::default();
        let counted = Arc::clone(&refused);
        tokio::spawn(serve(listener, server, Arc::clone(&state), counted));
        let settings = ObservationSettings {
            postgis: Some(format!("{head}@{address}/{path}?sslmode=disable")),
            postgis_statement_s: 1.try_into().unwrap(),
            ..direct.clone()
        };
        Self {
            state,
            refused,
            settings,
            direct,
        }
    }

    pub(crate) fn store(&self) -> PostgisStore {
        PostgisStore::new(&self.settings.database().unwrap().unwrap()).unwrap()
    }

    pub(crate) fn cut(&self) {
        self.state.store(CUT, Ordering::SeqCst);
    }

    pub(crate) fn mend(&self) {
        self.state.store(OPEN, Ordering::SeqCst);
    }

    /// Waits until so many connections were closed at once.
    pub(crate) async fn refuses(&self, count: usize) {
        let asked = async {
            while self.refused.load(Ordering::SeqCst) < count {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        };
        let in_time = tokio::time::timeout(Duration::from_mins(1), asked).await;
        in_time.expect("the server that is away is asked");
    }

    fn silence(&self) {
        self.state.store(SILENT, Ordering::SeqCst);
    }

    pub(crate) async fn close(self) {
        drop_schema(&self.direct).await;
    }
}

async fn serve(
    listener: TcpListener,
    server: SocketAddr,
    state: Arc<AtomicU8>,
    refused: Arc<AtomicUsize>,
) {
    loop {
        let (client, _) = listener.accept().await.unwrap();
        if state.load(Ordering::SeqCst) == CUT {
            refused.fetch_add(1, Ordering::SeqCst);
        } else {
            let state = Arc::clone(&state);
            tokio::spawn(async move {
                let Ok(server) = TcpStream::connect(server).await else {
                    return;
                };
                let (client_in, client_out) = client.into_split();
                let (server_in, server_out) = server.into_split();
                tokio::join!(
                    pass(client_in, server_out, &state),
                    pass(server_in, client_out, &state)
                );
            });
        }
    }
}

async fn pass(
    mut from: tokio::net::tcp::OwnedReadHalf,
    mut to: tokio::net::tcp::OwnedWriteHalf,
    state: &AtomicU8,
) {
    let mut buffer = vec![0; 64 << 10];
    loop {
        let read = tokio::time::timeout(Duration::from_millis(20), from.read(&mut buffer)).await;
        match (state.load(Ordering::SeqCst), read) {
            (CUT, _) | (_, Ok(Ok(0) | Err(_))) => return,
            (SILENT, _) | (_, Err(_)) => {}
            (_, Ok(Ok(count))) => {
                if to.write_all(&buffer[..count]).await.is_err() {
                    return;
                }
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_database_that_is_not_there_yet_is_no_fault_of_the_settings() {
    let switch = Switch::new().await;
    switch.cut();
    let store = switch.store();
    let error = store.ready().await.unwrap_err();
    assert_eq!(error.class(), ErrorClass::Retryable, "{error}");
    switch.mend();
    store.ready().await.unwrap();
    store.upsert(&[observation("a", 0, 1.0)]).await.unwrap();
    switch.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_that_were_cut_are_replaced() {
    let switch = Switch::new().await;
    let store = switch.store();
    store.upsert(&[observation("a", 0, 1.0)]).await.unwrap();
    switch.cut();
    let error = store.query(&Filter::default()).await.unwrap_err();
    assert_eq!(error.class(), ErrorClass::Retryable, "{error}");
    switch.mend();
    let mut tries = 0;
    let page = loop {
        // A connection that died in the pool may be noticed only when it is used.
        tries += 1;
        match store.query(&Filter::default()).await {
            Ok(page) => break page,
            Err(error) => assert!(error.is_retryable() && tries < 10, "{error}"),
        }
    };
    assert_eq!(page.observations.len(), 1);
    switch.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_says_nothing_is_given_up_in_time() {
    let switch = Switch::new().await;
    let store = switch.store();
    store.upsert(&[observation("a", 0, 1.0)]).await.unwrap();
    switch.silence();
    let start = Instant::now();
    let error = store.ready().await.unwrap_err();
    assert!(error.is_retryable(), "{error}");
    assert!(
        start.elapsed() < Duration::from_secs(30),
        "{:?}",
        start.elapsed()
    );
    let start = Instant::now();
    let error = store.query(&Filter::default()).await.unwrap_err();
    assert!(error.is_retryable(), "{error}");
    // One second for the statement, five for the network, five for a connection.
    assert!(
        start.elapsed() < Duration::from_mins(1),
        "{:?}",
        start.elapsed()
    );
    switch.mend();
    assert_eq!(
        store
            .query(&Filter::default())
            .await
            .unwrap()
            .observations
            .len(),
        1
    );
    switch.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_password_is_told_without_the_password() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("password");
    std::fs::write(&file, "certainly-not-it").unwrap();
    let settings = ObservationSettings {
        postgis_password_file: Some(file),
        ..settings()
    };
    let store = PostgisStore::new(&settings.database().unwrap().unwrap()).unwrap();
    let error = store.ready().await.expect_err(
        "the server of these tests asks for its password, as that of deploy/services does",
    );
    assert_eq!(error.class(), ErrorClass::Internal, "{error}");
    assert!(!error.to_string().contains("certainly-not-it"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn tables_are_made_once_however_many_start_together() {
    let settings = settings();
    let database = settings.database().unwrap().unwrap();
    let starts: Vec<_> = (0..6)
        .map(|_| {
            let store = PostgisStore::new(&database).unwrap();
            tokio::spawn(async move { store.query(&Filter::default()).await })
        })
        .collect();
    for start in starts {
        start.await.unwrap().unwrap();
    }
    drop_schema(&settings).await;
}
