//! Kafka goes away and comes back: calls end in time, nothing is lost, nothing piles up.

use std::time::Duration;

use contract::topic::Origin;
use kafka_log::KafkaLog;
use storage::StorageError;
use storage::log::{EventLog as _, Reader, Start, contents};
use tokio::time::Instant;

use crate::broker::Broker;
use crate::events::{
    FROM, MOMENT, assert_one_each, finished_with_one, notice, notices, read, work_off,
};
use crate::own_topics::open_on;

/// No call may take longer, whatever Kafka does.
const LONGEST_CALL: Duration = Duration::from_secs(20);
/// How long appends fail for.
const DOWN: Duration = Duration::from_secs(30);
/// What this process may grow by while appends fail, bytes: the client's queues, and the noise of an allocator.
const GROWTH_BYTES: u64 = 64 << 20;

/// Memory of this process, bytes.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let kib = line.unwrap().split_whitespace().nth(1).unwrap();
    kib.parse::<u64>().unwrap() << 10
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn while_no_broker_answers_calls_fail_in_time_and_afterwards_work_goes_on() {
    let broker = Broker::start();
    let own = open_on(&broker.servers()).await;
    let log = &own.log;
    log.append(&notices("before", 20)).await.unwrap();
    let mut reader = log.join(FROM, "g").await.unwrap();
    let held = read(&mut *reader, 20).await;
    let done = held[..10].iter().map(finished_with_one).collect();
    reader.finish(done).await.unwrap();
    log.ready().await.unwrap();

    broker.kill();
    fail_in_time(log, reader, held[0].origin).await;
    append_without_end(log).await;
    broker.start_again();

    let back = Instant::now();
    let say = |what: &str| {
        println!(
            "{what} {:.1} s after the broker",
            back.elapsed().as_secs_f64()
        );
    };
    while let Err(error) = log.ready().await {
        assert!(back.elapsed() < LONGEST_CALL, "{error}");
        tokio::time::sleep(MOMENT).await;
    }
    say("ready");
    log.append(&[notice("after")]).await.unwrap();
    say("appended");
    work_off(log, "g").await;
    say("worked off");
    // Whatever came through of what was given up was seen or not; what was acknowledged is there.
    let count = contents(log, FROM).await.unwrap().len();
    assert!(count >= 21, "{count}");
    assert_one_each(log, count).await;
}

async fn fail_in_time(log: &KafkaLog, mut reader: Box<dyn Reader>, origin: Origin) {
    fn check(what: &str, began: Instant, error: Option<StorageError>) {
        let took = began.elapsed();
        let error = error.unwrap_or_else(|| panic!("{what} succeeded without a broker"));
        println!("{what}: {:.1} s: {error}", took.as_secs_f64());
        assert!(error.is_retryable() && took < LONGEST_CALL, "{what}");
    }
    let began = Instant::now();
    check("ready", began, log.ready().await.err());
    assert!(began.elapsed() < Duration::from_secs(3));
    let began = Instant::now();
    check("next", began, reader.next(5, MOMENT).await.err());
    drop(reader);
    let began = Instant::now();
    check("join", began, log.join(FROM, "g").await.err());
    let began = Instant::now();
    check(
        "append all",
        began,
        log.append(&notices("no", 3)).await.err(),
    );
    let began = Instant::now();
    check(
        "append one",
        began,
        log.append(&notices("no", 1)).await.err(),
    );
    let began = Instant::now();
    check("lag", began, log.lag(FROM, "g").await.err());
    let began = Instant::now();
    check("message", began, log.message(origin).await.err());
    let began = Instant::now();
    let follower = log.follow(FROM, Start::Oldest).await;
    check("follow", began, follower.err());
}

/// Callers that do not give up: as fast as they can, each with an event of 100 kB.
async fn append_without_end(log: &KafkaLog) {
    let before_bytes = resident_bytes();
    let big = notice(&"x".repeat(100_000));
    let until = Instant::now() + DOWN;
    let hammer = async || {
        let mut count = 0;
        while Instant::now() < until {
            let append = log.append(std::slice::from_ref(&big));
            let given_up = tokio::time::timeout(Duration::from_millis(20), append).await;
            assert!(!matches!(given_up, Ok(Ok(()))));
            count += 1;
            tokio::task::yield_now().await;
        }
        count
    };
    let (a, b, c, d) = tokio::join!(hammer(), hammer(), hammer(), hammer());
    let grown_bytes = resident_bytes().saturating_sub(before_bytes);
    println!(
        "{} appends given up in {} s without a broker: grown by {} KiB",
        a + b + c + d,
        DOWN.as_secs(),
        grown_bytes >> 10
    );
    assert!(grown_bytes < GROWTH_BYTES, "{grown_bytes}");
}
