//! A writer that is killed in the middle leaves the whole object or none, and is in nobody's way.

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use bytes::Bytes;
use contract::key::ObjectKey;
use storage::Store;

use crate::stores::{self, Opened};
use crate::suite::noise;

/// Names the store that [`the_writer`] writes to; it is a test of its own only in a child process.
const WRITE_TO: &str = "FLUXGLOBE_TEST_WRITE_TO";
const OBJECT_BYTES: usize = 48 << 20;
const ROUNDS: u64 = 6;

fn key(round: u64) -> ObjectKey {
    format!("killed/{round}").parse().unwrap()
}

/// What a child process does: it writes one object, after saying so.
#[tokio::test(flavor = "multi_thread")]
async fn the_writer() {
    let Some(text) = std::env::var_os(WRITE_TO).and_then(|text| text.into_string().ok()) else {
        return;
    };
    let (round, location) = text.split_once(' ').unwrap();
    let round = round.parse().unwrap();
    let (store, content) = (Store::open(location).unwrap(), noise(OBJECT_BYTES, round));
    println!("writing");
    store.put_new(&key(round), content).await.unwrap();
    println!("written");
}

/// Starts a writer and kills it so long after it began; true if it had ended before.
fn kill_writer(location: &str, round: u64, after: Duration) -> bool {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "killed::the_writer", "--nocapture"])
        .env(WRITE_TO, format!("{round} {location}"))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(
        lines.any(|line| line.unwrap().ends_with("writing")),
        "the writer did not begin"
    );
    std::thread::sleep(after);
    child.kill().unwrap();
    child.wait().unwrap();
    lines.any(|line| line.is_ok_and(|line| line.ends_with("written")))
}

async fn writers_are_killed(opened: Opened) {
    let store = &opened.store;
    let whole = write_time(store).await;
    let mut half_way = 0;
    for round in 0..ROUNDS {
        // From the first bytes to about the end.
        let after = whole.mul_f64((round as f64 + 0.5) / ROUNDS as f64);
        let location = store.url().to_owned();
        let ended = tokio::task::spawn_blocking(move || kill_writer(&location, round, after))
            .await
            .unwrap();
        half_way += u32::from(!ended);
        let content = noise(OBJECT_BYTES, round);
        let is_there = store.exists(&key(round)).await.unwrap();
        if is_there {
            assert!(
                store.get(&key(round)).await.unwrap() == content,
                "half an object"
            );
        }
        let mut whole_ones: Vec<_> = (0..round).map(key).collect();
        whole_ones.extend(is_there.then(|| key(round)));
        whole_ones.push(key(99));
        assert_eq!(store.list("killed").await.unwrap(), whole_ones);
        // The next writer is not held up by what is left.
        let begun = Instant::now();
        store.put_new(&key(round), content.clone()).await.unwrap();
        assert!(
            begun.elapsed() < whole * 4 + Duration::from_secs(30),
            "{:?}",
            begun.elapsed()
        );
        assert!(store.get(&key(round)).await.unwrap() == content);
    }
    println!("{half_way} of {ROUNDS} writers were killed before their end ({whole:?} undisturbed)");
    assert!(
        half_way > 0,
        "no writer was killed half way: this tests nothing"
    );
    opened.clear().await;
}

/// How long a whole write takes here and now.
async fn write_time(store: &Store) -> Duration {
    let content: Bytes = noise(OBJECT_BYTES, 99);
    let begun = Instant::now();
    store.put_new(&key(99), content).await.unwrap();
    begun.elapsed()
}

#[tokio::test(flavor = "multi_thread")]
async fn writers_to_a_folder_are_killed() {
    writers_are_killed(stores::folder()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn writers_to_s3_are_killed() {
    writers_are_killed(stores::s3()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn writers_to_hdfs_are_killed() {
    writers_are_killed(stores::hdfs()).await;
}
