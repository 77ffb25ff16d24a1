//! Services that are set up wrongly: each says what to put right, and ends before it does any work.

use std::path::Path;

use contract::topic::Topic;
use harness::servers::Servers;

use super::{Ground, SERVICES, refused_start};
use crate::together;

/// Services that read or write the event log.
const OVER_KAFKA: [&str; 4] = ["ingestd", "scheduler", "render-worker", "tile-server"];
/// What the versions are written under, the only thing that a service may have stored.
const PROTOCOL: &str = "protocol/current.json";

#[test]
fn a_missing_topic_ends_a_service_that_names_it() {
    let ground = Ground::without_topics();
    for service in OVER_KAFKA {
        let talk = ground.refused_start(service);
        assert!(
            talk.contains("granule.notice is missing") && talk.contains("fluxglobe topics create"),
            "{service}: {talk}"
        );
    }
    assert_eq!(ground.objects(), [PROTOCOL]);
    // Nobody has made a topic by asking for it.
    let made = ground.succeed(&["topics", "create"]);
    assert_eq!(made.matches(" made").count(), Topic::ALL.len(), "{made}");
}

#[test]
fn a_wrong_partition_count_ends_a_service_that_names_it() {
    let mut ground = Ground::new();
    ground.set("FLUXGLOBE_KAFKA_PARTITIONS", "3");
    for service in OVER_KAFKA {
        let talk = ground.refused_start(service);
        assert!(
            talk.contains("has 1 partitions, 3 are wanted"),
            "{service}: {talk}"
        );
    }
    assert_eq!(ground.objects(), [PROTOCOL]);
}

#[test]
fn services_of_another_version_end_before_they_write_anything() {
    let ground = Ground::new();
    let written = ground.path("store").join(PROTOCOL);
    std::fs::create_dir_all(written.parent().unwrap()).unwrap();
    let theirs = r#"{"event_schema":2,"manifest_schema":1,"renderer_version":1}"#;
    std::fs::write(&written, theirs).unwrap();
    for service in SERVICES {
        let talk = ground.refused_start(service);
        assert!(
            talk.contains("services of another version") && talk.contains("\"event_schema\":2"),
            "{service}: {talk}"
        );
    }
    assert_eq!(ground.objects(), [PROTOCOL]);
    assert_eq!(std::fs::read_to_string(&written).unwrap(), theirs);
    // The good granule was noticed and nobody took it.
    let file = ground.good();
    ground.succeed(&["notice", file.to_str().unwrap()]);
    ground.refused_start("ingestd");
    assert_eq!(ground.lag(Topic::GranuleNotice, "ingest"), 1);
}

/// Settings that reach nobody: whoever waits for a server does not come to its secrets.
fn unreachable(folder: &Path, more: &[(&str, &str)]) -> Vec<(String, String)> {
    let spool = folder.join("spool").display().to_string();
    let base = [
        ("FLUXGLOBE_STORE", "s3://bucket/prefix"),
        ("AWS_ENDPOINT_URL", "http://127.0.0.1:1"),
        ("AWS_ALLOW_HTTP", "true"),
        ("AWS_ACCESS_KEY_ID", "key"),
        ("AWS_SECRET_ACCESS_KEY", "hush"),
        ("FLUXGLOBE_KAFKA", "127.0.0.1:1"),
        ("FLUXGLOBE_SPOOL", &spool),
        ("FLUXGLOBE_CPU", "true"),
    ];
    let kept = base
        .iter()
        .filter(|(name, _)| !more.iter().any(|(other, _)| other == name));
    kept.chain(more)
        .filter(|(_, value)| !value.is_empty())
        .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()))
        .collect()
}

#[test]
fn a_missing_secret_is_named_before_anything_is_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let absent = folder.path().join("absent").display().to_string();
    let login = [
        ("FLUXGLOBE_KAFKA_SECURITY", "sasl_ssl"),
        ("FLUXGLOBE_KAFKA_USER", "bob"),
        ("FLUXGLOBE_KAFKA_PASSWORD_FILE", &absent),
    ];
    let database = [
        ("FLUXGLOBE_POSTGIS", "postgres://bob@127.0.0.1:1/db"),
        ("FLUXGLOBE_POSTGIS_PASSWORD_FILE", &absent),
    ];
    let keys = [("AWS_SECRET_ACCESS_KEY", "")];
    let cases: [(&[&str], &[(&str, &str)], &str); 4] = [
        (&OVER_KAFKA, &login, "--kafka-password-file"),
        (&OVER_KAFKA, &login[..2], "--kafka-password-file"),
        (
            &["ingestd", "tile-server"],
            &database,
            "--postgis-password-file",
        ),
        (&SERVICES, &keys, "AWS_SECRET_ACCESS_KEY"),
    ];
    for (services, more, says) in cases {
        let settings = unreachable(folder.path(), more);
        for service in services {
            let talk = refused_start(folder.path(), service, &settings);
            let last = talk.lines().last().unwrap_or_default();
            assert!(last.contains(says), "{service}: {talk}");
            assert!(!talk.contains("hush"), "{service}: {talk}");
        }
    }
}

#[test]
fn a_store_that_cannot_be_written_or_not_with_these_keys_ends_every_service() {
    let _together = together();
    let folder = tempfile::tempdir().unwrap();
    let mut servers = Servers::start(&["s3"]).unwrap();
    let buckets = servers.folder().join("s3/data");
    let settings = |servers: &Servers, more: &[(&str, &str)]| {
        let s3 = servers
            .settings()
            .iter()
            .map(|(n, v)| (n.as_str(), v.as_str()));
        let given: Vec<_> = s3
            .filter(|(name, _)| !more.iter().any(|(other, _)| other == name))
            .chain(more.iter().copied())
            .chain([("FLUXGLOBE_STORE", "s3://fluxglobe/prefix")])
            .collect();
        unreachable(folder.path(), &given)
    };
    let wrong = settings(&servers, &[("AWS_SECRET_ACCESS_KEY", "hush")]);
    servers.stop_one("s3").unwrap();
    servers.tell("FLUXGLOBE_S3_READ_ONLY", "true");
    servers.start_one("s3").unwrap();
    let read_only = settings(&servers, &[]);
    for service in SERVICES {
        for settings in [&wrong, &read_only] {
            let talk = refused_start(folder.path(), service, settings);
            assert!(
                talk.contains("cannot store in") && talk.contains("no permission to write"),
                "{service}: {talk}"
            );
            assert!(!talk.contains("hush"), "{service}: {talk}");
        }
    }
    let stored = super::files_below(&buckets.join("fluxglobe"));
    assert!(stored.is_empty(), "{stored:?}");
}
