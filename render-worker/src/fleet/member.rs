//! One worker as its callers know it: a connection, how many pictures are asked of it, and how it was lately.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::Instant;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Request, Status};

use super::FleetError;
use super::load::Load;
use crate::wire::proto::renderer_client::RendererClient;
use crate::wire::proto::{DrawReply, DrawRequest, StatusReply, StatusRequest};
use crate::wire::{self, MOST_REPLY_BYTES, Version};

/// A worker that takes no connection within this time is away.
const CONNECT_LIMIT: Duration = Duration::from_secs(1);
/// How often a connection is asked whether it lives, and how long the answer may take.
const PING: Duration = Duration::from_secs(2);
/// A worker that does not say how it is within this time is away.
const STATUS_LIMIT: Duration = Duration::from_secs(1);
/// When to ask again if nobody says.
const USUAL_RETRY: Duration = Duration::from_secs(1);

/// How a worker was when it was last asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Health {
    /// Not asked yet.
    Unknown,
    /// It draws.
    Up,
    /// It stops, does not answer or cannot be reached.
    Down(String),
    /// It is of another version.
    Mismatch(String),
}

/// One worker.
pub(super) struct Member {
    /// `HOST:PORT`, which is also its name in the rendezvous.
    pub(super) name: String,
    channel: Channel,
    in_flight: AtomicUsize,
    most_in_flight: usize,
    /// What others had it do when it was last asked.
    of_others: AtomicUsize,
    /// Pictures that it draws at the same time, as it says; at least one.
    draws_at_once: AtomicUsize,
    health: Mutex<Health>,
}

/// What a try that brought no picture means for the next.
#[derive(Debug)]
pub(super) enum Refusal {
    /// No worker would draw it.
    Final(FleetError),
    /// This one is full.
    Busy(Duration),
    /// This one is gone, stopping, of another version, or cannot reach its store.
    Elsewhere(String),
    /// This one tried and failed.
    Failed(String),
}

struct InFlight<'a>(&'a AtomicUsize);

impl Drop for InFlight<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

impl Member {
    /// A worker that is not connected to until it is asked something.
    pub(super) fn new(name: String, most_in_flight: usize) -> Result<Self, FleetError> {
        let endpoint = Endpoint::from_shared(format!("http://{name}"))
            .map_err(|e| FleetError::Setup(format!("{name}: {e}")))?
            .connect_timeout(CONNECT_LIMIT)
            .tcp_nodelay(true)
            .http2_keep_alive_interval(PING)
            .keep_alive_timeout(PING)
            .keep_alive_while_idle(true);
        Ok(Self {
            name,
            channel: endpoint.connect_lazy(),
            in_flight: AtomicUsize::new(0),
            most_in_flight,
            of_others: AtomicUsize::new(0),
            draws_at_once: AtomicUsize::new(1),
            health: Mutex::new(Health::Unknown),
        })
    }

    pub(super) fn health(&self) -> Health {
        self.lock().clone()
    }

    pub(super) fn is_hopeful(&self) -> bool {
        matches!(*self.lock(), Health::Unknown | Health::Up)
    }

    /// What it has to do.
    pub(super) fn load(&self) -> Load {
        let own = self.in_flight.load(Ordering::Acquire);
        Load {
            pictures: own + self.of_others.load(Ordering::Acquire),
            draws_at_once: self.draws_at_once.load(Ordering::Acquire),
        }
    }

    /// Would it begin a picture at once?
    pub(super) fn is_ready(&self) -> bool {
        *self.lock() == Health::Up && self.load().has_turn()
    }

    fn learn(&self, reply: &StatusReply) {
        let said = reply.queue_length as usize + reply.in_flight as usize;
        let own = self.in_flight.load(Ordering::Acquire);
        let of_others = said.saturating_sub(own);
        self.of_others.store(of_others, Ordering::Release);
        let at_once = (reply.draws_at_once as usize).max(1);
        self.draws_at_once.store(at_once, Ordering::Release);
    }

    fn lock(&self) -> MutexGuard<'_, Health> {
        self.health.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn becomes(&self, health: Health) {
        let mut known = self.lock();
        if *known != health {
            let (worker, now) = (self.name.as_str(), &health);
            match &health {
                Health::Unknown | Health::Up => tracing::info!(worker, ?now, "render worker"),
                Health::Down(_) | Health::Mismatch(_) => {
                    tracing::warn!(worker, ?now, "render worker");
                }
            }
            *known = health;
        }
    }

    /// Asks how it is.
    pub(super) async fn look(&self, own: &Version) {
        let mut client = RendererClient::new(self.channel.clone());
        let asked = client.status(StatusRequest {});
        let health = match tokio::time::timeout(STATUS_LIMIT, asked).await {
            Err(_elapsed) => Health::Down(format!("no answer in {} s", STATUS_LIMIT.as_secs())),
            Ok(Err(status)) => Health::Down(short(&status)),
            Ok(Ok(reply)) => {
                let reply = reply.into_inner();
                self.learn(&reply);
                match own.quarrel(reply.version.as_ref()) {
                    Some(quarrel) => Health::Mismatch(quarrel),
                    None if reply.stopping => Health::Down("it is stopping".to_owned()),
                    None => Health::Up,
                }
            }
        };
        self.becomes(health);
    }

    /// Asks for a picture.
    pub(super) async fn draw(
        &self,
        request: DrawRequest,
        deadline: Instant,
    ) -> Result<DrawReply, Refusal> {
        let before = self.in_flight.fetch_add(1, Ordering::AcqRel);
        let _counted = InFlight(&self.in_flight);
        if before >= self.most_in_flight {
            return Err(Refusal::Busy(USUAL_RETRY));
        }
        let mut client =
            RendererClient::new(self.channel.clone()).max_decoding_message_size(MOST_REPLY_BYTES);
        let mut request = Request::new(request);
        request.set_timeout(deadline.saturating_duration_since(Instant::now()));
        match client.draw(request).await {
            Ok(reply) => Ok(reply.into_inner()),
            Err(status) => Err(self.refused(&status, deadline)),
        }
    }

    fn refused(&self, status: &Status, deadline: Instant) -> Refusal {
        let text = status.message().to_owned();
        match status.code() {
            Code::InvalidArgument => Refusal::Final(FleetError::BadRequest(text)),
            Code::NotFound => Refusal::Final(FleetError::NotFound(text)),
            Code::ResourceExhausted => {
                let wait = wire::read_retry_after(status.metadata());
                Refusal::Busy(wait.unwrap_or(USUAL_RETRY))
            }
            Code::FailedPrecondition => {
                self.becomes(Health::Mismatch(text.clone()));
                Refusal::Elsewhere(text)
            }
            Code::Internal => Refusal::Failed(text),
            // It lives, but something that it needs does not.
            Code::Aborted => Refusal::Elsewhere(text),
            Code::Cancelled | Code::DeadlineExceeded if Instant::now() >= deadline => {
                Refusal::Elsewhere(text)
            }
            _ => {
                let text = short(status);
                self.becomes(Health::Down(text.clone()));
                Refusal::Elsewhere(format!("{}: {text}", self.name))
            }
        }
    }
}

/// A status without what may be long in it.
fn short(status: &Status) -> String {
    let text: String = status.message().chars().take(200).collect();
    format!("{:?}: {text}", status.code())
}
