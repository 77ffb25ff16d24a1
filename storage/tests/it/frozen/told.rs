//! Events, and the journal of the embedded log that holds them, as they were written.

use std::path::Path;
use std::time::Duration;

use contract::digest::Digest;
use contract::event::{Body, EVENT_SCHEMA, Event, RejectReason};
use contract::manifest::MANIFEST_SCHEMA;
use contract::masked::MaskedCells;
use contract::observation::{Observation, PlatformKind, Quality};
use contract::time::Period;
use contract::topic::{Origin, Topic};
use storage::log::{EmbeddedLog, EventLog as _, Finished, Message, Start};

use super::{copy_of, frozen, to_freeze};

const REASONS: [RejectReason; 13] = [
    RejectReason::Unreadable,
    RejectReason::Corrupt,
    RejectReason::TooLarge,
    RejectReason::NoVariable,
    RejectReason::Unit,
    RejectReason::Time,
    RejectReason::Grid,
    RejectReason::Values,
    RejectReason::Conflict,
    RejectReason::Checksum,
    RejectReason::Location,
    RejectReason::Unavailable,
    RejectReason::Message,
];

/// A new kind of event or reason has no arm here: freeze one of it, and add it below.
fn is_frozen(body: &Body) -> bool {
    match body {
        Body::GranuleRejected { reason, .. } => match reason {
            RejectReason::Unreadable
            | RejectReason::Corrupt
            | RejectReason::TooLarge
            | RejectReason::NoVariable
            | RejectReason::Unit
            | RejectReason::Time
            | RejectReason::Grid
            | RejectReason::Values
            | RejectReason::Conflict
            | RejectReason::Checksum
            | RejectReason::Location
            | RejectReason::Unavailable
            | RejectReason::Message => REASONS.contains(reason),
        },
        Body::GranuleNotice { .. }
        | Body::GranuleLanded { .. }
        | Body::Observations { .. }
        | Body::ProductDerived { .. }
        | Body::RenderJob { .. }
        | Body::RenderDone { .. } => true,
    }
}

fn event(body: Body) -> Event {
    assert!(is_frozen(&body));
    Event {
        schema: 2,
        trace: "frozen".to_owned(),
        noticed: None,
        body,
    }
}

fn notices() -> [Event; 2] {
    let plain = Body::GranuleNotice {
        path: "/srv/frozen/a.nc".to_owned(),
        profile: None,
        product: None,
        variable: None,
        indexes: vec![],
        sha256: None,
        size_bytes: None,
        attempt: 1,
    };
    let full = Body::GranuleNotice {
        path: "https://example.org/b.nc?x=\"1\"".to_owned(),
        profile: Some("oceanflux".to_owned()),
        product: "fgco2".parse().ok(),
        variable: None,
        indexes: vec![],
        sha256: Some(Digest::of(b"b")),
        size_bytes: Some(4_294_967_297),
        attempt: 2,
    };
    let noticed = "2001-03-01T00:00:00.007Z".parse().ok();
    [event(plain), event(full)].map(|event| Event { noticed, ..event })
}

fn landed() -> [Event; 2] {
    let of = |step_count, assumptions, masked| Body::GranuleLanded {
        path: "/srv/frozen/a.nc".to_owned(),
        raw_sha256: Digest::of(b"a"),
        manifest: "fgco2@12-0a1b2c3d".parse().unwrap(),
        periods: vec![Period::month(2001, 1).unwrap()],
        step_count,
        revised: step_count.is_some(),
        assumptions,
        masked,
    };
    let masked = MaskedCells {
        out_of_range: 1,
        poor_quality: 2,
        implausible: 3,
    };
    let assumed = vec!["stamps are starts".to_owned()];
    [
        event(of(None, vec![], MaskedCells::default())),
        event(of(Some(2000), assumed, masked)),
    ]
}

/// All other kinds of events.
fn others() -> Vec<Event> {
    let rejected = |reason| Body::GranuleRejected {
        path: "/srv/frozen/c.nc".to_owned(),
        reason,
        detail: "flux: its unit is \u{b5}mol; say which substance".to_owned(),
        attempt: 3,
        origin: (reason != RejectReason::Message).then_some(Origin {
            topic: Topic::GranuleNotice,
            partition: 4,
            offset: 5,
        }),
    };
    let measured = Observation {
        dataset: "buoys".parse().unwrap(),
        platform: "44005".to_owned(),
        kind: PlatformKind::Buoy,
        time: "2012-01-01T00:10:00Z".parse().unwrap(),
        lon_deg: -69.125,
        lat_deg: 43.25,
        depth_m: -5.5,
        property: "sea_surface_temperature".to_owned(),
        value: 285.35,
        unit: "K".to_owned(),
        quality: Quality::NotEvaluated,
    };
    let derived = Body::ProductDerived {
        manifest: "fgco2-accumulated@3-00ff00ff".parse().unwrap(),
        derived_from: "fgco2@12-0a1b2c3d".parse().unwrap(),
    };
    let done = |failure: Option<&str>| Body::RenderDone {
        key: "tiles/ab/abcd.png".parse().unwrap(),
        duration_ms: 1234,
        failure: failure.map(str::to_owned),
    };
    let mut bodies: Vec<Body> = REASONS.into_iter().map(rejected).collect();
    bodies.extend([
        Body::Observations {
            observations: vec![measured],
        },
        derived,
        Body::RenderJob {
            job: Box::new(super::jobs::full()),
        },
        done(None),
        done(Some("its frames are gone")),
    ]);
    bodies.into_iter().map(event).collect()
}

/// All of them, as they lie in the log.
fn told() -> Vec<Event> {
    notices()
        .into_iter()
        .chain(landed())
        .chain(others())
        .collect()
}

/// Tells all of it, one notice finished by a group.
async fn write(folder: &Path) {
    let log = EmbeddedLog::open(folder).unwrap();
    log.append(&notices()).await.unwrap();
    let mut reader = log.join(Topic::GranuleNotice, "ingest").await.unwrap();
    let first = reader.next(1, Duration::ZERO).await.unwrap().remove(0);
    let finished = Finished {
        origin: first.origin,
        follows: landed().into(),
    };
    reader.finish(vec![finished]).await.unwrap();
    log.append(&others()).await.unwrap();
    drop((reader, log));
    std::fs::remove_file(folder.join("lock")).unwrap();
}

async fn messages(log: &EmbeddedLog, topic: Topic) -> Vec<Message> {
    let mut follower = log.follow(topic, Start::Oldest).await.unwrap();
    follower.next(1000, Duration::ZERO).await.unwrap()
}

#[tokio::test]
async fn a_frozen_log_holds_what_was_told_and_how_far_its_readers_had_come() {
    if let Some(folder) = to_freeze() {
        write(&folder.join("events")).await;
    }
    assert_eq!(
        EVENT_SCHEMA, MANIFEST_SCHEMA,
        "freeze events of the new schema too"
    );
    let folder = copy_of(2, "events");
    let log = EmbeddedLog::open(folder.path()).unwrap();
    for topic in Topic::ALL {
        let expected = told().into_iter().filter(|it| it.body.topic() == topic);
        let expected: Vec<Event> = expected.collect();
        assert!(!expected.is_empty(), "no {topic} is frozen");
        let found = messages(&log, topic).await;
        let texts: Vec<String> = expected.iter().map(Event::to_json).collect();
        let found_texts: Vec<&[u8]> = found.iter().map(|it| &it.content[..]).collect();
        let texts: Vec<&[u8]> = texts.iter().map(String::as_bytes).collect();
        assert_eq!(found_texts, texts, "{topic}");
        for (message, expected) in found.iter().zip(expected) {
            assert!(message.time.is_some());
            // Jobs of another renderer are read and refused.
            let read: Event = serde_json::from_slice(&message.content).unwrap();
            assert_eq!(read, expected);
            assert!(topic == Topic::RenderJob || message.event().unwrap() == read);
        }
    }
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 1);
    // What it holds now is what would be written now, but for the time.
    let now = tempfile::tempdir().unwrap();
    write(now.path()).await;
    let lines = |folder: &Path| -> Vec<serde_json::Value> {
        let text = std::fs::read_to_string(folder.join("journal.jsonl")).unwrap();
        let line = |line: &str| {
            let mut line: serde_json::Value = serde_json::from_str(line).unwrap();
            let members = line.as_object_mut().unwrap();
            assert!(members.remove("crc32").is_some());
            members.remove("time");
            line
        };
        text.lines().map(line).collect()
    };
    assert_eq!(lines(&frozen(2).join("events")), lines(now.path()));
}

/// By its key a message finds its partition: what must stay in order must keep it.
#[test]
fn events_share_the_keys_that_they_shared() {
    let line = |event: Event| format!("{} {}\n", event.body.topic(), event.body.order_key());
    let now: String = told().into_iter().map(line).collect();
    if let Some(folder) = to_freeze() {
        std::fs::write(folder.join("order-keys.txt"), &now).unwrap();
    }
    let then = std::fs::read_to_string(frozen(2).join("order-keys.txt")).unwrap();
    assert_eq!(then, now);
}

#[tokio::test]
async fn the_log_of_version_1_is_read_and_gone_on_with() {
    let folder = copy_of(1, "events");
    let log = EmbeddedLog::open(folder.path()).unwrap();
    let mut counts = vec![];
    for topic in Topic::ALL {
        let found = messages(&log, topic).await;
        for message in &found {
            let event = message.event().unwrap();
            assert_eq!((event.schema, event.body.topic()), (1, topic));
            assert_eq!(event.to_json().as_bytes(), message.content);
            assert_eq!(message.time, None);
        }
        counts.push(found.len());
    }
    // Notices, observations, landed, rejected, derived, and no pictures.
    assert_eq!(counts, [3, 0, 1, 1, 1, 0, 0]);
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
    log.append(&notices()).await.unwrap();
    drop(log);
    let log = EmbeddedLog::open(folder.path()).unwrap();
    assert_eq!(messages(&log, Topic::GranuleNotice).await.len(), 5);
}
