use super::*;
use crate::store::RetryLimits;
use std::time::Duration;

fn key() -> ObjectKey {
    "cubes/p/repo".parse().unwrap()
}

/// A store of each kind that exchanges in a way of its own; the folder lives as long as the answer.
fn stores() -> (tempfile::TempDir, [(&'static str, Store); 3]) {
    let folder = tempfile::tempdir().unwrap();
    let numbered = Store {
        place: Place::Hdfs,
        ..Store::memory()
    };
    let stores = [
        ("memory", Store::memory()),
        (
            "folder",
            Store::open(folder.path().to_str().unwrap()).unwrap(),
        ),
        ("numbered", numbered),
    ];
    (folder, stores)
}

#[tokio::test]
async fn what_was_seen_is_replaced_and_what_came_after_is_not() {
    for (kind, store) in stores().1 {
        assert_eq!(store.read_changing(&key()).await.unwrap(), None, "{kind}");
        let swap = |seen: Option<Seen>, content: &'static str| {
            let store = store.clone();
            async move {
                store
                    .swap(&key(), seen.as_ref(), Bytes::from(content))
                    .await
                    .unwrap()
            }
        };
        let first = swap(None, "one").await;
        assert!(first.is_some(), "{kind}");
        assert_eq!(swap(None, "other").await, None, "{kind}: created twice");
        let second = swap(first.clone(), "two").await;
        assert!(second.is_some(), "{kind}");
        assert_eq!(swap(first, "late").await, None, "{kind}: an older state");
        let (content, seen) = store.read_changing(&key()).await.unwrap().unwrap();
        assert_eq!(
            (content.as_ref(), Some(seen)),
            (&b"two"[..], second),
            "{kind}"
        );
    }
}

#[test]
fn an_exchange_lists_on_a_hadoop_file_system_alone() {
    for (kind, store) in stores().1 {
        assert_eq!(store.exchanges_at_once(), kind != "numbered", "{kind}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_increment_of_four_writers_is_lost() {
    const WRITERS: u32 = 4;
    const EACH: u32 = 10;
    let (_folder, stores) = stores();
    for (kind, store) in stores {
        store.swap(&key(), None, Bytes::from("0 x")).await.unwrap();
        let writers: Vec<_> = (0..WRITERS)
            .map(|writer| tokio::spawn(increment(store.clone(), writer, EACH)))
            .collect();
        for writer in writers {
            writer.await.unwrap();
        }
        let (content, _) = store.read_changing(&key()).await.unwrap().unwrap();
        assert_eq!(count(&content), WRITERS * EACH, "{kind}");
    }
}

async fn increment(store: Store, writer: u32, times: u32) {
    for time in 0..times {
        loop {
            let (content, seen) = store.read_changing(&key()).await.unwrap().unwrap();
            // Contents of two writers differ, as those of two commits do.
            let next = format!("{} {writer}-{time}", count(&content) + 1);
            let swapped = store.swap(&key(), Some(&seen), next.into()).await.unwrap();
            if swapped.is_some() {
                break;
            }
        }
    }
}

fn count(content: &[u8]) -> u32 {
    let text = std::str::from_utf8(content).unwrap();
    text.split_once(' ').unwrap().0.parse().unwrap()
}

/// A process that ends with its test.
struct Killed(std::process::Child);

impl Drop for Killed {
    fn drop(&mut self) {
        self.0.kill().ok();
        self.0.wait().ok();
    }
}

/// The lock is the system's: another process holds it, is killed, and nothing has to be cleaned up.
#[tokio::test]
async fn a_folder_is_locked_between_processes_and_free_after_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Store::open(folder.path().to_str().unwrap()).unwrap();
    store.retry_limits = RetryLimits {
        retries: Duration::from_millis(50),
        ..RetryLimits::default()
    };
    store.swap(&key(), None, Bytes::from("one")).await.unwrap();
    let other = std::process::Command::new("flock")
        .arg("--no-fork")
        .arg(folder.path().join("cubes/p"))
        .args(["sh", "-c", "echo locked; exec sleep 600"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut other = Killed(other);
    let mut said = [0; 7];
    std::io::Read::read_exact(other.0.stdout.as_mut().unwrap(), &mut said).unwrap();
    let (_, seen) = store.read_changing(&key()).await.unwrap().unwrap();
    let refused = store.swap(&key(), Some(&seen), Bytes::from("two")).await;
    let error = refused.unwrap_err();
    assert!(error.is_retryable(), "{error}");
    assert!(error.to_string().contains("another process"), "{error}");
    drop(other);
    let swapped = store.swap(&key(), Some(&seen), Bytes::from("two")).await;
    assert!(swapped.unwrap().is_some());
}

/// A writer that slept while its number was removed creates it a second time: it must not believe that it won.
#[tokio::test]
async fn a_number_that_was_removed_is_not_won_a_second_time() {
    let store = Store {
        place: Place::Hdfs,
        ..Store::memory()
    };
    let mut seen = vec![];
    for number in 1..=20 {
        let content = Bytes::from(format!("{number}"));
        let swapped = store.swap(&key(), seen.last(), content).await.unwrap();
        seen.push(swapped.unwrap());
    }
    for number in 1..=3 {
        let old = format!("cubes/p/repo.numbers/{number:020}")
            .parse()
            .unwrap();
        store.remove(&old).await.unwrap();
    }
    for asleep in [None, Some(&seen[0]), Some(&seen[1]), Some(&seen[2])] {
        let late = store.swap(&key(), asleep, Bytes::from("late")).await;
        assert_eq!(late.unwrap(), None, "{asleep:?}");
    }
    let (content, _) = store.read_changing(&key()).await.unwrap().unwrap();
    assert_eq!(content, "20");
}
