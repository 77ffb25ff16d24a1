//! `fluxglobe gc`: objects that no kept version needs, versions of cubes, and files of killed writers; listed, and removed
//! unless only asked about.

use std::time::Duration;

use anyhow::{Result, bail};
use compute::gc::Computed;
use cube::clean_up::Cleaned;
use ingest::{LandingNotes, Readings};
use observations::Datasets;
use storage::gc::{self, Hints, Keep, Owner, Pictures, Versions};
use storage::{Store, manifests};

use crate::cli::{Gc, Settings};
use crate::command::notice;
use crate::{deployment, progress};

/// Everybody who lays out objects that clean-up may remove, but for cubes, whose library knows what is in use. Never removed are weights (what they were made from is in
/// their name alone), pins, notes of files of observations, and what all services agree on.
const OWNERS: [&dyn Owner; 7] = [
    &Versions,
    &Hints,
    &Pictures,
    &Computed,
    &Datasets,
    &Readings,
    &LandingNotes,
];

pub(crate) async fn run(settings: &Settings, options: &Gc) -> Result<()> {
    let store = deployment::store(settings)?;
    let keep = Keep {
        versions: usize::from(options.keep_versions.get()),
        age: Duration::from_hours(24) * u32::from(options.keep_days),
    };
    let plan = gc::plan(&store, &OWNERS, keep, notice::now()?).await?;
    for garbage in &plan.garbage {
        progress::result(&format!("{} {}", garbage.key, garbage.size_bytes))?;
    }
    for leftover in &plan.leftovers {
        progress::result(&format!("{} {}", leftover.path, leftover.size_bytes))?;
    }
    say_attached(&store).await?;
    if plan.only_pinned_count > 0 {
        progress::say(&format!(
            "{} versions are kept since they are pinned: `fluxglobe keep --list`",
            plan.only_pinned_count
        ));
    }
    let summary = format!(
        "{} objects, {} half-written files, {:.1} MB; {} stay",
        plan.garbage.len(),
        plan.leftovers.len(),
        plan.size_bytes() as f64 / 1e6,
        plan.kept_count
    );
    if options.dry_run {
        progress::say(&format!("would remove {summary}"));
        return cubes(&store, keep, true).await;
    }
    let bar = progress::bar("remove", plan.count() as u64);
    let progress = |done| bar.set_position(done as u64);
    gc::run(&store, &OWNERS, &plan, keep, &progress).await?;
    progress::done(&bar, &summary);
    cubes(&store, keep, false).await
}

/// A line for each product whose values lie elsewhere.
async fn say_attached(store: &Store) -> Result<()> {
    for product in manifests::products(store).await? {
        let Some(newest) = manifests::latest(store, &product).await? else {
            continue;
        };
        if let Some(attachment) = store.attached_to(&newest).await? {
            progress::say(&format!(
                "{product} is attached to {}: of it only references are here; nothing is looked at or removed there",
                attachment.place()
            ));
        }
    }
    Ok(())
}

/// Cleans cubes, after the manifests that they follow; a line for each that had something to remove.
///
/// # Errors
/// After all others, with those that could not be cleaned.
async fn cubes(store: &Store, keep: Keep, is_dry_run: bool) -> Result<()> {
    let mut left = vec![];
    for cleaned in cube::clean_up::run(store, keep, notice::now()?, is_dry_run).await? {
        if !cleaned.is_nothing() {
            progress::result(&format!(
                "{} {}",
                cube::folder(&cleaned.product),
                cleaned.size_bytes
            ))?;
            progress::say(&told(&cleaned, is_dry_run));
        }
        if let Some(reason) = cleaned.refused {
            left.push(format!("{}: {reason}", cleaned.product));
        }
    }
    if !left.is_empty() {
        bail!(
            "cubes were left as they are; what is damaged of one is made again by `fluxglobe recompute --product PRODUCT --verify`: {}",
            left.join("; ")
        );
    }
    Ok(())
}

/// What becomes of a cube. What its versions alone need is known once they have no names.
fn told(cleaned: &Cleaned, is_dry_run: bool) -> String {
    let (product, versions, objects) = (
        &cleaned.product,
        cleaned.versions.len(),
        cleaned.objects_count,
    );
    let becomes = match (is_dry_run, versions) {
        (false, _) => "are gone",
        (true, 0) => "would go",
        (true, _) => "would go, and what these versions alone need, which is not counted",
    };
    format!("{product}: {versions} versions and {objects} objects of the cube {becomes}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::kind::Kind;

    #[test]
    fn what_a_dry_run_cannot_count_of_a_cube_is_said() {
        let mut cleaned = Cleaned {
            product: "flux".parse().unwrap(),
            versions: vec!["1".to_owned(), "2".to_owned()],
            objects_count: 3,
            size_bytes: 4,
            refused: None,
        };
        assert_eq!(
            told(&cleaned, false),
            "flux: 2 versions and 3 objects of the cube are gone"
        );
        assert_eq!(
            told(&cleaned, true),
            "flux: 2 versions and 3 objects of the cube would go, and what these versions alone need, which is not counted"
        );
        cleaned.versions.clear();
        assert!(told(&cleaned, true).ends_with("would go"));
    }

    #[test]
    fn every_kind_of_object_has_one_owner_or_is_never_removed() {
        for kind in Kind::ALL {
            let owners = OWNERS.iter().filter(|owner| owner.kinds().contains(&kind));
            let is_kept_for_ever = matches!(
                kind,
                Kind::Pin | Kind::Weights | Kind::ObservationFile | Kind::Protocol
            );
            let is_owned = !is_kept_for_ever && kind != Kind::Cube;
            assert_eq!(owners.count(), usize::from(is_owned), "{kind:?}");
        }
    }
}
