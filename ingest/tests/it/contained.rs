//! A fault of the program itself, planted where it meets a file: it refuses the file, and the next one lands.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use contract::event::{Body, Event, RejectReason};
use contract::topic::Topic;
use ingest::{IngestService, Outcome, Progress, Stage};
use storage::log::{EmbeddedLog, EventLog};

use crate::fixture::{Place, SmallFile, events, settings};

/// Whoever is told how far ingest has come is called in the middle of the work: here it panics over one file.
struct Planted {
    stage: Stage,
    /// End of the file's name.
    file: &'static str,
    fired: AtomicU32,
}

impl Planted {
    fn at(stage: Stage) -> Self {
        Self {
            stage,
            file: "bad.nc",
            fired: AtomicU32::new(0),
        }
    }

    fn has_fired(&self) -> bool {
        self.fired.load(Ordering::SeqCst) > 0
    }
}

impl Progress for Planted {
    fn stage(&self, file: &Path, stage: Stage, _step: usize, _steps: usize) {
        if stage == self.stage && file.ends_with(self.file) {
            self.fired.fetch_add(1, Ordering::SeqCst);
            panic!("planted at {stage:?}");
        }
    }

    fn done(&self, _outcome: &Outcome) {}
}

/// Where a file meets the program, from its description to its manifest.
const STAGES: [Stage; 5] = [
    Stage::Inspect,
    Stage::Plan,
    Stage::Decode,
    Stage::Put,
    Stage::Commit,
];

/// A file that the fault is planted for, and one of the same product that comes after it.
fn files(place: &Place) -> Vec<std::path::PathBuf> {
    SmallFile::new().write_classic(&place.path("bad.nc"));
    SmallFile {
        time_unit: Some("days since 2001-03-01"),
        ..SmallFile::new()
    }
    .write_classic(&place.path("good.nc"));
    vec![place.path("bad.nc"), place.path("good.nc")]
}

fn assert_refused(reason: RejectReason, line: &str, stage: Stage) {
    assert_eq!(reason, RejectReason::Unreadable, "{line}");
    for word in ["planted at", "report it with the file"] {
        assert!(line.contains(word), "{stage:?}: {line}");
    }
}

#[tokio::test]
async fn a_panic_over_a_file_refuses_it_and_the_command_goes_on() {
    for stage in STAGES {
        let place = Place::new();
        let planted = Planted::at(stage);
        let files = files(&place);
        let landed = place.land_as(settings(), &files, &planted);
        let outcomes = landed.await.unwrap();
        assert!(planted.has_fired());
        let [
            bad @ Outcome::Rejected { reason, file, .. },
            Outcome::Landed { .. },
        ] = outcomes.as_slice()
        else {
            panic!("{stage:?}: {outcomes:?}")
        };
        assert!(file.ends_with("bad.nc"));
        assert_refused(*reason, &bad.to_string(), stage);
        assert_eq!(place.newest("fgco2").await.steps.len(), 2);
    }
}

#[tokio::test]
async fn a_panic_over_a_file_refuses_it_and_the_service_goes_on() {
    for stage in STAGES {
        let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
        let planted = Planted::at(stage);
        let service = IngestService::new(
            place.store.clone(),
            Arc::clone(&log) as Arc<dyn EventLog>,
            settings(),
        );
        service.notify(&files(&place), None, None).await.unwrap();
        let stop = async {
            let start = Instant::now();
            while log.lag(Topic::GranuleNotice, "ingest").await.unwrap() > 0 {
                assert!(start.elapsed() < Duration::from_mins(2), "{stage:?}");
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        };
        service.run(&planted, stop).await.unwrap();
        assert!(planted.has_fired());
        let refused: Vec<Event> = events(log.as_ref(), Topic::GranuleRejected).await;
        let [
            Event {
                body:
                    Body::GranuleRejected {
                        path,
                        reason,
                        detail,
                        origin,
                        ..
                    },
                ..
            },
        ] = refused.as_slice()
        else {
            panic!("{stage:?}: {refused:?}")
        };
        assert!(path.ends_with("bad.nc") && origin.is_some());
        assert_refused(*reason, detail, stage);
        let landed = events(log.as_ref(), Topic::GranuleLanded).await;
        assert_eq!(landed.len(), 1, "{stage:?}");
        assert_eq!(place.newest("fgco2").await.steps.len(), 2);
    }
}
