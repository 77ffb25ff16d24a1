//! What is kept of a cube, and what is found wrong with one.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use chrono::TimeDelta;
use contract::key::ObjectKey;
use contract::time::TimeMs;
use cube::{At, CubeError, Repository, clean_up, follow, verify};
use futures::FutureExt as _;
use storage::gc::Keep;
use storage::pins::{self, Pinned};
use storage::verify::Fault;
use storage::{Store, manifests};

use crate::follow::{holds, version};
use crate::product::{grid, stores};
use crate::watched::{ahead, broken, watched};

/// A product of three versions, the last without the first's step, and its cube.
async fn three_versions(store: &Store) -> Vec<contract::manifest::Manifest> {
    let steps: [&[(u32, u32)]; 3] = [&[(1, 1)], &[(1, 10), (2, 2)], &[(1, 10), (2, 2), (3, 3)]];
    let mut all = vec![];
    for (at, steps) in steps.iter().enumerate() {
        let manifest = version(store, grid(40, 60), at as u64 + 1, steps).await;
        manifests::commit(store, &manifest).await.unwrap();
        follow(store, &manifest).await.unwrap();
        all.push(manifest);
    }
    all
}

pub(crate) fn in_hours(hours: i64) -> TimeMs {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    TimeMs::new(since.unwrap().as_millis() as i64 + hours * 3_600_000).unwrap()
}

async fn keys(store: &Store) -> BTreeSet<ObjectKey> {
    store.list("cubes").await.unwrap().into_iter().collect()
}

#[tokio::test]
async fn versions_that_are_not_kept_go_with_what_they_alone_need_and_the_others_stay() {
    let (_folder, stores) = stores();
    for store in stores {
        let versions = three_versions(&store).await;
        let all = keys(&store).await;
        let keep = |hours| Keep {
            versions: 2,
            age: Duration::from_hours(hours),
        };
        // Nothing is old enough; and where it is only looked, nothing goes.
        let young = clean_up::run(&store, keep(2), in_hours(1), false).await;
        assert!(young.unwrap().iter().all(clean_up::Cleaned::is_nothing));
        let looked = clean_up::run(&store, keep(1), in_hours(2), true).await;
        assert_eq!(looked.unwrap()[0].versions, ["1"]);
        assert_eq!(keys(&store).await, all);
        // Its manifest has gone before.
        let first = ObjectKey::manifest(&"p".parse().unwrap(), 1);
        store.remove(&first).await.unwrap();
        let cleaned = clean_up::run(&store, keep(1), in_hours(2), false).await;
        let cleaned = cleaned.unwrap().remove(0);
        assert_eq!(cleaned.versions, ["1"]);
        let gone = all.difference(&keys(&store).await).count() as u64;
        assert!(
            gone == cleaned.objects_count && gone >= 3,
            "{gone} {cleaned:?}"
        );
        assert!(cleaned.size_bytes > 0);
        let repository = Repository::open(&store, "cubes/p").await.unwrap();
        assert_eq!(repository.versions().await.unwrap(), ["2", "3"]);
        holds(
            &store,
            At::Version("2".to_owned()),
            &versions[1],
            &[(1, 10), (2, 2)],
        )
        .await;
        holds(&store, At::Newest, &versions[2], &[(1, 10), (2, 2), (3, 3)]).await;
        // What is left is whole, and goes on.
        let product = "p".parse().unwrap();
        let checked = verify::check(&store, &product, &BTreeSet::new())
            .await
            .unwrap();
        assert_eq!(checked.findings, []);
        let next = version(&store, grid(40, 60), 4, &[(1, 10)]).await;
        assert_eq!(follow(&store, &next).await.unwrap().put_count, 0);
        // An old one that comes late changes nothing.
        assert_eq!(
            follow(&store, &versions[0]).await.unwrap().version,
            next.id()
        );
        let again = clean_up::run(&store, keep(1), in_hours(0), false).await;
        assert!(again.unwrap()[0].is_nothing());
    }
}

#[tokio::test]
async fn a_version_that_is_pinned_keeps_its_name_and_what_it_needs_until_it_is_released() {
    let store = Store::memory();
    let versions = three_versions(&store).await;
    let product = "p".parse().unwrap();
    // What is pinned is all there.
    let domain = &versions[0].domain;
    store.put_new(domain, "".into()).await.unwrap();
    let pinned = pins::pin(&store, &versions[0], None, in_hours(0)).await;
    assert_eq!(pinned.unwrap(), Pinned::Now);
    let keep = Keep {
        versions: 1,
        age: Duration::ZERO,
    };
    let looked = clean_up::run(&store, keep, in_hours(2), true).await;
    assert_eq!(looked.unwrap()[0].versions, ["2"]);
    store
        .remove(&ObjectKey::manifest(&product, 2))
        .await
        .unwrap();
    let cleaned = clean_up::run(&store, keep, in_hours(2), false).await;
    assert_eq!(cleaned.unwrap()[0].versions, ["2"]);
    let first = At::Version("1".to_owned());
    holds(&store, first, &versions[0], &[(1, 1)]).await;
    assert!(pins::release(&store, &product, 1).await.unwrap());
    store
        .remove(&ObjectKey::manifest(&product, 1))
        .await
        .unwrap();
    let cleaned = clean_up::run(&store, keep, in_hours(2), false).await;
    assert_eq!(cleaned.unwrap()[0].versions, ["1"]);
}

#[tokio::test]
async fn what_a_step_held_that_was_dropped_goes_with_the_last_version_that_has_it() {
    let store = Store::memory();
    let chunks = async || store.list("cubes/p/chunks").await.unwrap().len();
    let all: Vec<(u32, u32)> = (1..=5).map(|of| (of, of)).collect();
    for (number, steps) in [(1, &all[..]), (2, &all[..2])] {
        let manifest = version(&store, grid(40, 60), number, steps).await;
        manifests::commit(&store, &manifest).await.unwrap();
        follow(&store, &manifest).await.unwrap();
    }
    let before = chunks().await;
    let first = ObjectKey::manifest(&"p".parse().unwrap(), 1);
    store.remove(&first).await.unwrap();
    let keep = Keep {
        versions: 1,
        age: Duration::ZERO,
    };
    clean_up::run(&store, keep, in_hours(2), false)
        .await
        .unwrap();
    assert_eq!(before - chunks().await, 3);
}

/// Whatever one of them has read of the cube's entry when the other goes by.
#[tokio::test]
async fn of_two_that_clean_up_at_once_each_takes_what_the_other_took_for_gone() {
    let keep = Keep {
        versions: 1,
        age: Duration::ZERO,
    };
    for nth in 0..12 {
        let inner = Store::memory();
        let versions = three_versions(&inner).await;
        let first = ObjectKey::manifest(&"p".parse().unwrap(), 1);
        inner.remove(&first).await.unwrap();
        let (other, reads) = (inner.clone(), AtomicUsize::new(0));
        let (store, _removed) = watched(&inner, move |key| {
            let is_turn = key == "cubes/p/repo" && reads.fetch_add(1, Ordering::Relaxed) == nth;
            let other = other.clone();
            async move {
                if is_turn {
                    let cleaned = clean_up::run(&other, keep, in_hours(2), false).await;
                    cleaned.unwrap();
                }
                Ok(())
            }
            .boxed()
        });
        let cleaned = clean_up::run(&store, keep, in_hours(2), false).await;
        let cleaned = cleaned.unwrap().remove(0);
        assert_eq!(cleaned.refused, None, "read {nth}");
        let repository = Repository::open(&inner, "cubes/p").await.unwrap();
        assert_eq!(repository.versions().await.unwrap(), ["2", "3"]);
        let steps = [(1, 10), (2, 2), (3, 3)];
        holds(&inner, At::Newest, &versions[2], &steps).await;
    }
}

/// As in a copy of a store, all of whose objects are young while the states of its cubes tell when they were made.
#[tokio::test]
async fn a_version_whose_manifest_stays_keeps_its_name_however_old_its_state_is() {
    let store = Store::memory();
    let versions = three_versions(&store).await;
    let keep = Keep {
        versions: 1,
        age: Duration::ZERO,
    };
    let cleaned = clean_up::run(&store, keep, in_hours(2), false).await;
    assert!(cleaned.unwrap()[0].versions.is_empty());
    for (manifest, steps) in versions.iter().zip([&[(1, 1)][..], &[(1, 10), (2, 2)]]) {
        let tag = At::Version(manifest.number.to_string());
        holds(&store, tag, manifest, steps).await;
    }
}

#[tokio::test]
async fn a_cube_that_cannot_be_read_is_told_and_the_others_are_cleaned() {
    let store = Store::memory();
    let versions = three_versions(&store).await;
    for (name, key) in [("broken", "repo"), ("begun", "chunks/0123")] {
        let manifest = contract::manifest::Manifest {
            product: name.parse().unwrap(),
            ..versions[0].clone()
        };
        manifests::commit(&store, &manifest).await.unwrap();
        let key = format!("cubes/{name}/{key}").parse().unwrap();
        store.put_new(&key, "no cube".into()).await.unwrap();
    }
    let first = ObjectKey::manifest(&"p".parse().unwrap(), 1);
    store.remove(&first).await.unwrap();
    let keep = Keep {
        versions: 1,
        age: Duration::ZERO,
    };
    let cleaned = clean_up::run(&store, keep, in_hours(2), false).await;
    let cleaned = cleaned.unwrap();
    let [broken, whole] = &cleaned[..] else {
        panic!("{cleaned:?}");
    };
    let reason = broken.refused.as_deref().unwrap();
    assert!(
        broken.product.as_str() == "broken" && reason.contains("cubes/broken"),
        "{reason}"
    );
    assert_eq!((whole.product.as_str(), &whole.refused), ("p", &None));
    assert_eq!(whole.versions, ["1"]);
}

#[tokio::test]
async fn a_cube_of_a_version_that_is_gone_is_made_again() {
    let store = Store::memory();
    let versions = three_versions(&store).await;
    let newest = ObjectKey::manifest(&"p".parse().unwrap(), 3);
    store.remove(&newest).await.unwrap();
    let product = "p".parse().unwrap();
    assert!(verify::mend(&store, &product).await.unwrap());
    holds(&store, At::Newest, &versions[1], &[(1, 10), (2, 2)]).await;
}

#[tokio::test]
async fn a_state_whose_number_another_version_has_now_is_told_and_the_cube_made_again() {
    let store = Store::memory();
    let versions = three_versions(&store).await;
    let product = "p".parse().unwrap();
    let newest = ObjectKey::manifest(&product, 3);
    store.remove(&newest).await.unwrap();
    // The cube cannot follow what has its number, and follows the next one.
    let other = version(&store, grid(40, 60), 3, &[(1, 10), (2, 5)]).await;
    manifests::commit(&store, &other).await.unwrap();
    follow(&store, &other).await.unwrap_err();
    let next = version(&store, grid(40, 60), 4, &[(1, 10), (2, 6)]).await;
    manifests::commit(&store, &next).await.unwrap();
    follow(&store, &next).await.unwrap();
    let checked = verify::check(&store, &product, &BTreeSet::new()).await;
    let checked = checked.unwrap();
    let [finding] = &checked.findings[..] else {
        panic!("{checked:?}");
    };
    assert_eq!(finding.fault, Fault::Damaged);
    for id in [versions[2].id(), other.id()] {
        let is_named = finding.reason.contains(&id.to_string());
        assert!(is_named, "{}", finding.reason);
    }
    assert!(verify::mend(&store, &product).await.unwrap());
    let third = At::Version("3".to_owned());
    holds(&store, third, &other, &[(1, 10), (2, 5)]).await;
    holds(&store, At::Newest, &next, &[(1, 10), (2, 6)]).await;
}

#[tokio::test]
async fn each_part_that_is_gone_or_damaged_is_told_and_the_cube_made_again() {
    let product = "p".parse().unwrap();
    let names = keys(&{
        let store = Store::memory();
        three_versions(&store).await;
        store
    })
    .await
    .len();
    let mut parts = BTreeSet::new();
    for (at, is_gone) in (0..names).flat_map(|at| [(at, false), (at, true)]) {
        let store = Store::memory();
        let versions = three_versions(&store).await;
        let Some(key) = keys(&store).await.into_iter().nth(at) else {
            continue;
        };
        let part = key.as_str().split('/').nth(2).unwrap().to_owned();
        let mut damaged = BTreeSet::new();
        if is_gone {
            store.remove(&key).await.unwrap();
        } else {
            let mut flipped = store.get(&key).await.unwrap().to_vec();
            let middle = flipped.len() / 2;
            flipped[middle] ^= 1;
            store.put_over(&key, flipped.into()).await.unwrap();
            damaged.insert(key.clone());
            let found = storage::verify::damaged(&store, keys(&store).await).await;
            assert_eq!(found.unwrap(), damaged);
        }
        let checked = verify::check(&store, &product, &damaged).await.unwrap();
        if part == "chunks" {
            let place = &checked.places[&key];
            assert!(place.contains("of carbon_flux in "), "{place}");
            let missing = checked.findings.iter().map(|it| (&it.key, it.fault));
            let expected = is_gone.then_some((&key, Fault::Missing));
            assert_eq!(missing.collect::<Vec<_>>(), Vec::from_iter(expected));
        }
        // Logs of transactions are for people, and so is the state before the first commit.
        let is_found = !damaged.is_empty() || !checked.findings.is_empty();
        let is_needed = matches!(part.as_str(), "chunks" | "manifests" | "repo");
        assert!(is_found || !is_needed, "{key} gone: {checked:?}");
        let mending = verify::mending(&store, &product).await.unwrap();
        let is_to_be_made = mending == verify::Mending::MadeAgain;
        let is_made = verify::mend(&store, &product).await.unwrap();
        assert_eq!((is_to_be_made, is_made), (is_found, is_found), "{key}");
        let newest = [(1, 10), (2, 2), (3, 3)];
        holds(&store, At::Newest, &versions[2], &newest).await;
        if is_made {
            holds(&store, At::Version("1".to_owned()), &versions[0], &[(1, 1)]).await;
            parts.insert(part);
        }
    }
    let all = ["chunks", "manifests", "repo", "snapshots", "transactions"];
    assert_eq!(parts, all.map(str::to_owned).into());
}

#[tokio::test]
async fn a_cube_that_is_behind_is_told_and_brought_up() {
    let store = Store::memory();
    three_versions(&store).await;
    let next = version(&store, grid(40, 60), 4, &[(1, 10)]).await;
    manifests::commit(&store, &next).await.unwrap();
    let product = "p".parse().unwrap();
    let checked = verify::check(&store, &product, &BTreeSet::new())
        .await
        .unwrap();
    let [finding] = &checked.findings[..] else {
        panic!("{checked:?}");
    };
    assert_eq!(finding.fault, Fault::Behind);
    assert!(finding.reason.contains("p@4-"), "{}", finding.reason);
    let mending = verify::mending(&store, &product).await;
    assert_eq!(mending.unwrap(), verify::Mending::BroughtUp);
    assert!(!verify::mend(&store, &product).await.unwrap());
    let mending = verify::mending(&store, &product).await;
    assert_eq!(mending.unwrap(), verify::Mending::Nothing);
    holds(&store, At::Newest, &next, &[(1, 10)]).await;
}

#[tokio::test]
async fn a_cube_that_is_gone_comes_back_with_all_versions_that_are_kept() {
    let store = Store::memory();
    let versions = three_versions(&store).await;
    for key in keys(&store).await {
        store.remove(&key).await.unwrap();
    }
    let product = "p".parse().unwrap();
    let mending = verify::mending(&store, &product).await;
    assert_eq!(mending.unwrap(), verify::Mending::BroughtUp);
    assert!(!verify::mend(&store, &product).await.unwrap());
    let steps = [(1, 10), (2, 2), (3, 3)];
    holds(&store, At::Newest, &versions[2], &steps).await;
    for (at, steps) in [&[(1, 1)][..], &steps[..2], &steps].into_iter().enumerate() {
        let tag = At::Version((at + 1).to_string());
        holds(&store, tag, &versions[at], steps).await;
    }
}

#[tokio::test]
async fn a_cube_that_nothing_was_committed_to_yet_is_behind_and_no_more() {
    let inner = Store::memory();
    let first = version(&inner, grid(40, 60), 1, &[(1, 1)]).await;
    manifests::commit(&inner, &first).await.unwrap();
    // Its field cannot be read, once its repository is made.
    let (store, _removed) = watched(&inner, |key| {
        let is_field = key.starts_with("frames/");
        async move { if is_field { Err(broken()) } else { Ok(()) } }.boxed()
    });
    follow(&store, &first).await.unwrap_err();
    let (product, entry) = ("p".parse().unwrap(), "cubes/p/repo".parse().unwrap());
    assert!(inner.exists(&entry).await.unwrap());
    // Who is killed earlier leaves what a repository begins with.
    for is_made in [true, false] {
        if !is_made {
            inner.remove(&entry).await.unwrap();
        }
        let checked = verify::check(&inner, &product, &BTreeSet::new()).await;
        let checked = checked.unwrap();
        let [finding] = &checked.findings[..] else {
            panic!("{checked:?}");
        };
        assert_eq!(finding.fault, Fault::Behind);
        assert!(finding.reason.contains("none"), "{}", finding.reason);
        let keep = Keep {
            versions: 1,
            age: Duration::from_hours(2),
        };
        let cleaned = clean_up::run(&inner, keep, in_hours(0), false).await;
        let is_refused = |one: &clean_up::Cleaned| one.refused.is_some();
        assert!(!cleaned.unwrap().iter().any(is_refused));
    }
    assert!(!verify::mend(&inner, &product).await.unwrap());
    holds(&inner, At::Newest, &first, &[(1, 1)]).await;
}

#[tokio::test]
async fn a_damaged_version_of_the_product_keeps_nobody_from_the_rest_of_its_cube() {
    let store = Store::memory();
    three_versions(&store).await;
    let product = "p".parse().unwrap();
    let newest = ObjectKey::manifest(&product, 3);
    let mut flipped = store.get(&newest).await.unwrap().to_vec();
    flipped[20] ^= 1;
    store.put_over(&newest, flipped.into()).await.unwrap();
    let chunk = store.list("cubes/p/chunks").await.unwrap().remove(0);
    store.remove(&chunk).await.unwrap();
    let damaged = BTreeSet::from([newest]);
    let checked = verify::check(&store, &product, &damaged).await.unwrap();
    let found: Vec<_> = checked
        .findings
        .iter()
        .map(|it| (&it.key, it.fault))
        .collect();
    assert_eq!(found, [(&chunk, Fault::Missing)]);
}

#[tokio::test]
async fn a_cube_that_is_made_again_is_found_damaged_until_all_of_it_is_gone() {
    let inner = Store::memory();
    three_versions(&inner).await;
    let all = keys(&inner).await;
    let chunk = inner.list("cubes/p/chunks").await.unwrap().remove(0);
    inner.remove(&chunk).await.unwrap();
    let (store, removed) = watched(&inner, |_key| async { Ok(()) }.boxed());
    assert!(verify::mend(&store, &"p".parse().unwrap()).await.unwrap());
    let removed = removed.lock().unwrap();
    // Before all what the store's clock was read off.
    assert_eq!(removed.len(), all.len());
    assert_eq!(removed[0], "cubes/p/clock");
    assert_eq!(removed.last().unwrap(), "cubes/p/repo");
}

#[tokio::test]
async fn where_the_clock_lets_nothing_be_committed_no_cube_is_removed() {
    let inner = Store::memory();
    three_versions(&inner).await;
    let next = version(&inner, grid(40, 60), 4, &[(1, 10)]).await;
    manifests::commit(&inner, &next).await.unwrap();
    let product = "p".parse().unwrap();
    let chunk = inner.list("cubes/p/chunks").await.unwrap().remove(0);
    for is_damaged in [false, true] {
        if is_damaged {
            inner.remove(&chunk).await.unwrap();
        }
        let all = keys(&inner).await;
        for minutes in [-20, 20] {
            let (store, removed) = ahead(&inner, TimeDelta::minutes(minutes));
            let refused = verify::mend(&store, &product).await.unwrap_err();
            assert!(matches!(refused, CubeError::Clock { .. }), "{refused:?}");
            // What could not be committed stays beside it.
            assert!(keys(&inner).await.is_superset(&all), "{minutes}");
            let removed = removed.lock().unwrap();
            let expected: &[&str] = if is_damaged { &["cubes/p/clock"] } else { &[] };
            assert_eq!(*removed, expected, "{minutes}");
        }
    }
    let (store, _removed) = ahead(&inner, TimeDelta::minutes(5));
    assert!(verify::mend(&store, &product).await.unwrap());
    holds(&inner, At::Newest, &next, &[(1, 10)]).await;
}

#[tokio::test]
async fn a_store_that_fails_at_any_request_is_no_reason_to_make_a_sound_cube_again() {
    let inner = Store::memory();
    three_versions(&inner).await;
    let (product, all) = ("p".parse().unwrap(), keys(&inner).await);
    let mut failures = 0;
    for nth in 0.. {
        let count = Arc::<AtomicUsize>::default();
        let counted = Arc::clone(&count);
        let (store, removed) = watched(&inner, move |key| {
            let is_of_cube = key.starts_with("cubes/p/");
            let is_it = is_of_cube && counted.fetch_add(1, Ordering::SeqCst) == nth;
            async move { if is_it { Err(broken()) } else { Ok(()) } }.boxed()
        });
        let mended = verify::mend(&store, &product).await;
        assert!(removed.lock().unwrap().is_empty(), "request {nth}");
        assert_eq!(keys(&inner).await, all, "request {nth}");
        match mended {
            Ok(is_made) => assert!(!is_made, "request {nth}"),
            Err(error) => {
                assert!(error.is_retryable(), "request {nth}: {error}");
                failures += 1;
            }
        }
        if count.load(Ordering::SeqCst) <= nth {
            break;
        }
    }
    assert!(failures > all.len(), "{failures}");
}

#[tokio::test]
async fn a_cube_that_others_bring_to_a_newer_version_meanwhile_is_left_as_it_is() {
    let product = "p".parse().unwrap();
    for nth in 0.. {
        let inner = Store::memory();
        three_versions(&inner).await;
        let count = Arc::<AtomicUsize>::default();
        let (counted, others) = (Arc::clone(&count), inner.clone());
        let (store, removed) = watched(&inner, move |_key| {
            let is_it = counted.fetch_add(1, Ordering::SeqCst) == nth;
            let others = others.clone();
            async move {
                if is_it {
                    let next = version(&others, grid(40, 60), 4, &[(1, 10), (4, 4)]).await;
                    manifests::commit(&others, &next).await.unwrap();
                    follow(&others, &next).await.unwrap();
                }
                Ok(())
            }
            .boxed()
        });
        let mended = verify::mend(&store, &product).await;
        assert!(removed.lock().unwrap().is_empty(), "request {nth}");
        assert!(!mended.unwrap(), "request {nth}");
        if count.load(Ordering::SeqCst) <= nth {
            break;
        }
        let newest = manifests::latest(&inner, &product).await.unwrap().unwrap();
        assert_eq!(newest.number, 4, "request {nth}");
        holds(&inner, At::Newest, &newest, &[(1, 10), (4, 4)]).await;
    }
}
