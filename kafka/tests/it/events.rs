//! Events and reading loops that tests share.

use std::collections::BTreeMap;
use std::time::Duration;

use contract::event::{Body, Event, RejectReason};
use contract::topic::{Origin, Topic};
use storage::log::{EventLog, Finished, Message, Reader, contents};
use tokio::time::Instant;

/// What tests read from, and where what follows goes.
pub(crate) const FROM: Topic = Topic::GranuleNotice;
pub(crate) const TO: Topic = Topic::GranuleRejected;
/// A test waits so long for what must come: a group may have to notice a killed member first.
pub(crate) const WAIT_LIMIT: Duration = Duration::from_mins(1);
pub(crate) const MOMENT: Duration = Duration::from_millis(200);

pub(crate) fn notice(path: &str) -> Event {
    notice_of(path, None)
}

/// A notice whose order is kept among those of the same product.
pub(crate) fn notice_of(path: &str, product: Option<&str>) -> Event {
    let body = Body::GranuleNotice {
        path: path.to_owned(),
        profile: None,
        product: product.map(|product| product.parse().unwrap()),
        variable: None,
        indexes: vec![],
        sha256: None,
        size_bytes: None,
        attempt: 1,
    };
    Event::new("trace", body)
}

pub(crate) fn notices(prefix: &str, count: usize) -> Vec<Event> {
    (0..count)
        .map(|n| notice(&format!("{prefix}{n}")))
        .collect()
}

/// What follows from a message in these tests: one refusal that names the message and the group that read it.
fn follow_up(message: &Message, group: &str) -> Event {
    let body = Body::GranuleRejected {
        path: path(message),
        reason: RejectReason::Grid,
        detail: group.to_owned(),
        attempt: 1,
        origin: Some(message.origin),
    };
    Event::new("trace", body)
}

pub(crate) fn finished(message: &Message) -> Finished {
    Finished {
        origin: message.origin,
        follows: vec![],
    }
}

/// Finished by the group `g`, with one event that follows.
pub(crate) fn finished_with_one(message: &Message) -> Finished {
    finished_by("g", message)
}

pub(crate) fn finished_by(group: &str, message: &Message) -> Finished {
    Finished {
        origin: message.origin,
        follows: vec![follow_up(message, group)],
    }
}

pub(crate) fn path(message: &Message) -> String {
    match message.event().unwrap().body {
        Body::GranuleNotice { path, .. } | Body::GranuleRejected { path, .. } => path,
        other => panic!("{other:?}"),
    }
}

pub(crate) fn paths(messages: &[Message]) -> Vec<String> {
    messages.iter().map(path).collect()
}

/// Reads until `count` messages came.
pub(crate) async fn read(reader: &mut dyn Reader, count: usize) -> Vec<Message> {
    let (mut all, until) = (vec![], Instant::now() + WAIT_LIMIT);
    while all.len() < count {
        assert!(
            Instant::now() < until,
            "{} of {count} messages came",
            all.len()
        );
        all.extend(reader.next(count - all.len(), MOMENT).await.unwrap());
    }
    all
}

/// The lag of a group. A transaction that a killed process left open holds the answer back until it is ended.
pub(crate) async fn lag(log: &dyn EventLog, group: &str) -> u64 {
    let until = Instant::now() + WAIT_LIMIT;
    loop {
        match log.lag(FROM, group).await {
            Ok(lag) => return lag,
            Err(error) => assert!(error.is_retryable() && Instant::now() < until, "{error}"),
        }
    }
}

/// Reads and finishes, a follow-up for each, until the group has no message before it.
pub(crate) async fn work_off(log: &dyn EventLog, group: &str) {
    let mut reader = log.join(FROM, group).await.unwrap();
    let until = Instant::now() + WAIT_LIMIT;
    loop {
        let messages = reader.next(64, MOMENT).await.unwrap();
        if messages.is_empty() && lag(log, group).await == 0 {
            reader.leave().await.unwrap();
            return;
        }
        assert!(Instant::now() < until, "the group does not come to the end");
        reader
            .finish(
                messages
                    .iter()
                    .map(|message| finished_by(group, message))
                    .collect(),
            )
            .await
            .unwrap();
    }
}

/// How often what followed names each group and place.
pub(crate) async fn follow_ups(log: &dyn EventLog) -> BTreeMap<(String, Origin), usize> {
    let mut counts = BTreeMap::new();
    for message in contents(log, TO).await.unwrap() {
        let Body::GranuleRejected {
            origin: Some(origin),
            detail: group,
            ..
        } = message.event().unwrap().body
        else {
            panic!("a refusal with its origin");
        };
        *counts.entry((group, origin)).or_default() += 1;
    }
    counts
}

/// Exactly one follow-up for each of `count` messages, each group's counted for itself.
pub(crate) async fn assert_one_each(log: &dyn EventLog, count: usize) {
    let counts = follow_ups(log).await;
    let wrong: Vec<_> = counts.iter().filter(|(_, times)| **times != 1).collect();
    assert!(wrong.is_empty(), "not once: {wrong:?}");
    assert_eq!(counts.len(), count, "messages that something followed from");
}
