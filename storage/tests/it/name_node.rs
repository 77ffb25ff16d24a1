//! A real Hadoop file system whose name node is reached over connections that break, freeze or refuse.

use std::time::{Duration, Instant};

use bytes::Bytes;
use contract::key::ObjectKey;
use storage::Store;
use storage::store::{RetryLimits, Settings};

use crate::cut_proxy::{CutProxy, Mood};
use crate::stores;
use crate::suite::noise;

const REQUEST: Duration = Duration::from_secs(4);

/// A place of its own, its name node behind a proxy.
async fn behind_proxy() -> (CutProxy, Store) {
    let url = stores::hdfs_url();
    let rest = url.strip_prefix("hdfs://").unwrap();
    let (node, prefix) = rest.split_once('/').unwrap();
    let proxy = CutProxy::start(node).await;
    let mut settings = Settings::from_environment();
    settings.retry_limits = RetryLimits {
        connect: Duration::from_secs(1),
        request: REQUEST,
        retries: Duration::from_mins(1),
    };
    let through = format!("hdfs://{}/{prefix}", proxy.address());
    (proxy, Store::open_with(&through, &settings).unwrap())
}

fn key(number: u64) -> ObjectKey {
    format!("objects/{number}").parse().unwrap()
}

async fn clear(store: &Store) {
    for key in store.list("").await.unwrap() {
        store.remove(&key).await.unwrap();
    }
    store.remove_leftovers(Duration::ZERO).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_are_created_once_over_connections_that_break() {
    let (proxy, store) = behind_proxy().await;
    for number in 0..24 {
        // Somewhere in the talk of one creation: at any of its calls, before or after the name node has done it.
        proxy.set(Mood::CutAfter(60 + 97 * number as usize));
        let content = noise(10_000, number);
        let made = tokio::spawn({
            let (store, content) = (store.clone(), content.clone());
            async move { store.put_new(&key(number), content).await }
        });
        // Every connection breaks until this one was hit twice; then they hold.
        let goal = proxy.cut_count() + 2;
        while proxy.cut_count() < goal && !made.is_finished() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        proxy.set(Mood::Fine);
        made.await.unwrap().unwrap();
        assert_eq!(store.get(&key(number)).await.unwrap(), content);
    }
    println!("{} connections were cut", proxy.cut_count());
    assert!(
        proxy.cut_count() >= 20,
        "{} cuts: this tests little",
        proxy.cut_count()
    );
    let listed = store.list("objects").await.unwrap();
    assert_eq!(listed.len(), 24, "{listed:?}");
    clear(&store).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frozen_connection_is_left_for_a_new_one() {
    let (proxy, store) = behind_proxy().await;
    store.put_new(&key(1), Bytes::from("x")).await.unwrap();
    // On a busy machine the client may have given its connection up by itself: then nothing was frozen, and it is tried again.
    for _ in 0..20 {
        proxy.freeze_open_ones();
        let begun = Instant::now();
        assert!(store.exists(&key(1)).await.unwrap());
        if begun.elapsed() >= REQUEST {
            clear(&store).await;
            return;
        }
    }
    panic!("no connection was ever frozen: this tests nothing");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_user_without_permission_is_told_before_any_work() {
    let url = stores::hdfs_url();
    let owner = Store::open(&url).unwrap();
    owner.put_new(&key(1), Bytes::from("x")).await.unwrap();
    // The user comes from the environment, which a running process keeps: a child has another.
    let child = tokio::task::spawn_blocking(move || {
        std::process::Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "name_node::the_stranger", "--nocapture"])
            .env("HADOOP_USER_NAME", "stranger")
            .env(STRANGER, format!("{url}/objects"))
            .output()
            .unwrap()
    });
    let said = String::from_utf8(child.await.unwrap().stdout).unwrap();
    assert!(said.contains("no permission to write"), "{said}");
    assert!(said.contains("retryable: false"), "{said}");
    clear(&owner).await;
}

/// Names the store that [`the_stranger`] probes; it is a test of its own only in a child process.
const STRANGER: &str = "FLUXGLOBE_TEST_STRANGER";

#[tokio::test(flavor = "multi_thread")]
async fn the_stranger() {
    let Some(url) = std::env::var_os(STRANGER).and_then(|url| url.into_string().ok()) else {
        return;
    };
    let error = Store::open(&url)
        .unwrap()
        .check_writable()
        .await
        .unwrap_err();
    println!("{error}; retryable: {}", error.is_retryable());
}
