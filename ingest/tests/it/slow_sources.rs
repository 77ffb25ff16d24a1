//! Sources that trickle or never answer: they hold up their own files, for a while, and no others.

use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::event::RejectReason;
use contract::topic::Topic;
use ingest::{IngestService, Quiet};
use storage::log::{EmbeddedLog, EventLog};

use crate::fixture::{Place, SmallFile};
use crate::guarded::{guarded, notice, refused};
use crate::web_server::{Answer, WebServer};

/// Notices of sources that do not give their files, more than may be under way at once; the last one is of a sound source.
const SLOW: usize = 12;
const PARALLEL_NOTICES: usize = 4;

#[tokio::test]
async fn a_file_of_a_sound_source_lands_while_others_trickle_and_are_silent() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_hdf5(&place.path("source.h5"));
    let content = std::fs::read(place.path("source.h5")).unwrap();
    let trickling = WebServer::start(Box::new(|_| Answer::Trickle)).await;
    let silent = WebServer::start(Box::new(|_| Answer::Silence)).await;
    let sound = Box::new(move |_: &str| Answer::Whole("200 OK", vec![], content.clone()));
    let sound = WebServer::start(sound).await;
    let slow = |index: usize| {
        let server = if index.is_multiple_of(3) {
            &silent
        } else {
            &trickling
        };
        notice(&server.url(&format!("/{index}.h5")), None, None)
    };
    let mut notices: Vec<_> = (0..SLOW).map(slow).collect();
    notices.push(notice(&sound.url("/a.h5"), None, None));
    log.append(&notices).await.unwrap();
    // Longer than this test waits: none of them is given up meanwhile.
    let flags = [
        "--allow-host",
        "127.0.0.1",
        "--fetch-silence-s",
        "600",
        "--fetch-slowest-bytes-s",
        "0",
    ];
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        guarded(&place, &flags).unwrap(),
    )
    .with_bounds(PARALLEL_NOTICES, Duration::ZERO);
    let product = "fgco2".parse().unwrap();
    let stop = async {
        let start = Instant::now();
        let newest = async || storage::manifests::latest(&place.store, &product).await;
        while newest().await.unwrap().is_none() {
            assert!(
                start.elapsed() < Duration::from_mins(2),
                "the sound file waits for the others"
            );
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        let lag = log.lag(Topic::GranuleNotice, "ingest").await.unwrap();
        assert_eq!(lag, SLOW as u64 + 1, "the offset waits for the slow ones");
    };
    service.run(&Quiet, stop).await.unwrap();
    assert!(!trickling.asked().is_empty() && !silent.asked().is_empty());
    let asked_at_once = trickling.asked().len();
    assert!(asked_at_once <= 4, "{asked_at_once} of one source");
}

#[tokio::test]
async fn a_source_that_trickles_or_is_silent_is_given_up() {
    let place = Place::new();
    let trickling = WebServer::start(Box::new(|_| Answer::Trickle)).await;
    let silent = WebServer::start(Box::new(|_| Answer::Silence)).await;
    let flags = ["--allow-host", "127.0.0.1", "--fetch-silence-s", "1"];
    let settings = guarded(&place, &flags).unwrap();
    for (server, words) in [(trickling, "bytes came in"), (silent, "no answer in 1 s")] {
        let url = server.url("/a.h5");
        let refused = refused(&place, &settings, &url);
        let refused = tokio::time::timeout(Duration::from_mins(2), refused).await;
        let (reason, line) = refused.expect("it is waited for without end");
        assert_eq!(reason, RejectReason::Unavailable, "{line}");
        assert!(line.contains(words), "{line}");
        assert!(!server.asked().is_empty(), "the fault fired");
    }
}
