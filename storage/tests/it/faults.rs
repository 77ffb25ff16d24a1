//! A real S3 server behind a proxy that loses answers, fails and is late. Each test sees that its faults fired.

use std::time::{Duration, Instant};

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use storage::store::{RetryLimits, Settings};
use storage::{StorageError, Store};

use crate::fault_proxy::{Fault, FaultProxy};
use crate::stores;
use crate::suite::noise;

/// Settings of this process with another endpoint and less retry limit.
fn settings(endpoint: &str, retries: Duration) -> Settings {
    let variables = std::env::vars()
        .filter(|(name, _)| !name.starts_with("AWS_ENDPOINT_URL"))
        .chain([("AWS_ENDPOINT_URL".to_owned(), endpoint.to_owned())]);
    let mut settings = Settings::from_variables(variables);
    settings.retry_limits = RetryLimits {
        connect: Duration::from_secs(1),
        request: Duration::from_secs(3),
        retries,
    };
    settings
}

async fn behind_proxy(retries: Duration) -> (FaultProxy, Store) {
    let proxy = FaultProxy::start(&stores::service("FLUXGLOBE_S3_ENDPOINT")).await;
    let store = Store::open_with(&stores::s3_url(), &settings(&proxy.url(), retries)).unwrap();
    (proxy, store)
}

fn key() -> ObjectKey {
    "manifests/p/0000000001.json".parse().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_answer_to_a_creation_is_read_back() {
    let (proxy, store) = behind_proxy(Duration::from_secs(20)).await;
    proxy.next("PUT", Fault::LoseAnswer, 1);
    // The object was written, then refused as existing: nobody else wrote it.
    assert!(!store.put_new(&key(), Bytes::from("one")).await.unwrap());
    assert_eq!(proxy.fired(), 1);
    assert_eq!(store.get(&key()).await.unwrap(), "one");
    let other = store.put_new(&key(), Bytes::from("two")).await;
    assert!(matches!(other, Err(StorageError::Conflict { .. })));
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_is_too_late_is_read_back() {
    let (proxy, store) = behind_proxy(Duration::from_secs(20)).await;
    proxy.next("PUT", Fault::Delay(Duration::from_secs(30)), 1);
    let begun = Instant::now();
    assert!(!store.put_new(&key(), Bytes::from("one")).await.unwrap());
    assert_eq!(proxy.fired(), 1);
    assert!(
        begun.elapsed() >= Duration::from_secs(3),
        "the limit of a request"
    );
    assert!(
        begun.elapsed() < Duration::from_secs(25),
        "it waited for the answer"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_conflict_that_wrote_nothing_is_sent_again() {
    let (proxy, store) = behind_proxy(Duration::from_secs(20)).await;
    proxy.next("PUT", Fault::Status(409), 2);
    assert!(store.put_new(&key(), Bytes::from("one")).await.unwrap());
    assert_eq!(proxy.fired(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_fails_for_a_while_is_waited_for() {
    let (proxy, store) = behind_proxy(Duration::from_mins(1)).await;
    proxy.next("PUT", Fault::Status(500), 5);
    assert!(store.put_new(&key(), Bytes::from("one")).await.unwrap());
    proxy.next("GET", Fault::Status(503), 4);
    assert_eq!(store.get(&key()).await.unwrap(), "one");
    proxy.next("HEAD", Fault::Status(500), 3);
    assert!(store.exists(&key()).await.unwrap());
    proxy.next("GET", Fault::Status(429), 2);
    assert_eq!(store.list("").await.unwrap(), [key()]);
    assert_eq!(proxy.fired(), 14);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_keeps_failing_ends_in_a_retryable_error_in_bounded_time() {
    let (proxy, store) = behind_proxy(Duration::from_secs(3)).await;
    for method in ["PUT", "GET", "HEAD"] {
        proxy.next(method, Fault::Status(500), usize::MAX);
    }
    let begun = Instant::now();
    let written = store.put_new(&key(), Bytes::from("one")).await.unwrap_err();
    let read = store.get(&key()).await.unwrap_err();
    let probed = store.check_writable().await.unwrap_err();
    for error in [written, read, probed] {
        assert!(error.is_retryable(), "{error}");
    }
    // Six calls at most, each its retries, one pause and one request longer.
    assert!(
        begun.elapsed() < Duration::from_secs(6 * 11),
        "{:?}",
        begun.elapsed()
    );
    assert!(proxy.fired() > 12);
    proxy.heal();
    assert!(store.put_new(&key(), Bytes::from("one")).await.unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_breaks_off_is_read_on() {
    let (proxy, store) = behind_proxy(Duration::from_secs(20)).await;
    let content = noise(3_000_000, 4);
    store.put_new(&key(), content.clone()).await.unwrap();
    proxy.next("GET", Fault::CutBody(1_000_000), 2);
    assert!(store.get(&key()).await.unwrap() == content);
    assert_eq!(proxy.fired(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_in_parts_survives_faults_at_each_of_its_requests() {
    let (proxy, store) = behind_proxy(Duration::from_mins(1)).await;
    let content = noise(65 << 20, 5);
    let key = ObjectKey::raw(&"p".parse().unwrap(), &Digest::of(&content));
    proxy.next("POST", Fault::Status(500), 1);
    proxy.next("PUT", Fault::Status(503), 2);
    proxy.next("PUT", Fault::LoseAnswer, 1);
    store.put_new(&key, content.clone()).await.unwrap();
    assert_eq!(proxy.fired(), 4);
    assert!(store.get(&key).await.unwrap() == content);
    assert!(!store.put_new(&key, content).await.unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_request_is_not_repeated() {
    let (proxy, store) = behind_proxy(Duration::from_secs(20)).await;
    for (status, retryable) in [(400, false), (403, false), (401, false)] {
        proxy.next("PUT", Fault::Status(status), 1);
        let before = proxy.seen();
        let error = store.put_new(&key(), Bytes::from("x")).await.unwrap_err();
        assert_eq!(error.is_retryable(), retryable, "{status}: {error}");
        assert_eq!(proxy.seen() - before, 1, "{status}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_credentials_and_buckets_are_found_before_any_work() {
    let endpoint = stores::service("FLUXGLOBE_S3_ENDPOINT");
    let right = settings(&endpoint, Duration::from_secs(5));
    let missing = Store::open_with("s3://no-such-bucket-here/p", &right).unwrap();
    let error = missing.check_writable().await.unwrap_err();
    assert!(error.to_string().contains("make it first"), "{error}");
    let written = missing.put_new(&key(), Bytes::from("x")).await.unwrap_err();
    assert!(
        matches!(written, StorageError::Location { .. }),
        "{written}"
    );

    let variables = std::env::vars().map(|(name, value)| match name.as_str() {
        "AWS_SECRET_ACCESS_KEY" => (name, "a-wrong-secret".to_owned()),
        _ => (name, value),
    });
    let wrong = Store::open_with(&stores::s3_url(), &Settings::from_variables(variables)).unwrap();
    let error = wrong.check_writable().await.unwrap_err();
    assert!(matches!(error, StorageError::Location { .. }), "{error}");
    assert!(error.to_string().contains("credentials"), "{error}");
    assert!(!error.to_string().contains("a-wrong-secret"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_not_there_is_away_and_not_wrong() {
    let nobody = settings("http://127.0.0.1:9", Duration::from_secs(1));
    let store = Store::open_with(&stores::s3_url(), &nobody).unwrap();
    let error = store.check_writable().await.unwrap_err();
    assert!(error.is_retryable(), "{error}");
    let hdfs = Store::open_with("hdfs://127.0.0.1:9/p", &nobody).unwrap();
    let error = hdfs.check_writable().await.unwrap_err();
    assert!(error.is_retryable(), "{error}");
}
