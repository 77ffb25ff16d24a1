//! A proxy that carries bytes of any protocol, and whose connections break or freeze as told.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

/// What befalls the connections that are open or come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Mood {
    /// Carried.
    Fine,
    /// Cut as soon as the server has answered so many bytes more; the answer is lost with the connection.
    CutAfter(usize),
}

struct Shared {
    upstream: String,
    mood: watch::Sender<Mood>,
    /// Counts up: connections of an older age are frozen, open for ever and silent.
    age: watch::Sender<u32>,
    cut: AtomicUsize,
}

/// A running proxy; it ends with this value.
pub(crate) struct CutProxy {
    address: SocketAddr,
    shared: Arc<Shared>,
    task: tokio::task::JoinHandle<()>,
}

impl CutProxy {
    /// Starts before `upstream`, a `HOST:PORT`.
    pub(crate) async fn start(upstream: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let shared = Arc::new(Shared {
            upstream: upstream.to_owned(),
            mood: watch::Sender::new(Mood::Fine),
            age: watch::Sender::new(0),
            cut: AtomicUsize::new(0),
        });
        let serving = Arc::clone(&shared);
        let task = tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let shared = Arc::clone(&serving);
                tokio::spawn(async move { carry(client, &shared).await.ok() });
            }
        });
        Self {
            address,
            shared,
            task,
        }
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    pub(crate) fn set(&self, mood: Mood) {
        self.shared.mood.send_replace(mood);
    }

    /// Connections that are open now stay open and never carry anything again.
    pub(crate) fn freeze_open_ones(&self) {
        self.shared.age.send_modify(|age| *age += 1);
    }

    /// How many connections were cut.
    pub(crate) fn cut_count(&self) -> usize {
        self.shared.cut.load(Ordering::Relaxed)
    }
}

impl Drop for CutProxy {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn carry(client: TcpStream, shared: &Shared) -> std::io::Result<()> {
    let mut age = shared.age.subscribe();
    age.mark_unchanged();
    let server = TcpStream::connect(&shared.upstream).await?;
    let (from_client, to_client) = client.into_split();
    let (from_server, to_server) = server.into_split();
    let carried = async {
        tokio::select! {
            up = forward(from_client, to_server) => up,
            down = answer(from_server, to_client, shared) => down,
        }
    };
    tokio::pin!(carried);
    tokio::select! {
        ended = &mut carried => ended,
        _frozen = age.changed() => std::future::pending().await,
    }
}

async fn forward(mut from: OwnedReadHalf, mut to: OwnedWriteHalf) -> std::io::Result<()> {
    tokio::io::copy(&mut from, &mut to).await.map(|_bytes| ())
}

async fn answer(
    mut from: OwnedReadHalf,
    mut to: OwnedWriteHalf,
    shared: &Shared,
) -> std::io::Result<()> {
    let mut buffer = vec![0; 64 << 10];
    let mut carried_bytes = 0;
    loop {
        let read = from.read(&mut buffer).await?;
        if read == 0 {
            return to.shutdown().await;
        }
        carried_bytes += read;
        let mood = *shared.mood.borrow();
        if matches!(mood, Mood::CutAfter(limit) if carried_bytes > limit) {
            shared.cut.fetch_add(1, Ordering::Relaxed);
            return Ok(());
        }
        to.write_all(&buffer[..read]).await?;
    }
}
