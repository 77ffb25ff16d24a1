//! How fast the log is: figures printed, and bounds that only something badly wrong can miss.

use std::time::Duration;

use storage::log::{EventLog as _, Start, contents};
use tokio::time::Instant;

use crate::events::{FROM, TO, finished_with_one, notice, notices, read};
use crate::own_topics::{end, open};

const APPENDS: usize = 200;
const MESSAGES: usize = 4096;
const BATCH: usize = 64;

fn percentile_ms(sorted: &[Duration], percent: usize) -> f64 {
    sorted[(sorted.len() - 1) * percent / 100].as_secs_f64() * 1e3
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn appends_take_milliseconds_and_a_reader_finishes_hundreds_a_second() {
    let own = open().await;
    let log = &own.log;
    let mut follower = log.follow(FROM, Start::Now).await.unwrap();
    let (mut appended, mut seen) = (vec![], vec![]);
    for n in 0..APPENDS {
        let start = Instant::now();
        log.append(&[notice(&n.to_string())]).await.unwrap();
        appended.push(start.elapsed());
        let messages = follower.next(1, Duration::from_secs(5)).await.unwrap();
        assert_eq!(messages.len(), 1);
        seen.push(start.elapsed());
    }
    appended.sort();
    seen.sort();
    for (what, took) in [("append", &appended), ("append to follower", &seen)] {
        println!(
            "{what}: p50 {:.1} ms, p95 {:.1} ms",
            percentile_ms(took, 50),
            percentile_ms(took, 95)
        );
    }
    let start = Instant::now();
    log.append(&notices("many", MESSAGES)).await.unwrap();
    println!(
        "append of {MESSAGES} together: {:.0} events/s",
        MESSAGES as f64 / start.elapsed().as_secs_f64()
    );

    let total = APPENDS + MESSAGES;
    let mut reader = log.join(FROM, "g").await.unwrap();
    let mut done = read(&mut *reader, 1).await;
    let start = Instant::now();
    let mut finishes = 0;
    let mut finished = 0;
    while finished < total {
        reader
            .finish(done.iter().map(finished_with_one).collect())
            .await
            .unwrap();
        finished += done.len();
        finishes += 1;
        done = read(&mut *reader, BATCH.min(total - finished)).await;
    }
    let took = start.elapsed();
    let rate = total as f64 / took.as_secs_f64();
    println!(
        "read and finished with a follow-up each, {BATCH} at a time: {rate:.0} messages/s, {:.1} ms a finish",
        took.as_secs_f64() * 1e3 / f64::from(finishes)
    );
    assert_eq!(contents(log, TO).await.unwrap().len(), total);
    assert!(percentile_ms(&appended, 50) < 250.0);
    assert!(rate > 200.0);
    end(own).await;
}
