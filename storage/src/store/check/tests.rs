//! The probe against stores that cannot be worked with.

use super::*;
use crate::store::faulty::{Fault, Faulty, absent, broken, denied};
use std::sync::Arc;

fn store(faulty: Arc<Faulty>) -> Store {
    Store {
        objects: faulty,
        place: Place::Cloud,
        ..Store::memory()
    }
}

async fn finding(faulty: Arc<Faulty>) -> StorageError {
    store(faulty).check_writable().await.unwrap_err()
}

#[tokio::test]
async fn a_good_store_passes_and_keeps_nothing_of_the_probe() {
    let folder = tempfile::tempdir().unwrap();
    let local = Store::open(folder.path().to_str().unwrap()).unwrap();
    for store in [local, Store::memory()] {
        store.check_writable().await.unwrap();
        assert!(store.list("").await.unwrap().is_empty());
        assert!(store.folders("").await.unwrap().is_empty());
    }
}

/// Keys without that right are what services should have; some stores refuse it with an answer that could be any failure.
#[tokio::test]
async fn a_store_where_nothing_may_be_removed_can_be_worked_with() {
    for refusal in [denied as fn() -> _, broken] {
        let faulty = Arc::new(Faulty {
            removals: Some(refusal),
            ..Faulty::default()
        });
        let store = store(faulty);
        store.check_writable().await.unwrap();
        store.check_writable().await.unwrap();
        let left = store.list("").await.unwrap();
        assert!(left.iter().all(|key| key.is_in(PROBES)), "{left:?}");
        assert_eq!(left.len(), 2);
    }
}

#[tokio::test]
async fn a_store_that_creates_twice_is_refused() {
    let faulty = Arc::new(Faulty {
        overwrites: true,
        ..Faulty::default()
    });
    let error = finding(faulty).await;
    assert!(
        error.to_string().contains("conditional creation"),
        "{error}"
    );
    assert!(!error.is_retryable());
}

#[tokio::test]
async fn a_store_without_permission_or_bucket_is_refused_with_the_reason() {
    for (fault, reason) in [
        (denied as fn() -> _, "no permission"),
        (absent, "make it first"),
    ] {
        let error = finding(Faulty::always(Fault::Fail(fault))).await;
        assert!(matches!(error, StorageError::Location { .. }));
        assert!(error.to_string().contains(reason), "{error}");
    }
}

#[tokio::test]
async fn a_store_that_is_away_is_not_a_wrong_store() {
    let error = finding(Faulty::always(Fault::Fail(broken))).await;
    assert!(error.is_retryable(), "{error}");
}

#[tokio::test]
async fn a_lost_answer_to_the_probe_is_no_finding() {
    // The client sends again by itself, and is told that the probe exists.
    let faulty = Faulty::new([]);
    let key = probe_key();
    faulty
        .inner
        .put(&path(&key), key.as_str().to_owned().into())
        .await
        .unwrap();
    let content = Bytes::from(key.as_str().to_owned());
    store(faulty).probe(&key, &content).await.unwrap();
}
