//! Products that a command derived in; what is made of them brought up to date with `--follow`, and else named where it is behind.

use anyhow::Result;
use compute::DeriveProgress;
use contract::event::Event;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use storage::Store;
use storage::log::EventLog;

use super::behind::{say_what_is_left, say_what_would_follow};
use crate::cli::Settings;
use crate::{deployment, progress};

/// Tells of a derived version, once.
pub(super) async fn tell(log: Option<&dyn EventLog>, manifest: &Manifest) -> Result<()> {
    if let (Some(log), Some(body)) = (log, compute::derive::derived(manifest)) {
        let event = Event::new(manifest.id().to_string(), body);
        storage::log::tell_once(log, &event).await?;
    }
    Ok(())
}

/// Brings along what is made of products if that is asked for, telling of every version; says what is of an older version then.
pub(super) async fn onwards(
    settings: &Settings,
    (store, log): (&Store, Option<&dyn EventLog>),
    derived: &[&ProductId],
    is_followed: bool,
) -> Result<()> {
    if !is_followed {
        return say_what_would_follow(store, derived).await;
    }
    let bar = progress::bar("bring along", 0);
    let engine = deployment::engine(settings, store.clone())?;
    let on_step = |progress: DeriveProgress| {
        bar.set_length(progress.all_steps as u64);
        bar.set_position(progress.done_steps as u64);
    };
    let mut newest: Vec<ManifestId> = vec![];
    for product in derived {
        for manifest in compute::dependents::follow_telling(&engine, product, &on_step).await? {
            tell(log, &manifest).await?;
            newest = with_newest(newest, manifest.id());
        }
    }
    progress::done(&bar, &counted(newest.len()));
    for id in newest {
        progress::result(&id.to_string())?;
    }
    say_what_is_left(store, derived).await
}

/// Each product once, by its newest version, after all that it is made of: it may be made of several that were derived.
fn with_newest(mut all: Vec<ManifestId>, newest: ManifestId) -> Vec<ManifestId> {
    all.retain(|one| one.product != newest.product);
    all.push(newest);
    all
}

fn counted(products: usize) -> String {
    match products {
        0 => "nothing is made of it".to_owned(),
        1 => "1 product".to_owned(),
        count => format!("{count} products"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_made_of_several_is_named_once_by_its_newest_version() {
        let ids = ["a@2-00000000", "b@1-00000000", "a@3-00000000"];
        let all = ids
            .iter()
            .fold(vec![], |all, id| with_newest(all, id.parse().unwrap()));
        let all: Vec<String> = all.iter().map(ToString::to_string).collect();
        assert_eq!(all, ["b@1-00000000", "a@3-00000000"]);
        assert_eq!(counted(all.len()), "2 products");
    }
}
