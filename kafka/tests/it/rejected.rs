//! Refusals: listed and sent again, on any log.

use bytes::Bytes;
use contract::event::{Body, Event, RejectReason};
use contract::topic::Origin;
use kafka_log::rejected::{list, replay};
use storage::log::{EventLog, contents};

use crate::events::{FROM, notice};

fn refusal(path: &str, origin: Option<Origin>) -> Event {
    let body = Body::GranuleRejected {
        path: path.to_owned(),
        reason: RejectReason::Unavailable,
        detail: "not there".to_owned(),
        attempt: 1,
        origin,
    };
    Event::new("trace", body)
}

/// A case of the suite.
pub(crate) async fn refusals_are_listed_and_sent_again_once(log: &dyn EventLog) {
    const FOREIGN: &[u8] = b"{\"version\":\"1.6\"}";
    log.append(&[notice("a")]).await.unwrap();
    log.append_message(FROM, "b", Bytes::from_static(FOREIGN))
        .await
        .unwrap();
    let messages = contents(log, FROM).await.unwrap();
    let place = |content: &[u8]| {
        let found = messages.iter().find(|message| message.content == content);
        found.unwrap().origin
    };
    let (ours, foreign) = (place(notice("a").to_json().as_bytes()), place(FOREIGN));
    let nowhere = Origin {
        offset: 1_000_000,
        ..ours
    };
    let refusals = [
        refusal("a", Some(ours)),
        refusal("a", Some(ours)),
        refusal("b", Some(foreign)),
        refusal("c", Some(nowhere)),
        refusal("d", None),
    ];
    log.append(&refusals).await.unwrap();

    let listed = list(log).await.unwrap();
    assert_eq!(listed.len(), 5);
    let replayed = replay(log, &listed).await.unwrap();
    assert_eq!((replayed.sent, replayed.gone.len()), (2, 2));

    let messages = contents(log, FROM).await.unwrap();
    assert_eq!(messages.len(), 4);
    let foreign = messages.iter().filter(|message| message.content == FOREIGN);
    assert_eq!(foreign.count(), 2, "a foreign message is sent as it was");
    let mut attempts: Vec<u32> = messages
        .iter()
        .filter_map(|message| match message.event().ok()?.body {
            Body::GranuleNotice { attempt, .. } => Some(attempt),
            _ => None,
        })
        .collect();
    let came = messages.iter().find(|message| message.origin == ours);
    let again = messages.iter().filter_map(|message| message.event().ok());
    let again = again.filter(|event| matches!(event.body, Body::GranuleNotice { attempt: 2, .. }));
    let noticed: Vec<_> = again.map(|event| event.noticed).collect();
    assert_eq!(noticed, [came.unwrap().time], "it is no newer for that");
    assert!(noticed[0].is_some());
    attempts.sort_unstable();
    assert_eq!(attempts, [1, 2], "a notice is the next attempt");
}
