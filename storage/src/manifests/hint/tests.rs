//! What is found from a hint is the newest, whatever became of hint, writers and versions.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use contract::kind::Kind;
use contract::manifest::Manifest;
use contract::time::TimeMs;

use super::*;
use crate::gc::{self, Hints, Keep, Owner, Versions};
use crate::manifests::{self, tests::manifest};
use crate::pins::{self, Pinned};
use crate::{document, domain};

const OWNERS: [&dyn Owner; 2] = [&Versions, &Hints];
const KEEP: Keep = Keep {
    versions: 1,
    age: Duration::from_hours(24),
};

fn product() -> ProductId {
    "p".parse().unwrap()
}

fn key() -> ObjectKey {
    ObjectKey::newest(&product())
}

fn in_days(days: i64) -> TimeMs {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    TimeMs::new(since.as_millis() as i64 + days * 86_400_000).unwrap()
}

/// Publishes a version all of which is there.
async fn publish(store: &Store, number: u64) -> Manifest {
    let mut next = manifest(number, "t");
    next.domain = domain::write(store, &product(), &[true]).await.unwrap();
    manifests::commit(store, &next).await.unwrap();
    next
}

async fn versions(store: &Store, count: u64) {
    for number in 1..=count {
        publish(store, number).await;
    }
}

/// A hint as somebody else wrote it.
async fn write(store: &Store, schema: u32, number: u64) {
    let hint = Hint { schema, number };
    document::put_over(store, &key(), &hint).await.unwrap();
}

async fn told(store: &Store) -> Option<u64> {
    let found = store.read_changing(&key()).await.unwrap();
    found.and_then(|(content, _seen)| number(&key(), &content))
}

/// The newest number as a process finds it that has seen nothing, and the lists and other requests that it took.
async fn cold(store: &Store) -> (Option<u64>, u64, u64) {
    let (store, traffic) = store.counted();
    let newest = manifests::latest(&store, &product()).await.unwrap();
    let counts = traffic.counts();
    let requests = counts.reads + counts.heads;
    (newest.map(|it| it.number), counts.lists, requests)
}

async fn clean(store: &Store) -> Result<usize, StorageError> {
    let plan = gc::plan(store, &OWNERS, KEEP, in_days(2)).await?;
    gc::run(store, &OWNERS, &plan, KEEP, &|_done| ()).await
}

#[tokio::test]
async fn the_newest_of_five_hundred_versions_is_found_by_three_requests_and_no_list() {
    let store = Store::memory();
    assert_eq!(cold(&store).await, (None, 1, 1));
    versions(&store, 500).await;
    assert_eq!(cold(&store).await, (Some(500), 0, 3));
    // Who knows it and has not looked for a while reads nothing but the hint.
    for (known, newer, requests) in [(500, None, 2), (499, Some(500), 4)] {
        let (store, traffic) = store.counted();
        let found = manifests::newer(&store, &product(), known).await.unwrap();
        assert_eq!(found.map(|it| it.number), newer);
        let counts = traffic.counts();
        assert_eq!((counts.lists, counts.reads + counts.heads), (0, requests));
    }
    // One more request a number that the hint is behind, and a list where it is far behind.
    write(&store, SCHEMA, 497).await;
    assert_eq!(cold(&store).await, (Some(500), 0, 7));
    write(&store, SCHEMA, 3).await;
    let (newest, lists, _) = cold(&store).await;
    assert_eq!((newest, lists), (Some(500), 1));
}

#[tokio::test]
async fn a_hint_that_says_nothing_to_be_believed_is_passed_over_and_written_again() {
    for flaw in ["absent", "damaged", "unsealed", "to come", "gone"] {
        let store = Store::memory();
        versions(&store, 3).await;
        let before = damage::count(Kind::Newest);
        match flaw {
            "absent" => store.remove(&key()).await.unwrap(),
            "damaged" => {
                let mut content = store.get(&key()).await.unwrap().to_vec();
                content[21] ^= 1;
                store.put_over(&key(), content.into()).await.unwrap();
            }
            "unsealed" => {
                let content = Bytes::from(r#"{"schema":2,"number":2}"#);
                store.put_over(&key(), content).await.unwrap();
            }
            "to come" => write(&store, SCHEMA + 1, 2).await,
            _ => write(&store, SCHEMA, 7).await,
        }
        let (newest, lists, _) = cold(&store).await;
        assert_eq!((newest, lists), (Some(3), 1), "{flaw}");
        let newer = manifests::newer(&store.counted().0, &product(), 1).await;
        assert_eq!(newer.unwrap().unwrap().number, 3, "{flaw}");
        let is_damage = matches!(flaw, "damaged" | "unsealed");
        let counted = damage::count(Kind::Newest) - before;
        assert!(counted >= 2 || !is_damage, "{flaw}");
        let keys = crate::verify::keys(&store, Some(&product())).await.unwrap();
        let report = crate::verify::run(&store, &keys, &|_, _| ()).await.unwrap();
        let is_found = report.findings.iter().any(|it| it.key == key());
        assert_eq!(is_found, is_damage, "{flaw}");
        publish(&store, 4).await;
        assert_eq!(told(&store).await, Some(4), "{flaw}");
        assert_eq!(cold(&store).await, (Some(4), 0, 3), "{flaw}");
    }
}

#[tokio::test]
async fn versions_behind_a_pinned_one_go_after_the_hint_has_passed_them() {
    // Of writers that were killed before they wrote theirs, and of a product of before there were hints.
    for hint in [Some(1), None] {
        let store = Store::memory();
        let first = publish(&store, 1).await;
        let pinned = pins::pin(&store, &first, None, in_days(0)).await.unwrap();
        assert_eq!(pinned, Pinned::Now);
        for number in 2..=4 {
            publish(&store, number).await;
        }
        match hint {
            Some(number) => write(&store, SCHEMA, number).await,
            None => store.remove(&key()).await.unwrap(),
        }
        assert!(clean(&store).await.unwrap() >= 2);
        let left = manifests::numbers(&store, &product()).await.unwrap();
        assert_eq!((left, told(&store).await), (vec![1, 4], Some(4)));
        assert_eq!(cold(&store).await, (Some(4), 0, 3));
        // Who published the first one has slept since.
        tell(&store, &product(), 1).await.unwrap();
        assert_eq!(told(&store).await, Some(4));
    }
}

#[tokio::test]
async fn a_writer_that_slept_takes_no_hint_back() {
    let store = Store::memory();
    // It has read that there is none, or an older one, and writes after others did.
    for (others, mine) in [(4, 1), (9, 5)] {
        let seen = store.read_changing(&key()).await.unwrap();
        for number in mine..=others {
            publish(&store, number).await;
        }
        let hint = Hint {
            schema: SCHEMA,
            number: mine,
        };
        let content = document::sealed(&key(), &hint).unwrap();
        let seen = seen.as_ref().map(|(_, seen)| seen);
        assert_eq!(store.swap(&key(), seen, content).await.unwrap(), None);
        tell(&store, &product(), mine).await.unwrap();
        assert_eq!(told(&store).await, Some(others));
    }
}

#[tokio::test]
async fn whoever_takes_the_newest_away_or_begins_anew_finds_what_is_there() {
    let store = Store::memory();
    versions(&store, 5).await;
    let remove = async |number| {
        let key = ObjectKey::manifest(&product(), number);
        store.remove(&key).await.unwrap();
    };
    remove(5).await;
    assert_eq!(cold(&store).await.0, Some(4));
    publish(&store, 5).await;
    assert_eq!(cold(&store).await, (Some(5), 0, 3));
    for number in 1..=5 {
        remove(number).await;
    }
    assert_eq!(cold(&store).await.0, None);
    publish(&store, 1).await;
    assert_eq!(told(&store).await, Some(1));
    assert_eq!(cold(&store).await, (Some(1), 0, 3));
}

#[tokio::test]
async fn the_hint_of_a_product_goes_with_its_last_version_and_no_other_does() {
    let store = Store::memory();
    publish(&store, 1).await;
    let gone = ObjectKey::newest(&"q".parse().unwrap());
    let hint = Hint {
        schema: SCHEMA,
        number: 3,
    };
    document::put_new(&store, &gone, &hint).await.unwrap();
    let plan = gc::plan(&store, &OWNERS, KEEP, in_days(0)).await.unwrap();
    assert_eq!(plan.garbage, [], "it may be of one that is landing");
    assert_eq!(clean(&store).await.unwrap(), 1);
    assert_eq!(store.list("newest").await.unwrap(), [key()]);
}

#[tokio::test]
async fn what_cannot_be_written_fails_no_landing_and_lets_no_version_go() {
    let folder = tempfile::tempdir().unwrap();
    // Where hints would lie is a file.
    std::fs::write(folder.path().join("newest"), "in the way").unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    versions(&store, 3).await;
    let (newest, lists, _) = cold(&store).await;
    assert_eq!((newest, lists), (Some(3), 1));
    let error = clean(&store).await.unwrap_err().to_string();
    assert!(error.contains(key().as_str()), "{error}");
    let left = manifests::numbers(&store, &product()).await.unwrap();
    assert_eq!(left, [1, 2, 3]);
}
