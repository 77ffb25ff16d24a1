//! Kafka goes away and comes back: calls end in time, nothing is lost, nothing piles up.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, Command, Stdio};
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
use crate::kills::variable;
use crate::own_topics::open_on;

/// No call may take longer, whatever Kafka does.
const LONGEST_CALL: Duration = Duration::from_secs(20);
/// How long appends fail for.
const DOWN: Duration = Duration::from_secs(30);
/// Says to this program, started again, that it appends without end, and to which servers.
const APPENDER: &str = "FLUXGLOBE_TEST_APPENDER";
/// What an appender prints when it has appended once.
const APPENDED: &str = "appended";
/// An event of it, bytes of text.
const EVENT_BYTES: usize = 100_000;
/// What its process may grow by while appends fail, bytes: the client's queues of 32 MB, and the noise of an allocator.
/// Even a slow machine gives up thousands of appends, some of them each five milliseconds: what kept them would grow more.
const GROWTH_BYTES: u64 = 160 << 20;

/// Memory of this process, bytes.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let kib = line.unwrap().split_whitespace().nth(1).unwrap();
    kib.parse::<u64>().unwrap() << 10
}

#[test]
fn while_no_broker_answers_calls_fail_in_time_and_afterwards_work_goes_on() {
    let mut runtime = tokio::runtime::Builder::new_multi_thread();
    let runtime = runtime.worker_threads(2).enable_all().build().unwrap();
    match variable(APPENDER) {
        Some(servers) => runtime.block_on(be_an_appender(&servers)),
        None => runtime.block_on(while_no_broker_answers()),
    }
}

async fn while_no_broker_answers() {
    let broker = Broker::start();
    let own = open_on(&broker.servers()).await;
    let log = &own.log;
    log.append(&notices("before", 20)).await.unwrap();
    let mut reader = log.join(FROM, "g").await.unwrap();
    let held = read(&mut *reader, 20).await;
    let done = held[..10].iter().map(finished_with_one).collect();
    reader.finish(done).await.unwrap();
    log.ready().await.unwrap();
    let appender = Appender::start(&broker);

    broker.kill();
    fail_in_time(log, reader, held[0].origin).await;
    appender.append_without_end();
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

/// A process of its own, so that what it grows by is nobody else's.
struct Appender(Child, std::io::Lines<BufReader<std::process::ChildStdout>>);

impl Appender {
    /// Connects and appends once, to topics of its own.
    fn start(broker: &Broker) -> Self {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "--nocapture"])
            .arg("faults::while_no_broker_answers_calls_fail_in_time_and_afterwards_work_goes_on")
            .env(APPENDER, broker.servers())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut said = lines.by_ref().map_while(Result::ok);
        assert!(said.any(|line| line.contains(APPENDED)), "no append");
        Self(child, lines)
    }

    /// Has it append until it has tried for long, and says what it says of itself.
    fn append_without_end(mut self) {
        writeln!(self.0.stdin.take().unwrap(), "go").unwrap();
        for line in self.1.map_while(Result::ok) {
            println!("appender: {line}");
        }
        assert!(self.0.wait().unwrap().success(), "the appender failed");
    }
}

async fn be_an_appender(servers: &str) {
    let log = open_on(servers).await.log;
    log.append(&[notice("before the fault")]).await.unwrap();
    println!("{APPENDED}");
    // Nothing to read: the test has ended.
    if std::io::stdin().read_line(&mut String::new()).unwrap() > 0 {
        append_without_end(&log).await;
    }
}

/// Callers that do not give up: as fast as they can.
async fn append_without_end(log: &KafkaLog) {
    let before_bytes = resident_bytes();
    let big = notice(&"x".repeat(EVENT_BYTES));
    let until = Instant::now() + DOWN;
    let hammer = async || {
        let mut count = 0_u64;
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
    let given_up = a + b + c + d;
    println!(
        "{given_up} appends given up in {} s without a broker: grown by {} KiB",
        DOWN.as_secs(),
        grown_bytes >> 10
    );
    let kept_bytes = given_up * EVENT_BYTES as u64;
    assert!(kept_bytes > 2 * GROWTH_BYTES, "too few to tell: {given_up}");
    assert!(grown_bytes < GROWTH_BYTES, "{grown_bytes}");
}
