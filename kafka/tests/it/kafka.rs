//! The suite on Kafka, and what Kafka alone must do.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bytes::Bytes;
use contract::event::MAX_EVENT_BYTES;
use rdkafka::ClientConfig;
use rdkafka::producer::{FutureProducer, FutureRecord, Producer as _};
use storage::StorageError;
use storage::log::{EventLog as _, Start, contents};
use tokio::time::Instant;

use crate::events::{
    FROM, MOMENT, WAIT_LIMIT, assert_one_each, finished, finished_with_one, notice, notice_of,
    notices, paths, read, work_off,
};
use crate::own_topics::{OwnTopics, end, open, open_with, own_settings, servers};
use crate::suite::run_suite;

run_suite!(open, end);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn events_appended_together_are_all_there_or_none() {
    let own = open().await;
    let mut events = notices("a", 30);
    events.push(notice(&"x".repeat(MAX_EVENT_BYTES)));
    let refused = own.log.append(&events).await.unwrap_err();
    assert!(!refused.is_retryable(), "{refused}");
    assert!(contents(&own.log, FROM).await.unwrap().is_empty());
    events.pop();
    own.log.append(&events).await.unwrap();
    own.log.append(&[]).await.unwrap();
    assert_eq!(contents(&own.log, FROM).await.unwrap().len(), 30);
    end(own).await;
}

fn foreign_producer(own: &OwnTopics, transactional_id: &str) -> FutureProducer {
    let servers = own.settings.kafka.as_deref().unwrap();
    let mut config = ClientConfig::new();
    config.set("bootstrap.servers", servers);
    config.set("transactional.id", transactional_id);
    config.create().unwrap()
}

fn topic(own: &OwnTopics) -> String {
    format!("{}{FROM}", own.settings.kafka_topic_prefix)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn bytes_that_are_no_text_are_delivered_as_they_are() {
    let own = open().await;
    let bytes = Bytes::from_static(b"\xff\xfe\x00");
    own.log
        .append_message(FROM, "k", bytes.clone())
        .await
        .unwrap();
    let mut reader = own.log.join(FROM, "g").await.unwrap();
    let messages = read(&mut *reader, 1).await;
    assert_eq!(messages[0].content, bytes);
    assert!(messages[0].event().is_err());
    end(own).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_was_never_committed_is_not_seen_and_counts_nowhere() {
    const LIMIT: Duration = Duration::from_secs(10);
    let own = open().await;
    let topic = topic(&own);
    let id = format!("{}foreign", own.settings.kafka_topic_prefix);
    let producer = foreign_producer(&own, &id);
    let send = async |content: &str| {
        let record = FutureRecord::to(&topic).key("k").payload(content);
        producer.send(record, LIMIT).await.unwrap()
    };
    producer.init_transactions(LIMIT).unwrap();
    producer.begin_transaction().unwrap();
    let place = send(&notice("never").to_json()).await;
    producer.abort_transaction(LIMIT).unwrap();
    own.log.append(&[notice("seen")]).await.unwrap();

    assert_eq!(paths(&contents(&own.log, FROM).await.unwrap()), ["seen"]);
    assert_eq!(own.log.lag(FROM, "g").await.unwrap(), 1);
    let origin = contract::topic::Origin {
        topic: FROM,
        partition: place.partition as u32,
        offset: place.offset as u64,
    };
    let found = own.log.message(origin).await.unwrap();
    assert_eq!(found, None, "{found:?}");
    // One that is still open holds back only what comes after it, and a new follower sees it once it is committed.
    producer.begin_transaction().unwrap();
    send(&notice("late").to_json()).await;
    let mut follower = own.log.follow(FROM, Start::Now).await.unwrap();
    assert!(follower.next(10, MOMENT).await.unwrap().is_empty());
    producer.commit_transaction(LIMIT).unwrap();
    assert_eq!(paths(&follower.next(10, LIMIT).await.unwrap()), ["late"]);
    // Whoever wants all waits for those that are open, so that nothing behind them is missed.
    producer.begin_transaction().unwrap();
    send(&notice("last").to_json()).await;
    let committed = async {
        tokio::time::sleep(MOMENT).await;
        tokio::task::spawn_blocking(move || producer.commit_transaction(LIMIT).unwrap())
            .await
            .unwrap();
    };
    let (all, ()) = tokio::join!(contents(&own.log, FROM), committed);
    assert_eq!(all.unwrap().len(), 3);
    end(own).await;
}

/// A process that is killed within a transaction and never comes back holds up what follows until Kafka ends it for it. The
/// broker of `deploy/services` looks for such every second, where Kafka's default is every ten.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_transaction_left_open_for_good_holds_readers_up_for_little_more_than_its_limit() {
    const LIMIT: Duration = Duration::from_secs(2);
    const LOOKED_FOR: Duration = Duration::from_secs(4);
    let own = open().await;
    let id = format!("{}killed", own.settings.kafka_topic_prefix);
    let mut config = ClientConfig::new();
    config.set("bootstrap.servers", own.settings.kafka.as_deref().unwrap());
    config.set("transactional.id", id);
    // The partition that our own keys go to.
    config.set("partitioner", "murmur2_random");
    config.set("transaction.timeout.ms", LIMIT.as_millis().to_string());
    let producer: FutureProducer = config.create().unwrap();
    producer.init_transactions(MOMENT * 50).unwrap();
    // Kafka counts from the first record on, which comes later, however busy the machine.
    let begun = Instant::now();
    producer.begin_transaction().unwrap();
    let topic = topic(&own);
    let never = notice("never").to_json();
    let record = FutureRecord::to(&topic).key("p").payload(&never);
    producer.send(record, MOMENT * 50).await.unwrap();
    own.log
        .append(&[notice_of("seen", Some("p"))])
        .await
        .unwrap();
    let mut reader = own.log.join(FROM, "g").await.unwrap();
    assert_eq!(paths(&read(&mut *reader, 1).await), ["seen"]);
    let took = begun.elapsed();
    println!(
        "read {:.1} s after the transaction was left open",
        took.as_secs_f64()
    );
    assert!(took > LIMIT / 2, "nothing was held up: {took:?}");
    assert!(took < LIMIT + 4 * LOOKED_FOR, "{took:?}");
    end(own).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn three_members_that_come_and_go_finish_each_message_once() {
    let own = open().await;
    own.log.append(&notices("a", 600)).await.unwrap();
    let restless = async |lives: usize| {
        for _ in 0..lives {
            let mut reader = own.log.join(FROM, "g").await.unwrap();
            for _ in 0..5 {
                let messages = reader.next(8, MOMENT).await.unwrap();
                // Half of what is held is never finished.
                let half = messages.iter().step_by(2).map(finished_with_one).collect();
                if reader.finish(half).await.is_err() {
                    break;
                }
            }
        }
    };
    tokio::join!(restless(4), restless(4), restless(4));
    work_off(&own.log, "g").await;
    assert_one_each(&own.log, 600).await;
    end(own).await;
}

/// Partitions change hands while offsets are on their way: what is refused then must be finished by its new owner only.
///
/// A reader whose call failed joins again, as every service does: on a machine that is busy with other things a broker may
/// take longer than any limit, and that is not what this is about.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn members_at_work_while_others_come_and_go_finish_each_message_once() {
    const COUNT: usize = 6000;
    let mut settings = own_settings(&servers());
    settings.kafka_partitions = 6;
    let own = open_with(settings).await;
    // A few at a time: a broker beside a compiler does not take them all within the limit of one transaction.
    for some in notices("a", COUNT).chunks(200) {
        own.log.append(some).await.unwrap();
    }
    let is_over = AtomicBool::new(false);
    let lasting = async || {
        let mut finishes = 0;
        let mut life = async || {
            let mut reader = own.log.join(FROM, "g").await?;
            while !is_over.load(Ordering::Relaxed) {
                let messages = reader.next(1, MOMENT).await?;
                let done = messages.iter().map(finished_with_one).collect();
                reader.finish(done).await?;
                finishes += usize::from(!messages.is_empty());
            }
            reader.leave().await
        };
        while !is_over.load(Ordering::Relaxed) {
            passes(life().await);
        }
        finishes
    };
    let restless = async || {
        for _ in 0..6 {
            let life = async {
                let mut reader = own.log.join(FROM, "g").await?;
                // Until it is given something, or for a while.
                for _ in 0..10 {
                    if !reader.next(1, MOMENT).await?.is_empty() {
                        break;
                    }
                }
                reader.leave().await
            };
            passes(life.await);
        }
        is_over.store(true, Ordering::Relaxed);
    };
    let (first, second, ()) = tokio::join!(lasting(), lasting(), restless());
    println!("{} finishes while members came and went", first + second);
    assert!(first + second > 0, "nobody was at work");
    assert!(
        own.log.lag(FROM, "g").await.unwrap() > 0,
        "there was work all the time"
    );
    work_off(&own.log, "g").await;
    assert_one_each(&own.log, COUNT).await;
    end(own).await;
}

/// A life in a group that ended well, or in a way that a new one mends.
fn passes(ended: Result<(), StorageError>) {
    if let Err(error) = ended {
        assert!(error.is_retryable(), "{error}");
        println!("joined again: {error}");
    }
}

/// What was handed out and not finished is told as lost when its partition goes to another member.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_member_is_told_what_it_lost_with_its_partitions() {
    let own = open().await;
    own.log.append(&notices("a", 40)).await.unwrap();
    let mut first = own.log.join(FROM, "g").await.unwrap();
    let held = read(&mut *first, 40).await;
    assert_eq!(first.lost(), []);
    let mut second = own.log.join(FROM, "g").await.unwrap();
    let (mut lost, until) = (vec![], Instant::now() + WAIT_LIMIT);
    while lost.is_empty() {
        assert!(Instant::now() < until, "nothing was lost");
        first.next(1, MOMENT).await.unwrap();
        lost = first.lost();
    }
    let again = read(&mut *second, lost.len()).await;
    let mut again: Vec<_> = again.iter().map(|message| message.origin).collect();
    lost.sort();
    again.sort();
    assert_eq!(again, lost, "the other member has them");
    assert!(
        held.iter().any(|m| !lost.contains(&m.origin)),
        "both have some"
    );
    end(own).await;
}

/// More than the reader keeps: fetching pauses, the member stays in its group, and nothing is lost or out of order.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_slow_reader_stops_the_fetching_and_gets_everything_in_order() {
    const COUNT: usize = 3000;
    let own = open().await;
    let events: Vec<_> = (0..COUNT)
        .map(|n| notice_of(&n.to_string(), Some("p")))
        .collect();
    for some in events.chunks(500) {
        own.log.append(some).await.unwrap();
    }
    let mut reader = own.log.join(FROM, "g").await.unwrap();
    let mut seen = paths(&read(&mut *reader, 1).await);
    // Longer than the group waits for a member that does not say that it is alive.
    tokio::time::sleep(Duration::from_secs(8)).await;
    while seen.len() < COUNT {
        let messages = read(&mut *reader, (COUNT - seen.len()).min(100)).await;
        seen.extend(paths(&messages));
        reader
            .finish(messages.iter().map(finished).collect())
            .await
            .unwrap();
    }
    let expected: Vec<String> = (0..COUNT).map(|n| n.to_string()).collect();
    assert_eq!(seen, expected);
    end(own).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_member_that_leaves_is_replaced_at_once_and_not_by_a_timeout() {
    let own = open().await;
    own.log.append(&notices("a", 10)).await.unwrap();
    let mut all = vec![];
    // A busy machine may be slow now and then, but a timeout would be waited for each time.
    for _ in 0..5 {
        let mut first = own.log.join(FROM, "g").await.unwrap();
        read(&mut *first, 10).await;
        let start = Instant::now();
        first.leave().await.unwrap();
        let mut second = own.log.join(FROM, "g").await.unwrap();
        read(&mut *second, 10).await;
        all.push(start.elapsed());
        second.leave().await.unwrap();
        if all
            .last()
            .is_some_and(|took| *took < Duration::from_secs(5))
        {
            break;
        }
    }
    let fastest = all.iter().min().unwrap();
    assert!(*fastest < Duration::from_secs(5), "{all:?}");
    end(own).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_call_that_was_given_up_is_the_end_of_its_reader() {
    let own = open().await;
    own.log.append(&notices("a", 4)).await.unwrap();
    let mut reader = own.log.join(FROM, "g").await.unwrap();
    let messages = read(&mut *reader, 4).await;
    let done = messages.iter().map(finished_with_one).collect();
    let given_up = tokio::time::timeout(Duration::from_millis(1), reader.finish(done)).await;
    assert!(given_up.is_err(), "it was done within a millisecond");
    let refused = reader.next(1, MOMENT).await.unwrap_err();
    assert!(refused.is_retryable(), "{refused}");
    drop(reader);
    work_off(&own.log, "g").await;
    assert_one_each(&own.log, 4).await;
    end(own).await;
}
