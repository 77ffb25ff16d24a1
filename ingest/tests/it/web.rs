//! Files of web addresses: fetched from where a notice may lead, and from nowhere else.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use contract::digest::Digest;
use contract::event::RejectReason;
use contract::topic::Topic;
use ingest::{IngestService, Outcome, Settings};
use storage::log::{EmbeddedLog, EventLog};

use crate::fixture::{Place, SmallFile, events};
use crate::guarded::{guarded, notice, outcome_of, refused};
use crate::service::run_until;
use crate::web_server::{Answer, WebServer};

fn small_file(place: &Place) -> Vec<u8> {
    SmallFile::new().write_hdf5(&place.path("source.h5"));
    std::fs::read(place.path("source.h5")).unwrap()
}

/// A server whose address is allowed, and settings that allow it.
async fn allowed(place: &Place, answers: Box<crate::web_server::Answers>) -> (WebServer, Settings) {
    let server = WebServer::start(answers).await;
    let host = server.address.to_string();
    let settings = guarded(place, &["--allow-host", &host]).unwrap();
    (server, settings)
}

fn redirect(to: &str) -> Answer {
    Answer::Whole("302 Found", vec![format!("location: {to}")], vec![])
}

fn spool_is_empty(place: &Place) -> bool {
    let folders = std::fs::read_dir(place.path("spool")).unwrap();
    folders
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
        .all(|folder| std::fs::read_dir(folder).unwrap().count() == 0)
}

#[tokio::test]
async fn a_file_of_an_allowed_host_lands_and_leaves_nothing_in_the_spool() {
    let place = Place::new();
    let content = small_file(&place);
    let (sha256, size) = (Digest::of(&content), content.len() as u64);
    let (server, settings) = allowed(
        &place,
        Box::new(move |_| Answer::Whole("200 OK", vec![], content.clone())),
    )
    .await;
    let url = server.url("/x/20010101.h5?signature=hunter2");
    let outcome = outcome_of(&place, &settings, notice(&url, Some(sha256), Some(size))).await;
    assert!(matches!(outcome, Outcome::Landed { .. }), "{outcome}");
    assert!(!outcome.to_string().contains("hunter2"));
    let manifest = place.newest("fgco2").await;
    assert_eq!(manifest.steps[0].origin, "20010101.h5");
    assert!(spool_is_empty(&place));
}

/// Hosts that are inside under every name: none of these may be asked.
#[tokio::test]
async fn inner_addresses_are_refused_before_anything_is_sent() {
    let place = Place::new();
    let server = WebServer::start(Box::new(|_| Answer::Whole("200 OK", vec![], vec![]))).await;
    let port = server.address.port();
    let settings = guarded(&place, &[]).unwrap();
    for host in [
        "127.0.0.1",
        "127.1",
        "2130706433",
        "0x7f000001",
        "[::1]",
        "[::ffff:127.0.0.1]",
        "0.0.0.0",
        "localhost",
        "LOCALHOST.",
        "any.localhost",
        "169.254.169.254",
        "10.0.0.1",
        "192.168.0.1",
        "100.100.100.200",
        "[fd00::1]",
        "[fe80::1]",
    ] {
        let url = format!("http://{host}:{port}/a.nc");
        let (reason, line) = refused(&place, &settings, &url).await;
        assert_eq!(reason, RejectReason::Location, "{line}");
        assert!(line.contains("--allow-host"), "{line}");
    }
    assert!(server.asked().is_empty(), "{:?}", server.asked());
}

/// A name whose address is found out by asking: this machine's own, or the one that every machine has.
#[tokio::test]
async fn a_name_that_resolves_to_an_inner_address_is_refused() {
    let place = Place::new();
    let server = WebServer::start(Box::new(|_| Answer::Whole("200 OK", vec![], vec![]))).await;
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    let name = match tokio::net::lookup_host((name.trim(), 0)).await {
        Ok(_addresses) => name.trim(),
        Err(_unknown) => "localhost",
    };
    let settings = guarded(&place, &[]).unwrap();
    let url = format!("http://{name}:{}/a.nc", server.address.port());
    let (reason, line) = refused(&place, &settings, &url).await;
    assert_eq!(reason, RejectReason::Location, "{line}");
    assert!(server.asked().is_empty());
}

#[tokio::test]
async fn another_port_of_an_allowed_host_is_not_allowed() {
    let place = Place::new();
    let other = WebServer::start(Box::new(|_| Answer::Whole("200 OK", vec![], vec![]))).await;
    let (_server, settings) = allowed(
        &place,
        Box::new(|_| Answer::Whole("200 OK", vec![], vec![])),
    )
    .await;
    let (reason, _) = refused(&place, &settings, &other.url("/a.nc")).await;
    assert_eq!(reason, RejectReason::Location);
    assert!(other.asked().is_empty());
}

#[tokio::test]
async fn a_redirect_to_an_inner_address_is_refused() {
    let place = Place::new();
    let inner = WebServer::start(Box::new(|_| Answer::Whole("200 OK", vec![], vec![]))).await;
    let port = inner.address.port();
    let targets = [
        format!("http://127.0.0.1:{port}/"),
        format!("http://localhost:{port}/"),
        format!("//127.0.0.1:{port}/"),
        "http://169.254.169.254/latest/meta-data/".to_owned(),
        "file:///etc/passwd".to_owned(),
        "gopher://127.0.0.1/".to_owned(),
    ];
    for target in targets {
        let to = target.clone();
        let (server, settings) = allowed(&place, Box::new(move |_| redirect(&to))).await;
        let (reason, line) = refused(&place, &settings, &server.url("/a.nc")).await;
        assert_eq!(reason, RejectReason::Location, "{target}: {line}");
        assert_eq!(server.asked(), ["/a.nc"], "the fault fired");
    }
    assert!(inner.asked().is_empty());
}

#[tokio::test]
async fn redirects_are_followed_five_times() {
    let place = Place::new();
    let content = small_file(&place);
    let answers = move |path: &str| match path.trim_start_matches('/').parse::<u32>() {
        Ok(0) | Err(_) => Answer::Whole("200 OK", vec![], content.clone()),
        Ok(left) => redirect(&format!("/{}", left - 1)),
    };
    let (server, settings) = allowed(&place, Box::new(answers)).await;
    let outcome = outcome_of(&place, &settings, notice(&server.url("/5"), None, None)).await;
    assert!(matches!(outcome, Outcome::Landed { .. }), "{outcome}");
    let (reason, line) = refused(&place, &settings, &server.url("/6")).await;
    assert_eq!(reason, RejectReason::Location);
    assert!(line.contains("more than 5 redirects"), "{line}");
}

#[tokio::test]
async fn a_source_that_says_no_is_asked_again_and_given_up() {
    let place = Place::new();
    let (server, settings) = allowed(
        &place,
        Box::new(|_| Answer::Whole("404 Not Found", vec![], vec![])),
    )
    .await;
    let (reason, line) = refused(&place, &settings, &server.url("/a.nc?key=hunter2")).await;
    assert_eq!(reason, RejectReason::Unavailable);
    assert!(line.contains("404") && !line.contains("hunter2"), "{line}");
    assert_eq!(server.asked().len(), 2, "--fetch-tries");
}

/// Out of order twice, then half an answer, then the file.
#[tokio::test]
async fn a_source_that_comes_back_gives_its_file() {
    let place = Place::new();
    let content = small_file(&place);
    let count = Arc::new(AtomicU32::new(0));
    let seen = Arc::clone(&count);
    let answers = move |_: &str| match seen.fetch_add(1, Ordering::SeqCst) {
        0 => Answer::Whole("503 Service Unavailable", vec![], vec![]),
        1 => Answer::Half(content.clone()),
        _ => Answer::Whole("200 OK", vec![], content.clone()),
    };
    let server = WebServer::start(Box::new(answers)).await;
    let host = server.address.to_string();
    let flags = ["--allow-host", &host, "--fetch-retry-s", "60"];
    let settings = guarded(&place, &flags).unwrap();
    let outcome = outcome_of(&place, &settings, notice(&server.url("/a.h5"), None, None)).await;
    assert!(matches!(outcome, Outcome::Landed { .. }), "{outcome}");
    assert_eq!(count.load(Ordering::SeqCst), 3, "the faults fired");
    assert!(spool_is_empty(&place));
}

#[tokio::test]
async fn a_server_that_is_not_there_is_given_up_at_its_limit() {
    let place = Place::new();
    let settings = guarded(&place, &["--allow-host", "127.0.0.1"]).unwrap();
    let (reason, line) = refused(&place, &settings, "http://127.0.0.1:9/a.nc").await;
    assert_eq!(reason, RejectReason::Unavailable, "{line}");
}

#[tokio::test]
async fn a_file_larger_than_allowed_or_announced_is_cut_off() {
    let place = Place::new();
    let large = vec![0; 3 << 20];
    let sized = large.clone();
    let (server, mut settings) = allowed(
        &place,
        Box::new(move |_| Answer::Whole("200 OK", vec![], sized.clone())),
    )
    .await;
    settings.limits.file_bytes = 1 << 20;
    let (reason, line) = refused(&place, &settings, &server.url("/a.nc")).await;
    assert_eq!(reason, RejectReason::TooLarge, "{line}");
    // Without a length, in one chunk of 3 MiB.
    let mut chunked = format!("{:x}\r\n", large.len()).into_bytes();
    chunked.extend_from_slice(&large);
    chunked.extend_from_slice(b"\r\n0\r\n\r\n");
    let headers = || vec!["transfer-encoding: chunked".to_owned()];
    let (server, mut settings) = allowed(
        &place,
        Box::new(move |_| Answer::Whole("200 OK", headers(), chunked.clone())),
    )
    .await;
    settings.limits.file_bytes = 1 << 20;
    let (reason, line) = refused(&place, &settings, &server.url("/a.nc")).await;
    assert_eq!(reason, RejectReason::TooLarge, "{line}");
    settings.limits.file_bytes = 1 << 30;
    let outcome = outcome_of(
        &place,
        &settings,
        notice(&server.url("/a.nc"), None, Some(5)),
    )
    .await;
    let Outcome::Rejected { reason, .. } = outcome else {
        panic!("{outcome}")
    };
    assert_eq!(reason, RejectReason::Checksum);
    assert!(spool_is_empty(&place));
}

/// A notification of another system, from the topic to the landed event.
#[tokio::test]
async fn a_cloud_notification_lands_its_data_file() {
    let place = Place::new();
    let content = small_file(&place);
    let size = content.len();
    let sha256 = Digest::of(&content).to_string();
    let (server, settings) = allowed(
        &place,
        Box::new(move |_| Answer::Whole("200 OK", vec![], content.clone())),
    )
    .await;
    let message = serde_json::json!({
        "version": "1.6.1", "provider": "P", "collection": "C", "identifier": "granule-7",
        "submissionTime": "2020-01-01T00:00:00Z",
        "product": {"name": "g", "dataVersion": "1", "files": [
            {"type": "data", "uri": server.url("/a.h5"), "name": "a.h5", "checksumType": "SHA256", "checksum": sha256, "size": size},
            {"type": "metadata", "uri": server.url("/a.xml"), "name": "a.xml", "size": 1}]}
    });
    let log = Arc::new(EmbeddedLog::memory());
    let content = bytes::Bytes::from(message.to_string());
    log.append_message(Topic::GranuleNotice, "k", content)
        .await
        .unwrap();
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings,
    );
    let landed = run_until(&service, log.as_ref(), Topic::GranuleLanded, 1).await;
    assert_eq!(landed.len(), 1);
    assert_eq!(landed[0].trace, "granule-7");
    assert_eq!(landed[0].noticed, Some("2020-01-01".parse().unwrap()));
    assert_eq!(server.asked(), ["/a.h5"], "the data file alone");
    assert!(
        events(log.as_ref(), Topic::GranuleRejected)
            .await
            .is_empty()
    );
}

/// A server that does not say how much it sends is given room for all that is allowed: that is never more than there is.
#[tokio::test]
async fn a_file_of_unknown_size_lands_where_the_spool_is_no_multiple_of_its_unit() {
    const SPOOL_BYTES: usize = (1 << 20) + 1000;
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("source.nc"));
    let mut content = std::fs::read(place.path("source.nc")).unwrap();
    content.resize(SPOOL_BYTES, 0);
    let unsized_answer = move |path: &str| {
        let more = usize::from(path.contains("larger"));
        let body = [content.as_slice(), &vec![0; more]].concat();
        let chunk = [
            format!("{:x}\r\n", body.len()).as_bytes(),
            &body,
            b"\r\n0\r\n\r\n",
        ]
        .concat();
        let headers = vec!["transfer-encoding: chunked".to_owned()];
        Answer::Whole("200 OK", headers, chunk)
    };
    let server = WebServer::start(Box::new(unsized_answer)).await;
    let (host, spool) = (server.address.to_string(), SPOOL_BYTES.to_string());
    let settings = guarded(&place, &["--allow-host", &host, "--spool-bytes", &spool]).unwrap();
    let limit = std::time::Duration::from_mins(2);
    let asked = notice(&server.url("/full.nc"), None, None);
    let ended = tokio::time::timeout(limit, outcome_of(&place, &settings, asked)).await;
    let outcome = ended.expect("it waits for ever");
    assert!(matches!(outcome, Outcome::Landed { .. }), "{outcome}");
    let url = server.url("/larger.nc");
    let larger = refused(&place, &settings, &url);
    let (reason, line) = tokio::time::timeout(limit, larger)
        .await
        .expect("it waits for ever");
    assert_eq!(reason, RejectReason::TooLarge, "{line}");
    assert!(line.contains(&spool), "{line}");
    assert!(spool_is_empty(&place));
}
