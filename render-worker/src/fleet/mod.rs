//! All render workers as one: each picture is asked of the worker that has its fields, and of another one if that has much
//! to do, is full, slow or lost. A large one is asked of several, a part of each.

mod address;
mod error;
mod load;
mod member;
mod parts;
mod place;
mod refusals;
mod rendezvous;
mod settings;
mod watch;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ::service::{Outcome as Ended, Red};
use bytes::Bytes;
use contract::job::RenderJob;
use futures::stream::{FuturesUnordered, StreamExt as _};
use prometheus::{IntCounterVec, IntGaugeVec, Opts, Registry};
use storage::Store;
use tokio::time::Instant;

use crate::annotation::Lifted;
use crate::desk::{Order, Origin};
use crate::wire::proto::{DrawReply, DrawRequest, Origin as OriginCode, Storing as StoringCode};
use crate::wire::{self, Version};
use member::Member;
use parts::Parts;
use refusals::Refusals;

pub use address::{AddressError, HostPort, WorkerAddress};
pub use error::FleetError;
pub use member::Health;
pub use rendezvous::ranked;
pub use settings::{FleetSettings, LARGE_PIXELS};

/// Workers that one picture is asked of at most.
const MOST_TRIES: usize = 4;

/// Asks render workers for pictures. Cheap to clone; the last clone ends the watch over the workers.
#[derive(Clone)]
pub struct Fleet {
    inner: Arc<Inner>,
}

struct Inner {
    settings: FleetSettings,
    version: Version,
    /// By name, so that the order is the same everywhere.
    members: Mutex<BTreeMap<String, Arc<Member>>>,
    red: Red,
    tries: IntCounterVec,
    workers: IntGaugeVec,
    parts: Parts,
}

/// A picture from a worker.
#[derive(Debug, Clone)]
pub struct Picture {
    /// In the encoding that was ordered.
    pub bytes: Bytes,
    /// Where it comes from.
    pub origin: Origin,
    /// Name of the worker; of all that drew a part of it, with commas.
    pub worker: String,
    /// Of a part: how far columns of the whole picture go, where it has a height bar.
    pub lifted: Lifted,
}

impl Fleet {
    /// A fleet with the workers of the settings, watched from now on. Workers store what they draw; pictures that are put
    /// together here from parts are kept in `store`. Needs a runtime.
    pub fn start(
        settings: &FleetSettings,
        store: Store,
        registry: &Registry,
    ) -> Result<Self, FleetError> {
        Self::start_as(Version::own(), settings, store, registry)
    }

    /// The same as if it were another version, for tests of how versions meet.
    pub fn start_as(
        version: Version,
        settings: &FleetSettings,
        store: Store,
        registry: &Registry,
    ) -> Result<Self, FleetError> {
        let setup = |e: prometheus::Error| FleetError::Setup(e.to_string());
        let tries = IntCounterVec::new(
            Opts::new(
                "fluxglobe_render_fleet_tries_total",
                "Pictures asked of single workers, by how that ended.",
            ),
            &["outcome"],
        )
        .map_err(setup)?;
        let workers = IntGaugeVec::new(
            Opts::new(
                "fluxglobe_render_fleet_workers",
                "Render workers, by how they are.",
            ),
            &["health"],
        )
        .map_err(setup)?;
        registry.register(Box::new(tries.clone())).map_err(setup)?;
        registry
            .register(Box::new(workers.clone()))
            .map_err(setup)?;
        let inner = Arc::new(Inner {
            settings: settings.clone(),
            version,
            members: Mutex::default(),
            red: Red::register(registry, "render_fleet").map_err(setup)?,
            tries,
            workers,
            parts: Parts::new(store, registry).map_err(setup)?,
        });
        for address in &settings.render_workers {
            if let WorkerAddress::Fixed(at) = address {
                inner.admit(&at.to_string())?;
            }
        }
        tokio::spawn(watch::run(Arc::downgrade(&inner)));
        Ok(Self { inner })
    }

    /// The picture of a job within the time of the settings. Dropping the future cancels it on the workers.
    pub async fn draw(
        &self,
        job: &RenderJob,
        order: Order,
        trace: &str,
    ) -> Result<Picture, FleetError> {
        let running = self.inner.red.start("draw");
        let drawn = self.inner.draw(job, order, trace).await;
        running.done(drawn.as_ref().map_or_else(ended, |_picture| Ended::Ok));
        drawn
    }

    /// Can pictures be asked for now? How many workers there are, for operators.
    #[expect(
        clippy::unused_async,
        reason = "services are all asked in the same way"
    )]
    pub async fn ready(&self) -> Result<String, FleetError> {
        let healths = self.health();
        let up = healths.values().filter(|health| **health == Health::Up);
        match up.count() {
            0 => Err(FleetError::Unavailable(summary(&healths))),
            up => Ok(format!("{up} of {} render workers", healths.len())),
        }
    }

    /// Every worker and the pictures that it draws or has waiting, of this fleet and of others.
    pub fn loads(&self) -> BTreeMap<String, usize> {
        let members = self.inner.members();
        let load = |(name, member): (&String, &Arc<Member>)| (name.clone(), member.load().pictures);
        members.iter().map(load).collect()
    }

    /// Every worker and how it is.
    pub fn health(&self) -> BTreeMap<String, Health> {
        let members = self.inner.members();
        let health = |(name, member): (&String, &Arc<Member>)| (name.clone(), member.health());
        members.iter().map(health).collect()
    }
}

impl Inner {
    async fn draw(
        &self,
        job: &RenderJob,
        order: Order,
        trace: &str,
    ) -> Result<Picture, FleetError> {
        job.validate()
            .map_err(|e| FleetError::BadRequest(e.to_string()))?;
        let limit = self.settings.deadline();
        let deadline = Instant::now() + limit;
        let late = || FleetError::Late { deadline: limit };
        let request = DrawRequest {
            version: Some(self.version.clone().into()),
            job_json: serde_json::to_string(job)
                .map_err(|e| FleetError::BadRequest(e.to_string()))?,
            trace: trace.to_owned(),
            storing: StoringCode::from(order.storing).into(),
            jpeg_quality: wire::jpeg_quality(order.encoding),
            part: order.part.map(Into::into),
        };
        let asking = async {
            let members = self.in_order(place::of(job));
            if let Some(sharing) = self.sharing(job, order, &members) {
                return self
                    .put_together(job, order, &sharing, &request, deadline)
                    .await;
            }
            self.ask(members, &request, deadline).await
        };
        let asked = tokio::time::timeout_at(deadline, asking).await;
        match asked {
            // The connection's own clock may run out a moment before this one.
            Ok(Err(error)) if error.is_retryable() && Instant::now() >= deadline => Err(late()),
            Ok(asked) => asked,
            Err(_elapsed) => Err(late()),
        }
    }

    /// Asks the workers in their order: the next one when one refuses, or when one takes long.
    async fn ask(
        &self,
        members: Vec<Arc<Member>>,
        request: &DrawRequest,
        deadline: Instant,
    ) -> Result<Picture, FleetError> {
        let mut candidates = members.into_iter().take(MOST_TRIES);
        let mut tries = FuturesUnordered::new();
        let mut refusals = Refusals::default();
        let ask = |member: Arc<Member>| async move {
            let reply = member.draw(request.clone(), deadline).await;
            (member, reply)
        };
        let mut hedge_at = Instant::now();
        loop {
            if tries.is_empty() {
                let Some(member) = candidates.next() else {
                    return Err(refusals.verdict());
                };
                tries.push(ask(member));
                hedge_at = Instant::now() + self.settings.hedge();
            }
            tokio::select! {
                Some((member, reply)) = tries.next() => match reply {
                    Ok(reply) => {
                        self.count("ok");
                        return Ok(picture(&member, reply));
                    }
                    Err(refusal) => {
                        self.count(refusal.label());
                        refusals.add(refusal)?;
                        // Where two were asked, two go on.
                        if !tries.is_empty() {
                            tries.extend(candidates.next().map(&ask));
                        }
                    }
                },
                () = tokio::time::sleep_until(hedge_at), if tries.len() == 1 => {
                    // Two at most: whoever is slow because he has much to do is not helped by more of it.
                    if let Some(member) = candidates.next() {
                        self.count("hedged");
                        tries.push(ask(member));
                    }
                    hedge_at = deadline;
                }
            }
        }
    }

    fn count(&self, outcome: &str) {
        self.tries.with_label_values(&[outcome]).inc();
    }

    /// Workers in the order of the rendezvous, those that have much to do behind the others, those that are thought to be
    /// away last.
    fn in_order(&self, place: &str) -> Vec<Arc<Member>> {
        let members: Vec<Arc<Member>> = self.members().values().cloned().collect();
        let names: Vec<&str> = members.iter().map(|member| member.name.as_str()).collect();
        let ranked = ranked(place, &names).into_iter();
        let in_order = ranked.map(|index| Arc::clone(&members[index]));
        let (hopeful, other): (Vec<_>, Vec<_>) = in_order.partition(|m| m.is_hopeful());
        let hopeful = load::in_order(hopeful, |member| member.load());
        hopeful.into_iter().chain(other).collect()
    }

    fn members(&self) -> MutexGuard<'_, BTreeMap<String, Arc<Member>>> {
        // Changed by single inserts and removals, so a poisoned lock still guards a whole map.
        self.members.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a worker into the fleet, if it is not there.
    fn admit(&self, name: &str) -> Result<(), FleetError> {
        if !self.members().contains_key(name) {
            let most = usize::from(self.settings.render_in_flight);
            let member = Arc::new(Member::new(name.to_owned(), most)?);
            self.members().insert(name.to_owned(), member);
        }
        Ok(())
    }
}

fn picture(member: &Member, reply: DrawReply) -> Picture {
    let origin = match reply.origin() {
        OriginCode::Stored => Origin::Stored,
        OriginCode::Drawn | OriginCode::Unspecified => Origin::Drawn,
    };
    Picture {
        lifted: Lifted {
            up_kg_m2: reply.up_kg_m2,
            down_kg_m2: reply.down_kg_m2,
        },
        bytes: reply.picture,
        origin,
        worker: member.name.clone(),
    }
}

fn summary(healths: &BTreeMap<String, Health>) -> String {
    let why = |(name, health): (&String, &Health)| match health {
        Health::Unknown => format!("{name} was not asked yet"),
        Health::Up => format!("{name} is up"),
        Health::Down(text) | Health::Mismatch(text) => format!("{name}: {text}"),
    };
    let mut all: Vec<String> = healths.iter().map(why).collect();
    all.truncate(8);
    if all.is_empty() {
        all.push("no render worker is known".to_owned());
    }
    all.join("; ")
}

fn ended(error: &FleetError) -> Ended {
    match error {
        FleetError::BadRequest(_) | FleetError::NotFound(_) => Ended::Refused,
        FleetError::Busy { .. } => Ended::Busy,
        FleetError::Unavailable(_) | FleetError::Late { .. } => Ended::Retryable,
        FleetError::Failed(_) | FleetError::Setup(_) => Ended::Failed,
    }
}
