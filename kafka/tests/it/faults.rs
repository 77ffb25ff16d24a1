//! Kafka goes away and comes back: calls end in time, nothing is lost, nothing piles up.

use std::time::Duration;

use storage::log::EventLog as _;
use tokio::time::Instant;

use crate::broker::Broker;
use crate::events::{
    FROM, MOMENT, assert_one_each, finished_with_one, notice, notices, read, work_off,
};
use crate::own_topics::open_on;

/// No call may take longer, whatever Kafka does.
const LONGEST_CALL: Duration = Duration::from_secs(20);
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
    let start = Instant::now();
    let mut errors = vec![];
    let mut call = |what: &str, began: Instant, error: Option<storage::StorageError>| {
        let error = error.unwrap_or_else(|| panic!("{what} succeeded without a broker"));
        assert!(error.is_retryable(), "{what}: {error}");
        assert!(
            began.elapsed() < LONGEST_CALL,
            "{what}: {:?}",
            began.elapsed()
        );
        errors.push(format!(
            "{what} {:.1} s: {error}",
            began.elapsed().as_secs_f64()
        ));
    };
    let began = Instant::now();
    call("ready", began, log.ready().await.err());
    assert!(began.elapsed() < Duration::from_secs(3));
    let began = Instant::now();
    call("next", began, reader.next(5, MOMENT).await.err());
    drop(reader);
    let began = Instant::now();
    call("join", began, log.join(FROM, "g").await.err());
    let began = Instant::now();
    call(
        "append all",
        began,
        log.append(&notices("no", 3)).await.err(),
    );
    let began = Instant::now();
    call("lag", began, log.lag(FROM, "g").await.err());
    let began = Instant::now();
    call("message", began, log.message(held[0].origin).await.err());
    let began = Instant::now();
    let follow = log.follow(FROM, storage::log::Start::Oldest).await;
    call("follow", began, follow.err());

    // Callers that do not give up: as fast as they can, each with an event of 100 kB.
    let before_bytes = resident_bytes();
    let big = notice(&"x".repeat(100_000));
    let until = Instant::now() + Duration::from_secs(30);
    let hammer = async || {
        let mut count = 0;
        while Instant::now() < until {
            let one = std::slice::from_ref(&big);
            let given_up = tokio::time::timeout(Duration::from_millis(20), log.append(one)).await;
            assert!(!matches!(given_up, Ok(Ok(()))));
            count += 1;
            tokio::task::yield_now().await;
        }
        count
    };
    let (a, b, c, d) = tokio::join!(hammer(), hammer(), hammer(), hammer());
    let grown_bytes = resident_bytes().saturating_sub(before_bytes);
    println!(
        "down for {:.0} s; {} appends given up; grown by {} KiB",
        start.elapsed().as_secs_f64(),
        a + b + c + d,
        grown_bytes >> 10
    );
    println!("{}", errors.join("\n"));
    assert!(grown_bytes < GROWTH_BYTES, "{grown_bytes}");

    broker.start_again();
    let back = Instant::now();
    while let Err(error) = log.ready().await {
        assert!(back.elapsed() < Duration::from_secs(20), "{error}");
        tokio::time::sleep(MOMENT).await;
    }
    println!(
        "ready {:.1} s after the broker",
        back.elapsed().as_secs_f64()
    );
    log.append(&[notice("after")]).await.unwrap();
    println!(
        "appended {:.1} s after the broker",
        back.elapsed().as_secs_f64()
    );
    finish_all(log).await;
    println!(
        "worked off {:.1} s after the broker",
        back.elapsed().as_secs_f64()
    );
}

/// Whatever came through of what was given up was seen or not; what was acknowledged is there once each.
async fn finish_all(log: &kafka_log::KafkaLog) {
    work_off(log, "g").await;
    let count = storage::log::contents(log, FROM).await.unwrap().len();
    assert!(count >= 21, "{count}");
    assert_one_each(log, count).await;
}
