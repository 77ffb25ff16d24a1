//! Readers killed at any moment: what follows from each message is there once.

use std::io::{BufRead as _, BufReader};
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use kafka_log::KafkaLog;
use storage::log::EventLog as _;

use crate::events::{FROM, MOMENT, assert_one_each, finished_by, lag, notices, work_off};
use crate::own_topics::{end, open, own_settings, servers};

/// Says to this program, started again, that it is a reader to be killed: `PREFIX,GROUP`.
const READER: &str = "FLUXGLOBE_TEST_READER";
const SEED: &str = "FLUXGLOBE_TEST_SEED";
/// What a reader prints when it has got a batch, before it finishes it.
const AT_WORK: &str = "at work";
const SIGKILL: i32 = 9;
const MESSAGES: usize = 1500;
/// Messages that a reader takes at once.
const BATCH: usize = 8;
/// Groups that are read at the same time: each waits some seconds until a killed member is missed.
const GROUPS: u32 = 6;
const KILLS_PER_GROUP: usize = 4;
/// A reader that is not killed by then waits for it: something is left to do, however fast a machine is.
const LONGEST_LIFE_BATCHES: usize = 40;
const _: () = assert!(KILLS_PER_GROUP * LONGEST_LIFE_BATCHES * BATCH < MESSAGES);
/// A reader is killed at most so long after it got a batch, microseconds: while it finishes it, or later.
const LONGEST_DELAY_US: u64 = 10_000;

/// Numbers that look random and follow from a seed (xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }
}

pub(crate) fn variable(name: &str) -> Option<String> {
    std::env::var_os(name)?.into_string().ok()
}

fn seed() -> u64 {
    let clock = || {
        SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap()
            .as_millis() as u64
    };
    variable(SEED).map_or_else(clock, |seed| seed.parse().unwrap())
}

fn group_name(number: u32) -> String {
    format!("g{number}")
}

#[test]
fn what_follows_is_there_once_however_often_a_reader_is_killed() {
    let mut runtime = tokio::runtime::Builder::new_multi_thread();
    let runtime = runtime.worker_threads(2).enable_all().build().unwrap();
    if let Some(reader) = variable(READER) {
        runtime.block_on(be_a_reader(&reader));
        return;
    }
    let seed = seed();
    println!("{SEED}={seed}");
    let own = runtime.block_on(open());
    runtime
        .block_on(own.log.append(&notices("a", MESSAGES)))
        .unwrap();
    std::thread::scope(|scope| {
        for number in 0..GROUPS {
            let prefix = &own.settings.kafka_topic_prefix;
            scope.spawn(move || {
                let mut random = Random(seed.wrapping_add(u64::from(number)).max(1));
                let mut waits = vec![];
                for _ in 0..KILLS_PER_GROUP {
                    let batches = 1 + random.below(LONGEST_LIFE_BATCHES as u64) as usize;
                    let delay = Duration::from_micros(random.below(LONGEST_DELAY_US));
                    waits.push(live_and_die(prefix, &group_name(number), batches, delay));
                }
                println!("group {number}: readers at work after {waits:.1?}");
            });
        }
    });
    runtime.block_on(async {
        for group in (0..GROUPS).map(group_name) {
            let left = lag(&own.log, &group).await;
            println!("{group}: at most {left} of {MESSAGES} left after {KILLS_PER_GROUP} kills");
            assert!(left > 0, "readers did more than they may");
            work_off(&own.log, &group).await;
        }
        assert_one_each(&own.log, MESSAGES * GROUPS as usize).await;
        end(own).await;
    });
}

/// Starts a reader in a process of its own and kills it `delay` after it got its batch number `batches`. Says how long it
/// was until it worked: its predecessor's death must be noticed first.
fn live_and_die(prefix: &str, group: &str, batches: usize, delay: Duration) -> Duration {
    let start = Instant::now();
    let mut reader = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "--nocapture"])
        .arg("kills::what_follows_is_there_once_however_often_a_reader_is_killed")
        .env(READER, format!("{prefix},{group}"))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(reader.stdout.take().unwrap()).lines();
    let lines = lines.map_while(Result::ok);
    let mut got = lines.filter(|line| line.contains(AT_WORK));
    assert!(got.next().is_some(), "the reader ended before it worked");
    let until_at_work = start.elapsed();
    if batches > 1 {
        let last = got.nth(batches - 2);
        assert!(last.is_some(), "the reader ended before it was killed");
    }
    std::thread::sleep(delay);
    // SIGKILL: it says good-bye to nobody. One that ended by itself before proves nothing.
    reader.kill().unwrap();
    let status = reader.wait().unwrap();
    assert_eq!(status.signal(), Some(SIGKILL));
    // Until now, or printing to nobody would have ended it.
    drop(got);
    until_at_work
}

/// Reads and finishes out of order until it is killed, `LONGEST_LIFE_BATCHES` batches at most.
async fn be_a_reader(prefix_and_group: &str) {
    let (prefix, group) = prefix_and_group.split_once(',').unwrap();
    let mut settings = own_settings(&servers());
    settings.kafka_topic_prefix = prefix.to_owned();
    settings.kafka_instance = Some(format!("reader-{group}"));
    let log = KafkaLog::connect(&settings).await.unwrap();
    let mut reader = log.join(FROM, group).await.unwrap();
    let mut batches = 0;
    while batches < LONGEST_LIFE_BATCHES {
        let messages = reader.next(BATCH, MOMENT).await.unwrap();
        if messages.is_empty() {
            continue;
        }
        batches += 1;
        println!("{AT_WORK}");
        let (even, odd): (Vec<_>, Vec<_>) = messages.iter().partition(|m| m.origin.offset % 2 == 0);
        for part in [odd, even] {
            let done = part.into_iter().map(|m| finished_by(group, m)).collect();
            reader.finish(done).await.unwrap();
        }
    }
    std::future::pending::<()>().await;
}
