//! Retries against a store that fails, loses answers and falls silent.

use super::*;
use crate::store::faulty::{Fault, Faulty, broken, denied, exists};
use crate::store::warnings::Warnings;
use bytes::Bytes;
use object_store::ObjectStoreExt as _;
use std::sync::Mutex;
use std::time::Instant;

const SHORT: RetryLimits = RetryLimits {
    connect: Duration::from_millis(100),
    request: Duration::from_millis(200),
    retries: Duration::from_millis(1500),
};

fn retrying(inner: &Arc<Faulty>) -> RetryStore {
    let inner = Arc::clone(inner);
    let connect = Box::new(move || Ok(Arc::clone(&inner) as Client));
    RetryStore::new(connect, SHORT, |e| e).unwrap()
}

fn here() -> Path {
    Path::from("a/b")
}

#[tokio::test]
async fn a_failure_that_passes_is_waited_for() {
    let (warned, _guard) = Warnings::kept();
    let inner = Faulty::new([Fault::Fail(broken), Fault::Hang, Fault::Fail(broken)]);
    retrying(&inner).put(&here(), "x".into()).await.unwrap();
    assert_eq!(inner.put_count(), 4);
    // The first failure is told with its reason, and for how long there will be others.
    let lines = warned.lines();
    let is_told = |line: &String| line.contains("500") && line.contains("at most 1.5 s");
    assert!(lines.len() == 1 && is_told(&lines[0]), "{lines:?}");
}

#[tokio::test]
async fn a_store_that_never_answers_is_given_up_in_bounded_time() {
    let inner = Faulty::always(Fault::Hang);
    let begun = Instant::now();
    let error = retrying(&inner).put(&here(), "x".into()).await.unwrap_err();
    assert!(
        error.to_string().contains("no answer within 0.2 s"),
        "{error}"
    );
    assert!(may_pass(&error));
    // Retries, and the attempt at their end.
    assert!(
        begun.elapsed() < Duration::from_secs(20),
        "{:?}",
        begun.elapsed()
    );
    assert!(inner.put_count() > 2);
}

#[tokio::test]
async fn what_will_not_change_is_not_tried_again() {
    for refuse in [denied as fn() -> Error, exists] {
        let inner = Faulty::always(Fault::Fail(refuse));
        let error = retrying(&inner).put(&here(), "x".into()).await.unwrap_err();
        assert_eq!(error.to_string(), refuse().to_string());
        assert_eq!(inner.put_count(), 1);
    }
}

#[tokio::test]
async fn reads_wait_too_whole_or_in_part() {
    let inner = Faulty::new([]);
    inner.inner.put(&here(), "hello".into()).await.unwrap();
    let store = retrying(&inner);
    let expect = async |answer: &'static str, range: Option<std::ops::Range<u64>>| {
        inner
            .gets
            .lock()
            .unwrap()
            .extend([Fault::Fail(broken), Fault::Hang]);
        let options = GetOptions::new().with_range(range);
        let found = store.get_opts(&here(), options).await.unwrap();
        assert_eq!(found.bytes().await.unwrap(), answer);
        assert!(
            inner.gets.lock().unwrap().is_empty(),
            "the faults did not fire"
        );
    };
    expect("hello", None).await;
    expect("ell", Some(1..4)).await;
    let listed: Vec<_> = store.list(None).try_collect().await.unwrap();
    assert_eq!(listed.len(), 1);
    store.delete(&here()).await.unwrap();
    assert!(matches!(
        store.get(&here()).await,
        Err(Error::NotFound { .. })
    ));
}

#[tokio::test]
async fn long_answers_come_piece_by_piece() {
    let inner = Faulty::new([]);
    let long = Bytes::from(vec![7; WHOLE_BYTES as usize + 1]);
    inner.inner.put(&here(), long.clone().into()).await.unwrap();
    let found = retrying(&inner).get(&here()).await.unwrap();
    assert!(found.bytes().await.unwrap() == long);
}

#[tokio::test]
async fn a_silent_client_is_left_for_a_new_one() {
    let clients = Mutex::new(vec![Faulty::new([]), Faulty::always(Fault::Hang)]);
    let last = Arc::clone(&clients.lock().unwrap()[0]);
    let connect = Box::new(move || Ok(clients.lock().unwrap().pop().unwrap() as Client));
    let store = RetryStore::new(connect, SHORT, |e| e).unwrap();
    store.put(&here(), "x".into()).await.unwrap();
    assert_eq!(last.put_count(), 1);
}
