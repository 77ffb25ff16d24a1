//! Connections: a listening socket in, at most so many at once out, each of which ends when its client only pretends.
//!
//! | limit | what it is against |
//! |---|---|
//! | connections at once | more file handles and memory than there are; those beyond get 503 at once |
//! | time for a request's head | clients that send their request a byte at a time, so that it never begins |
//! | time without a byte in either direction | clients that are gone without a word, or never take their answer |
//!
//! None of it is a layer's work: layers see requests whose heads are whole, and nothing of the bytes of an answer. They only
//! tell that one is being answered.

pub(crate) mod counts;
mod guarded;
mod phase;

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::serve::Listener;
use prometheus::IntGauge;
use tokio::io::AsyncReadExt as _;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::config::Settings;
use crate::metrics::Metrics;

use counts::Counts;
pub(crate) use guarded::Guarded;

/// What a client beyond the limit is told.
const FULL: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\ncontent-type: application/json\r\ncontent-length: 66\r\nretry-after: 1\r\ncache-control: no-store\r\nconnection: close\r\n\r\n{\"error\":\"too many connections are open; please try again later\"}\n";
/// Clients that are told so at the same time; those beyond are hung up on.
const MOST_TOLD: usize = 256;
/// How long a client that is told so may take to hear it.
const TELLING: Duration = Duration::from_secs(1);
/// Pause after an accept that failed for want of file handles or memory.
const PAUSE: Duration = Duration::from_millis(200);

/// Limits of every connection.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// For the head of a request, from its first byte (of the first request: from the connection) to its last.
    pub(crate) head: Duration,
    /// Without a byte in either direction.
    pub(crate) idle: Duration,
}

/// A socket that lets in as many as there is room for.
pub(crate) struct Door {
    listener: TcpListener,
    room: Arc<Semaphore>,
    telling: Arc<Semaphore>,
    limits: Limits,
    counts: Counts,
}

/// A place among the connections, given back when it ends.
pub(crate) struct Place {
    _permit: OwnedSemaphorePermit,
    open: IntGauge,
}

impl Place {
    fn take(permit: OwnedSemaphorePermit, open: IntGauge) -> Self {
        open.inc();
        Self {
            _permit: permit,
            open,
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.open.dec();
    }
}

impl Door {
    pub(crate) fn new(listener: TcpListener, settings: &Settings, metrics: &Metrics) -> Self {
        // While an answer is computed nothing moves: that alone is no reason to hang up.
        let idle_s = settings.idle_limit_s.max(settings.request_limit_s + 5);
        Self {
            listener,
            room: Arc::new(Semaphore::new(settings.connections as usize)),
            telling: Arc::new(Semaphore::new(MOST_TOLD)),
            limits: Limits {
                head: Duration::from_secs(settings.head_limit_s),
                idle: Duration::from_secs(idle_s),
            },
            counts: metrics.connections.clone(),
        }
    }

    /// Tells a client that there is no room, without keeping others waiting.
    fn turn_away(&self, mut stream: TcpStream) {
        self.counts.ended.with_label_values(&["full"]).inc();
        let Ok(telling) = Arc::clone(&self.telling).try_acquire_owned() else {
            return;
        };
        tokio::spawn(async move {
            // What the client sent must be read first: a socket that is closed over unread bytes takes back its answer.
            let heard = async {
                let mut head = [0; 4096];
                let read = stream.read(&mut head).await?;
                tokio::io::AsyncWriteExt::write_all(&mut stream, FULL).await?;
                tokio::io::AsyncWriteExt::shutdown(&mut stream).await?;
                // Until the client hangs up.
                while read > 0 && stream.read(&mut head).await? > 0 {}
                Ok::<_, io::Error>(())
            };
            if let Ok(Err(error)) = tokio::time::timeout(TELLING, heard).await {
                tracing::debug!(%error, "a client did not wait to be turned away");
            }
            drop(telling);
        });
    }
}

impl Listener for Door {
    type Io = Guarded;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Guarded, SocketAddr) {
        loop {
            let (stream, address) = match self.listener.accept().await {
                Ok(accepted) => accepted,
                Err(error) if is_of_one_client(&error) => continue,
                Err(error) => {
                    tracing::error!(%error, "no connection can be accepted");
                    tokio::time::sleep(PAUSE).await;
                    continue;
                }
            };
            // Tiles are small answers to small requests: waiting to fill a packet only delays them.
            if let Err(error) = stream.set_nodelay(true) {
                tracing::debug!(%error, "a connection keeps its delay");
            }
            match Arc::clone(&self.room).try_acquire_owned() {
                Ok(permit) => {
                    let place = Place::take(permit, self.counts.open.clone());
                    let ended = self.counts.ended.clone();
                    return (Guarded::new(stream, self.limits, place, ended), address);
                }
                Err(_no_room) => self.turn_away(stream),
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// Did this client go before it was let in?
fn is_of_one_client(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::ConnectionRefused
            | io::ErrorKind::ConnectionAborted
            | io::ErrorKind::ConnectionReset
    )
}
