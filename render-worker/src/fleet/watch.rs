//! The watch over a fleet: names are looked up again, workers asked how they are, once a second.

use std::collections::BTreeSet;
use std::sync::{Arc, Weak};
use std::time::Duration;

use futures::future::join_all;
use tokio::time::Instant;

use super::member::Member;
use super::{Health, HostPort, Inner, WorkerAddress};

/// Between two looks at the workers.
const LOOK: Duration = Duration::from_secs(1);
/// Between two look-ups of a name.
const LOOK_UP: Duration = Duration::from_secs(3);
/// A name server that takes longer is asked again the next time.
const LOOK_UP_LIMIT: Duration = Duration::from_secs(2);
/// Workers that one name may bring.
const MOST_OF_A_NAME: usize = 256;

/// Watches until the fleet is dropped.
pub(super) async fn run(fleet: Weak<Inner>) {
    let mut looked_up: Option<Instant> = None;
    loop {
        let Some(inner) = fleet.upgrade() else { return };
        if looked_up.is_none_or(|last| last.elapsed() >= LOOK_UP) {
            inner.look_up_names().await;
            looked_up = Some(Instant::now());
        }
        let members: Vec<Arc<Member>> = inner.members().values().cloned().collect();
        join_all(members.iter().map(|member| member.look(&inner.version))).await;
        inner.count_workers();
        drop(inner);
        tokio::time::sleep(LOOK).await;
    }
}

impl Inner {
    /// Brings the members of names up to date. A name that cannot be looked up keeps those it had.
    async fn look_up_names(&self) {
        let mut wanted = BTreeSet::new();
        for address in &self.settings.render_workers {
            match address {
                WorkerAddress::Fixed(at) => {
                    wanted.insert(at.to_string());
                }
                WorkerAddress::Looked(at) => match look_up(at).await {
                    Ok(found) => wanted.extend(found),
                    Err(error) => {
                        tracing::warn!(name = %at, error, "render workers cannot be looked up");
                        return;
                    }
                },
            }
        }
        for name in &wanted {
            if let Err(error) = self.admit(name) {
                tracing::warn!(%error, "a render worker is left out");
            }
        }
        self.members().retain(|name, _| wanted.contains(name));
    }

    fn count_workers(&self) {
        let mut counts = [("unknown", 0), ("up", 0), ("down", 0), ("mismatch", 0)];
        for member in self.members().values() {
            let index = match member.health() {
                Health::Unknown => 0,
                Health::Up => 1,
                Health::Down(_) => 2,
                Health::Mismatch(_) => 3,
            };
            counts[index].1 += 1;
        }
        for (health, count) in counts {
            self.workers.with_label_values(&[health]).set(count);
        }
    }
}

async fn look_up(at: &HostPort) -> Result<BTreeSet<String>, String> {
    let asked = tokio::net::lookup_host((at.host.as_str(), at.port));
    let found = tokio::time::timeout(LOOK_UP_LIMIT, asked)
        .await
        .map_err(|_elapsed| "no answer".to_owned())?
        .map_err(|e| e.to_string())?;
    // As text, in brackets where an address needs them.
    let names = found
        .take(MOST_OF_A_NAME)
        .map(|address| address.to_string());
    Ok(names.collect())
}
