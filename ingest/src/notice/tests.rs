//! Messages of both kinds, and of none.

use super::*;
use crate::fetch::Method;
use crate::settings::DecoderCommand;
use contract::topic::{Origin, Topic};

const NOW: &str = "2020-01-01T00:00:00Z";

fn settings() -> Settings {
    Settings::with_decoder(DecoderCommand {
        program: "none".into(),
        arguments: vec![],
    })
}

fn of(content: impl Into<Vec<u8>>) -> Vec<PendingNotice> {
    let origin = Origin {
        topic: Topic::GranuleNotice,
        partition: 3,
        offset: 7,
    };
    let message = Message {
        origin,
        content: content.into().into(),
        time: None,
    };
    PendingNotice::of(&message, &settings(), NOW.parse().unwrap())
}

fn refusal(content: impl Into<Vec<u8>>) -> String {
    let notices = of(content);
    assert_eq!(notices.len(), 1, "a message is answered once");
    assert_eq!(notices[0].shown, "granule.notice/3/7");
    let rejection = notices[0].order.clone().unwrap_err();
    assert_eq!(rejection.reason, RejectReason::Message);
    rejection.detail
}

/// Written by hand after the schema's version 1.6: string and object collections, groups, several kinds of files.
fn cnm(change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let mut message = serde_json::json!({
        "version": "1.6.1", "provider": "P", "collection": "OCF-SST-GLO-1M-100-ATS-ARC",
        "submissionTime": "2019-12-31T23:00:00.5", "identifier": "id-1", "extra": {"any": 1},
        "product": {"name": "g", "dataVersion": "1", "files": [
            {"type": "data", "uri": "https://user:hunter2@h/20100101-x.nc?sig=hunter2", "name": "20100101-x.nc",
             "checksumType": "SHA-256", "checksum": "B".repeat(64), "size": 12.0},
            {"type": "browse", "uri": "https://h/x.png", "name": "x.png", "size": 3}]}
    });
    change(&mut message);
    serde_json::to_vec(&message).unwrap()
}

#[test]
fn our_own_notice_keeps_what_it_says() {
    let text = r#"{"schema":1,"trace":"t","body":{"kind":"granule.notice","path":"/a/b.nc","profile":"sst-2010","product":"p","size_bytes":9,"attempt":2}}"#;
    let notice = of(text).remove(0);
    assert_eq!((notice.attempt, notice.order_key().as_str()), (2, "p"));
    assert_eq!(
        notice.cause.noticed,
        Some(NOW.parse().unwrap()),
        "the time of arrival, if it has none"
    );
    let order = notice.order.unwrap();
    assert_eq!(order.expected.size_bytes, Some(9));
    assert_eq!(order.profile.unwrap().name, "sst-2010");
}

#[test]
fn a_cloud_notification_becomes_a_notice_of_each_data_file() {
    let notices = of(cnm(|_| ()));
    assert_eq!(notices.len(), 1);
    let PendingNotice {
        shown,
        order,
        cause,
        ..
    } = &notices[0];
    let order = order.as_ref().unwrap();
    assert_eq!(
        shown, "https://h/20100101-x.nc",
        "no password, no signature"
    );
    assert!(!cause.to_json().contains("hunter2"));
    assert_eq!(cause.trace, "id-1");
    assert_eq!(
        cause.noticed,
        Some("2019-12-31T23:00:00.500Z".parse().unwrap())
    );
    assert_eq!(order.expected.sha256, "b".repeat(64).parse().ok());
    assert_eq!(order.expected.size_bytes, Some(12));
    assert_eq!(
        order.profile.as_ref().unwrap().name,
        "sst-2010",
        "by its collection"
    );
}

#[test]
fn files_in_groups_collections_as_objects_and_other_checksums_are_understood() {
    let file =
        serde_json::json!({"type": "data", "uri": "s3://b/x.nc", "checksum": "a".repeat(32)});
    let notices = of(cnm(|m| {
        m["version"] = "v1.1".into();
        m["collection"] = serde_json::json!({"name": "unheard-of", "version": "2"});
        m["product"]["files"] = serde_json::json!([]);
        m["product"]["filegroups"] = serde_json::json!([{"files": [file]}, {"files": [file]}]);
    }));
    assert_eq!(notices.len(), 1, "the same file in two groups");
    let order = notices[0].order.as_ref().unwrap();
    assert_eq!(order.expected.other, Some((Method::Md5, "a".repeat(32))));
    assert!(order.profile.is_none(), "the file tells");
}

#[test]
fn what_is_no_notice_is_refused_and_not_quoted() {
    assert!(refusal("hunter2").contains("expected"));
    assert!(refusal([0xff, 0xfe]).contains("utf-8"));
    assert!(refusal(vec![b' '; MAX_EVENT_BYTES + 1]).contains("longer"));
    let other = r#"{"schema":7,"trace":"t","body":{"kind":"granule.notice","path":"https://u:hunter2@h/"}}"#;
    let detail = refusal(other);
    assert!(
        detail.contains("schema 7 is unknown") && !detail.contains("hunter2"),
        "{detail}"
    );
    let event =
        r#"{"schema":1,"trace":"t","body":{"kind":"render.done","key":"a","duration_ms":1}}"#;
    assert!(refusal(event).contains("render.done"));
    assert!(refusal(cnm(|m| m["version"] = "2.0".into())).contains("1.x"));
    assert!(refusal(cnm(|m| m["product"] = serde_json::Value::Null)).contains("without a product"));
    assert!(refusal(cnm(|m| m["product"]["files"][0]["type"] = "qa".into())).contains("\"data\""));
    assert!(!refusal("[".repeat(10_000)).is_empty());
}

#[test]
fn a_file_with_an_impossible_size_or_checksum_is_refused_alone() {
    for (field, value) in [
        ("size", serde_json::json!(-1)),
        ("checksum", "xyz".into()),
        ("uri", "ftp://h/x".into()),
    ] {
        let notices = of(cnm(|m| m["product"]["files"][0][field] = value));
        assert!(notices[0].order.is_err(), "{field}");
        assert_eq!(notices[0].cause.trace, "id-1");
    }
}
