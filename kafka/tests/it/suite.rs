//! What every event log promises: each case runs on the embedded log and on Kafka.

use std::collections::BTreeMap;
use std::time::Duration;

use bytes::Bytes;
use contract::event::MAX_EVENT_BYTES;
use contract::topic::{Origin, Topic};
use storage::log::{EventLog, Finished, Start, contents, tell_once};

use crate::events::{
    FROM, MOMENT, TO, assert_one_each, finished, finished_with_one, follow_ups, notice, notice_of,
    notices, path, paths, read, work_off,
};

/// Makes a test of each case for one kind of log: `open` gives a `log` that nobody else uses, `end` clears it away.
macro_rules! run_suite {
    ($open:path, $end:path) => {
        run_suite!(@cases $open, $end,
            order_within_a_key_is_kept,
            every_group_reads_everything_from_the_oldest,
            members_share_a_group_and_each_message_has_its_follow_up_once,
            a_member_that_leaves_hands_over_what_it_did_not_finish,
            messages_finished_out_of_order_come_again_from_the_oldest_unfinished,
            what_follows_is_not_there_before_finish_and_is_there_once_after_a_reader_died,
            finishing_nothing_or_what_is_not_held_changes_nothing,
            a_follower_from_now_sees_what_comes_and_one_from_the_oldest_sees_all,
            a_message_is_found_by_its_place,
            lag_counts_what_is_before_a_group,
            the_longest_event_passes_and_a_longer_one_does_not,
            a_message_that_nobody_understands_is_delivered_as_it_is_and_stops_nobody,
            contents_are_whole_and_what_was_told_is_not_told_again,
            refusals_are_listed_and_sent_again_once,
        );
    };
    (@cases $open:path, $end:path, $($case:ident,)*) => {
        $(
            #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $case() {
                let own = $open().await;
                $crate::suite::$case(&own.log).await;
                $end(own).await;
            }
        )*
    };
}
pub(crate) use run_suite;

pub(crate) use crate::rejected::refusals_are_listed_and_sent_again_once;

pub(crate) async fn order_within_a_key_is_kept(log: &dyn EventLog) {
    let product = |n: usize| format!("product-{}", n % 3);
    let event = |n: usize| notice_of(&format!("{n:04}"), Some(&product(n)));
    for n in 0..20 {
        log.append(&[event(n)]).await.unwrap();
    }
    let rest: Vec<_> = (20..60).map(event).collect();
    log.append(&rest).await.unwrap();
    let mut reader = log.join(FROM, "g").await.unwrap();
    let messages = read(&mut *reader, 60).await;
    let mut by_product: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for message in &messages {
        let path = path(message);
        let n: usize = path.parse().unwrap();
        by_product.entry(product(n)).or_default().push(path);
    }
    assert_eq!(by_product.len(), 3);
    for paths in by_product.values() {
        assert_eq!(paths.len(), 20);
        assert!(paths.is_sorted(), "{paths:?}");
    }
}

pub(crate) async fn every_group_reads_everything_from_the_oldest(log: &dyn EventLog) {
    log.append(&notices("a", 5)).await.unwrap();
    for group in ["first", "second"] {
        let mut reader = log.join(FROM, group).await.unwrap();
        let messages = read(&mut *reader, 5).await;
        reader
            .finish(messages.iter().map(finished).collect())
            .await
            .unwrap();
        assert!(reader.next(10, MOMENT).await.unwrap().is_empty());
    }
}

pub(crate) async fn members_share_a_group_and_each_message_has_its_follow_up_once(
    log: &dyn EventLog,
) {
    log.append(&notices("before", 100)).await.unwrap();
    let member = async || work_off(log, "g").await;
    let more = async {
        for n in 0..50 {
            log.append(&[notice(&format!("while{n}"))]).await.unwrap();
        }
    };
    // The second member comes while the first is at work, so that partitions change hands under it.
    let late = async {
        tokio::time::sleep(MOMENT).await;
        member().await;
    };
    tokio::join!(member(), late, more);
    // Members that saw the end before the last message came have gone: whatever is left is worked off now.
    work_off(log, "g").await;
    assert_one_each(log, 150).await;
}

pub(crate) async fn a_member_that_leaves_hands_over_what_it_did_not_finish(log: &dyn EventLog) {
    // One product: a second member cannot be given part of it.
    let events: Vec<_> = (0..10)
        .map(|n| notice_of(&n.to_string(), Some("p")))
        .collect();
    log.append(&events).await.unwrap();
    let mut first = log.join(FROM, "g").await.unwrap();
    let held = read(&mut *first, 10).await;
    let mut second = log.join(FROM, "g").await.unwrap();
    first
        .finish(held[..1].iter().map(finished).collect())
        .await
        .unwrap();
    first.leave().await.unwrap();
    let again = read(&mut *second, 9).await;
    assert_eq!(paths(&again), paths(&held[1..]));
}

pub(crate) async fn messages_finished_out_of_order_come_again_from_the_oldest_unfinished(
    log: &dyn EventLog,
) {
    // One product, so that there is one order.
    let events: Vec<_> = (0..6)
        .map(|n| notice_of(&n.to_string(), Some("p")))
        .collect();
    log.append(&events).await.unwrap();
    let mut reader = log.join(FROM, "g").await.unwrap();
    let held = read(&mut *reader, 6).await;
    let done = |indices: &[usize]| {
        indices
            .iter()
            .map(|&n| finished_with_one(&held[n]))
            .collect()
    };
    reader.finish(done(&[5, 3, 1])).await.unwrap();
    assert!(
        follow_ups(log).await.is_empty(),
        "the oldest is not finished"
    );
    reader.finish(done(&[0])).await.unwrap();
    let expected: Vec<Origin> = held[..2].iter().map(|message| message.origin).collect();
    let follow_ups = follow_ups(log).await;
    let found: Vec<Origin> = follow_ups
        .into_keys()
        .map(|(_group, origin)| origin)
        .collect();
    assert_eq!(found, expected);
    drop(reader);
    let mut next = log.join(FROM, "g").await.unwrap();
    assert_eq!(paths(&read(&mut *next, 4).await), ["2", "3", "4", "5"]);
}

pub(crate) async fn what_follows_is_not_there_before_finish_and_is_there_once_after_a_reader_died(
    log: &dyn EventLog,
) {
    log.append(&notices("a", 20)).await.unwrap();
    let mut before = log.join(FROM, "g").await.unwrap();
    let held = read(&mut *before, 20).await;
    assert_eq!(held.len(), 20);
    drop(before);
    assert!(follow_ups(log).await.is_empty());
    let mut after = log.join(FROM, "g").await.unwrap();
    let held = read(&mut *after, 20).await;
    after
        .finish(held[..7].iter().map(finished_with_one).collect())
        .await
        .unwrap();
    drop(after);
    work_off(log, "g").await;
    assert_one_each(log, 20).await;
}

pub(crate) async fn finishing_nothing_or_what_is_not_held_changes_nothing(log: &dyn EventLog) {
    log.append(&notices("a", 2)).await.unwrap();
    let mut reader = log.join(FROM, "g").await.unwrap();
    reader.finish(vec![]).await.unwrap();
    let stranger = Finished {
        origin: Origin {
            topic: FROM,
            partition: 0,
            offset: 999,
        },
        follows: vec![notice("never")],
    };
    reader.finish(vec![stranger]).await.unwrap();
    assert_eq!(read(&mut *reader, 2).await.len(), 2);
    assert_eq!(log.lag(FROM, "g").await.unwrap(), 2);
    assert_eq!(contents(log, FROM).await.unwrap().len(), 2);
}

pub(crate) async fn a_follower_from_now_sees_what_comes_and_one_from_the_oldest_sees_all(
    log: &dyn EventLog,
) {
    log.append(&notices("old", 3)).await.unwrap();
    // What is durable may take a moment until it is seen.
    assert_eq!(contents(log, FROM).await.unwrap().len(), 3);
    let mut now = log.follow(FROM, Start::Now).await.unwrap();
    let mut oldest = log.follow(FROM, Start::Oldest).await.unwrap();
    log.append(&notices("new", 3)).await.unwrap();
    for (follower, count) in [(&mut now, 3), (&mut oldest, 6)] {
        let mut seen = vec![];
        while seen.len() < count {
            let some = follower.next(2, Duration::from_secs(10)).await.unwrap();
            assert!(!some.is_empty() && some.len() <= 2);
            seen.extend(paths(&some));
        }
        assert!(follower.next(2, MOMENT).await.unwrap().is_empty());
        let new = seen.iter().filter(|path| path.starts_with("new")).count();
        assert_eq!((new, seen.len()), (3, count));
    }
    assert_eq!(
        log.lag(FROM, "g").await.unwrap(),
        6,
        "followers leave no trace"
    );
}

pub(crate) async fn a_message_is_found_by_its_place(log: &dyn EventLog) {
    log.append(&notices("a", 8)).await.unwrap();
    let all = contents(log, FROM).await.unwrap();
    assert_eq!(all.len(), 8);
    for message in &all {
        let found = log.message(message.origin).await.unwrap();
        assert_eq!(found.as_ref(), Some(message));
    }
    let nowhere = |topic, partition, offset| Origin {
        topic,
        partition,
        offset,
    };
    for origin in [
        nowhere(FROM, 0, 1_000_000),
        nowhere(FROM, 4_000_000_000, 0),
        nowhere(FROM, 0, u64::MAX),
        nowhere(Topic::RenderDone, 0, 0),
    ] {
        assert_eq!(log.message(origin).await.unwrap(), None, "{origin}");
    }
}

pub(crate) async fn lag_counts_what_is_before_a_group(log: &dyn EventLog) {
    assert_eq!(log.lag(FROM, "g").await.unwrap(), 0);
    log.append(&notices("a", 6)).await.unwrap();
    log.append(&[notice("b")]).await.unwrap();
    assert_eq!(log.lag(FROM, "g").await.unwrap(), 7);
    let mut reader = log.join(FROM, "g").await.unwrap();
    let messages = read(&mut *reader, 7).await;
    assert_eq!(log.lag(FROM, "g").await.unwrap(), 7, "read is not finished");
    reader
        .finish(messages.iter().map(finished).collect())
        .await
        .unwrap();
    assert_eq!(log.lag(FROM, "g").await.unwrap(), 0);
    assert_eq!(log.lag(FROM, "other").await.unwrap(), 7);
}

pub(crate) async fn the_longest_event_passes_and_a_longer_one_does_not(log: &dyn EventLog) {
    let empty = notice("").to_json().len();
    let longest = notice(&"x".repeat(MAX_EVENT_BYTES - empty));
    assert_eq!(longest.to_json().len(), MAX_EVENT_BYTES);
    log.append(std::slice::from_ref(&longest)).await.unwrap();
    let too_long = Bytes::from(vec![b' '; MAX_EVENT_BYTES + 1]);
    let refused = log.append_message(FROM, "k", too_long).await.unwrap_err();
    assert!(!refused.is_retryable(), "{refused}");
    let longer = notice(&"x".repeat(MAX_EVENT_BYTES - empty + 1));
    // All or none: what stands before it is not appended either.
    let refused = log.append(&[notice("before"), longer.clone()]).await;
    let refused = refused.unwrap_err();
    assert!(!refused.is_retryable(), "{refused}");
    assert_eq!(contents(log, FROM).await.unwrap().len(), 1);
    let mut reader = log.join(FROM, "g").await.unwrap();
    let messages = read(&mut *reader, 1).await;
    assert_eq!(messages[0].event().unwrap(), longest);
    // What follows may be as long, and no longer.
    let done = |follows| Finished {
        origin: messages[0].origin,
        follows,
    };
    let refused = reader.finish(vec![done(vec![longer])]).await.unwrap_err();
    assert!(!refused.is_retryable(), "{refused}");
    let follows = vec![longest.clone(), longest.clone()];
    reader.finish(vec![done(follows)]).await.unwrap();
    assert_eq!(contents(log, FROM).await.unwrap().len(), 3);
}

pub(crate) async fn a_message_that_nobody_understands_is_delivered_as_it_is_and_stops_nobody(
    log: &dyn EventLog,
) {
    let poison: [&[u8]; 4] = [b"", b"{\"schema\":9}", b"\x00\x01", "\u{feff}{}".as_bytes()];
    for content in poison {
        log.append_message(FROM, "k", Bytes::from_static(content))
            .await
            .unwrap();
    }
    log.append_message(FROM, "k", Bytes::from(notice("good").to_json()))
        .await
        .unwrap();
    let mut reader = log.join(FROM, "g").await.unwrap();
    let messages = read(&mut *reader, 5).await;
    for (message, content) in messages.iter().zip(poison) {
        assert_eq!(message.content, content);
        assert!(message.event().is_err());
    }
    assert_eq!(path(&messages[4]), "good");
    reader
        .finish(messages.iter().map(finished).collect())
        .await
        .unwrap();
    assert_eq!(log.lag(FROM, "g").await.unwrap(), 0);
}

pub(crate) async fn contents_are_whole_and_what_was_told_is_not_told_again(log: &dyn EventLog) {
    assert!(contents(log, TO).await.unwrap().is_empty());
    log.append(&notices("a", 1000)).await.unwrap();
    assert_eq!(contents(log, FROM).await.unwrap().len(), 1000);
    for _ in 0..2 {
        tell_once(log, &notice("a500")).await.unwrap();
        tell_once(log, &notice("b")).await.unwrap();
    }
    let mut all = paths(&contents(log, FROM).await.unwrap());
    all.sort();
    all.dedup();
    assert_eq!(all.len(), 1001);
    assert_eq!(contents(log, FROM).await.unwrap().len(), 1001);
}
