//! The watch over a fleet: names are looked up again, workers asked how they are, once a second.

use std::collections::{BTreeMap, BTreeSet};
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

/// Workers of each name, as it was answered for last.
type Answers = BTreeMap<HostPort, BTreeSet<String>>;

/// Watches until the fleet is dropped.
pub(super) async fn run(fleet: Weak<Inner>) {
    let mut looked_up: Option<Instant> = None;
    let mut answers = Answers::new();
    loop {
        let Some(inner) = fleet.upgrade() else { return };
        if looked_up.is_none_or(|last| last.elapsed() >= LOOK_UP) {
            inner.look_up_names(&mut answers).await;
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
    /// Brings the members of names up to date. A name that cannot be looked up keeps those it had, and holds up no other.
    async fn look_up_names(&self, answers: &mut Answers) {
        let mut wanted = BTreeSet::new();
        let mut names = vec![];
        for address in &self.settings.render_workers {
            match address {
                WorkerAddress::Fixed(at) => {
                    wanted.insert(at.to_string());
                }
                WorkerAddress::Looked(at) => names.push(at),
            }
        }
        let found = join_all(names.iter().map(|at| look_up(at))).await;
        for (at, found) in names.into_iter().zip(found) {
            wanted.extend(workers_of(answers, at, found));
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

/// Those that were found at a name; where it could not be looked up, those that it had.
fn workers_of(
    answers: &mut Answers,
    at: &HostPort,
    found: Result<BTreeSet<String>, String>,
) -> BTreeSet<String> {
    match found {
        Ok(found) => {
            answers.insert(at.clone(), found);
        }
        Err(error) => {
            tracing::warn!(name = %at, error, "render workers cannot be looked up");
        }
    }
    answers.get(at).cloned().unwrap_or_default()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_cannot_be_looked_up_keeps_the_workers_it_had() {
        let mut answers = Answers::new();
        let (gpu, cpu): (HostPort, HostPort) =
            ("gpu:50061".parse().unwrap(), "cpu:50061".parse().unwrap());
        let two = BTreeSet::from(["10.0.0.1:50061".to_owned(), "10.0.0.2:50061".to_owned()]);
        let away = || Err("no answer".to_owned());
        assert!(workers_of(&mut answers, &gpu, away()).is_empty());
        assert_eq!(workers_of(&mut answers, &gpu, Ok(two.clone())), two);
        assert_eq!(workers_of(&mut answers, &gpu, away()), two);
        assert!(workers_of(&mut answers, &cpu, away()).is_empty());
        assert!(workers_of(&mut answers, &gpu, Ok(BTreeSet::new())).is_empty());
        assert!(workers_of(&mut answers, &gpu, away()).is_empty());
    }
}
