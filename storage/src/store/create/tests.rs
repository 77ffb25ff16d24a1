//! Creating once, against stores that lose answers, tell untruths and fail.

use super::*;
use crate::store::RetryLimits;
use crate::store::faulty::{Fault, Faulty, absent, broken, denied, exists, full};
use crate::store::warnings::Warnings;
use contract::digest::Digest;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

fn store(faulty: &Arc<Faulty>) -> Store {
    Store {
        objects: Arc::clone(faulty) as _,
        place: Place::Cloud,
        retry_limits: RetryLimits {
            retries: Duration::from_millis(600),
            ..RetryLimits::default()
        },
        ..Store::memory()
    }
}

fn key() -> ObjectKey {
    "manifests/p/0000000001.json".parse().unwrap()
}

#[tokio::test]
async fn a_lost_answer_is_read_back_and_not_written_twice() {
    let faulty = Faulty::new([Fault::LoseAnswer]);
    let store = store(&faulty);
    assert!(!store.put_new(&key(), Bytes::from("one")).await.unwrap());
    assert_eq!(store.get(&key()).await.unwrap(), "one");
    assert_eq!(faulty.put_count(), 1);
}

#[tokio::test]
async fn exists_without_an_object_is_sent_again() {
    let faulty = Faulty::new([Fault::Fail(exists), Fault::Fail(broken)]);
    let store = store(&faulty);
    assert!(store.put_new(&key(), Bytes::from("one")).await.unwrap());
    assert_eq!(faulty.put_count(), 3);
}

#[tokio::test]
async fn another_writers_object_is_a_conflict_however_the_answer_came() {
    for fault in [Fault::Fail(broken), Fault::Fail(exists)] {
        let faulty = Faulty::new([fault]);
        faulty
            .inner
            .put(&path(&key()), "theirs".into())
            .await
            .unwrap();
        // Of the same length: the content is compared, not the size.
        let ours = store(&faulty).put_new(&key(), Bytes::from("ours!!")).await;
        assert!(
            matches!(ours, Err(StorageError::Conflict { .. })),
            "{ours:?}"
        );
    }
}

#[tokio::test]
async fn a_store_that_stays_broken_ends_in_a_retryable_error() {
    let faulty = Faulty::always(Fault::Fail(broken));
    let begun = Instant::now();
    let error = store(&faulty).put_new(&key(), Bytes::from("x")).await;
    assert!(error.unwrap_err().is_retryable());
    assert!(faulty.put_count() > 1 && begun.elapsed() < Duration::from_secs(30));
}

#[tokio::test]
async fn why_a_full_store_is_waited_for_is_told_once_and_at_once() {
    let (warned, _guard) = Warnings::kept();
    let faulty = Faulty::always(Fault::Fail(full));
    let error = store(&faulty)
        .put_new(&key(), Bytes::from("x"))
        .await
        .unwrap_err();
    assert!(error.is_retryable() && error.takes_nothing(), "{error}");
    assert!(faulty.put_count() > 2, "it was not waited for");
    let lines = warned.lines();
    let [line] = &lines[..] else {
        panic!("{lines:?}");
    };
    for part in [key().as_str(), &full().to_string(), "at most 0.6 s"] {
        assert!(line.contains(part), "{line}");
    }
}

#[tokio::test]
async fn objects_that_wait_together_are_told_of_once_and_counted_in_the_end() {
    let (warned, _guard) = Warnings::kept();
    let faulty = Faulty::always(Fault::Fail(full));
    let store = store(&faulty);
    let keys: Vec<ObjectKey> = (1..=5)
        .map(|number| {
            format!("manifests/p/000000000{number}.json")
                .parse()
                .unwrap()
        })
        .collect();
    let puts = keys.iter().map(|key| store.put_new(key, Bytes::from("x")));
    let room = async {
        while faulty.put_count() < keys.len() {
            tokio::task::yield_now().await;
        }
        *faulty.always.lock().unwrap() = None;
    };
    let (stored, ()) = tokio::join!(futures::future::join_all(puts), room);
    assert!(stored.into_iter().all(|stored| stored.unwrap()));
    let lines = warned.lines();
    let [first, last] = &lines[..] else {
        panic!("{lines:?}");
    };
    assert!(first.contains(&full().to_string()), "{first}");
    assert!(
        last.contains("5 objects waited for the store: 5 of them went well"),
        "{last}"
    );
    // The next time is another one.
    *faulty.always.lock().unwrap() = Some(Fault::Fail(full));
    let key = "manifests/p/0000000006.json".parse().unwrap();
    store.put_new(&key, Bytes::from("x")).await.unwrap_err();
    assert_eq!(warned.lines().len(), 3);
}

#[tokio::test]
async fn a_refusal_is_told_at_once() {
    let faulty = Faulty::always(Fault::Fail(denied));
    let error = store(&faulty)
        .put_new(&key(), Bytes::from("x"))
        .await
        .unwrap_err();
    assert!(!error.is_retryable());
    assert_eq!(faulty.put_count(), 1);
    let faulty = Faulty::always(Fault::Fail(absent));
    let error = store(&faulty)
        .put_new(&key(), Bytes::from("x"))
        .await
        .unwrap_err();
    assert!(matches!(error, StorageError::Location { .. }), "{error}");
}

#[tokio::test]
async fn only_what_is_named_by_its_content_is_sent_in_parts() {
    let faulty = Faulty::new([]);
    let store = store(&faulty);
    let large = Bytes::from(vec![1; WHOLE_BYTES as usize + 1]);
    let named = ObjectKey::raw(&"p".parse().unwrap(), &Digest::of(&large));
    assert!(store.put_new(&named, large.clone()).await.unwrap());
    assert!(!store.put_new(&named, large.clone()).await.unwrap());
    assert_eq!(faulty.multipart_count.load(Ordering::Relaxed), 1);
    assert_eq!(faulty.put_count(), 0);
    assert!(store.put_new(&key(), large.clone()).await.unwrap());
    assert_eq!(faulty.put_count(), 1);
    assert!(store.get(&named).await.unwrap() == large);
}

#[tokio::test]
async fn what_the_name_vouches_for_takes_the_place_of_what_is_damaged() {
    let store = Store::memory();
    let content = Bytes::from("an input file");
    let named = ObjectKey::raw(&"p".parse().unwrap(), &Digest::of(&content));
    store
        .put_over(&named, Bytes::from("an input fila"))
        .await
        .unwrap();
    let error = store.get(&named).await.unwrap_err();
    assert!(error.to_string().contains(named.as_str()), "{error}");
    // Other bytes, and no better.
    let wrong = store.put_new(&named, Bytes::from("another")).await;
    assert!(
        matches!(wrong, Err(StorageError::Damaged { .. })),
        "{wrong:?}"
    );
    assert!(store.put_new(&named, content.clone()).await.unwrap());
    assert_eq!(store.get(&named).await.unwrap(), content);
    assert!(!store.put_new(&named, content).await.unwrap());
}

#[tokio::test]
async fn names_of_half_written_objects_are_not_taken() {
    let key = "a/.b.tmp.1".parse().unwrap();
    let made = Store::memory().put_new(&key, Bytes::from("x")).await;
    assert!(matches!(made, Err(StorageError::Damaged { .. })));
}
