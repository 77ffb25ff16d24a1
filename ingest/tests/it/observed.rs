//! Files of observations through the service: what is no observation is counted, and told wherever people look.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use async_trait::async_trait;
use contract::event::{Body, RejectReason};
use contract::observation::Observation;
use contract::topic::Topic;
use ingest::observation::{ObservationSink, SinkCause, SinkError, Stored, notes};
use ingest::{IngestService, Metrics, Quiet};
use prometheus::Registry;
use storage::log::{EmbeddedLog, EventLog};

use crate::fixture::{Place, events, settings};

const LINES: usize = 100;

/// Hours of a buoy, of which the first ones have an air temperature that no air has.
fn write(place: &Place, name: &str, hot: usize) -> PathBuf {
    let line = |hour: usize| {
        let air_c = if hour < hot { "87.5" } else { " 6.1" };
        let (day, hour) = (hour / 24 + 1, hour % 24);
        format!("2012 01 {day:02} {hour:02} 50  5.5  {air_c}\n")
    };
    let lines: String = (0..LINES).map(line).collect();
    let text = format!("#YY  MM DD hh mm WSPD  ATMP\n{lines}");
    std::fs::create_dir_all(place.path(name)).unwrap();
    let path = place.path(name).join("44005h2012.txt");
    std::fs::write(&path, text).unwrap();
    path
}

/// Keeps observations, unless there is a cause not to.
#[derive(Default)]
struct Kept(Mutex<Vec<Observation>>, Option<SinkCause>);

#[async_trait]
impl ObservationSink for Kept {
    async fn put(&self, observations: Vec<Observation>) -> Result<Stored, SinkError> {
        if let Some(cause) = self.1 {
            let source = "numeric field overflow".into();
            return Err(SinkError { source, cause });
        }
        let mut kept = self.0.lock().unwrap();
        let mut stored = Stored::default();
        for new in observations {
            if kept.contains(&new) {
                stored.same += 1;
            } else {
                stored.new += 1;
                kept.push(new);
            }
        }
        Ok(stored)
    }
}

struct Station {
    place: Place,
    log: Arc<EmbeddedLog>,
    kept: Arc<Kept>,
    registry: Registry,
    service: IngestService,
}

impl Station {
    fn new() -> Self {
        Self::with(Kept::default())
    }

    fn with(kept: Kept) -> Self {
        let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
        let (kept, registry) = (Arc::new(kept), Registry::new());
        let service = IngestService::new(
            place.store.clone(),
            Arc::clone(&log) as Arc<dyn EventLog>,
            settings(),
        )
        .with_metrics(Metrics::register(&registry).unwrap())
        .with_observations(Arc::clone(&kept) as Arc<dyn ObservationSink>);
        Self {
            place,
            log,
            kept,
            registry,
            service,
        }
    }

    /// Works until all notices are finished.
    async fn land(&self, file: PathBuf) {
        self.service.notify(&[file], None, None).await.unwrap();
        let log = Arc::clone(&self.log);
        let stop = async move {
            let start = Instant::now();
            while log.lag(Topic::GranuleNotice, "ingest").await.unwrap() > 0 {
                assert!(start.elapsed() < Duration::from_mins(2));
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        };
        self.service.run(&Quiet, stop).await.unwrap();
    }

    /// The metric of a reason; none before it was counted.
    fn counted(&self, reason: &str) -> Option<f64> {
        let families = self.registry.gather();
        let family = families
            .iter()
            .find(|f| f.name() == "fluxglobe_ingestd_masked_cells_total")?;
        let is_it = |metric: &&prometheus::proto::Metric| {
            let wanted = [("product", "ndbc"), ("reason", reason)];
            wanted.iter().all(|(name, value)| {
                let mut labels = metric.get_label().iter();
                labels.any(|label| label.name() == *name && label.value() == *value)
            })
        };
        let metric = family.get_metric().iter().find(is_it)?;
        Some(metric.get_counter().get_value())
    }
}

#[tokio::test]
async fn what_is_no_observation_is_counted_once_and_kept_with_its_file() {
    let station = Station::new();
    let file = write(&station.place, "a", 3);
    for _ in 0..2 {
        station.land(file.clone()).await;
        assert_eq!(station.kept.0.lock().unwrap().len(), 2 * LINES - 3);
        assert_eq!(station.counted("implausible"), Some(3.0));
        assert_eq!(station.counted("out_of_range"), Some(0.0));
        let noted = notes(&station.place.store).await.unwrap();
        let [(dataset, notes)] = noted.as_slice() else {
            panic!("{noted:?}")
        };
        assert_eq!((dataset.as_str(), notes.len()), ("ndbc", 1));
        assert_eq!(notes[0].file, "44005h2012.txt");
        assert_eq!(notes[0].observations, 2 * LINES as u64 - 3);
        assert_eq!(notes[0].masked.implausible, 3);
    }
}

#[tokio::test]
async fn a_file_of_which_much_cannot_be_true_is_refused_and_nothing_of_it_is_kept() {
    let station = Station::new();
    station
        .land(write(&station.place, "a", LINES / 20 + 1))
        .await;
    let refused = events(station.log.as_ref(), Topic::GranuleRejected).await;
    let [event] = refused.as_slice() else {
        panic!("{refused:?}")
    };
    let Body::GranuleRejected { reason, detail, .. } = &event.body else {
        panic!("{event:?}")
    };
    assert_eq!(*reason, RejectReason::Values);
    assert!(
        detail.starts_with("air_temperature: has 6 of 100"),
        "{detail}"
    );
    assert!(station.kept.0.lock().unwrap().is_empty());
    assert_eq!(notes(&station.place.store).await.unwrap(), vec![]);
}

/// What the store can never take is not tried for ever: the file is refused and the next one is stored.
#[tokio::test]
async fn observations_that_can_never_be_stored_refuse_their_file() {
    let cause = Some(SinkCause::Observations);
    let station = Station::with(Kept(Mutex::default(), cause));
    station.land(write(&station.place, "a", 0)).await;
    let refused = events(station.log.as_ref(), Topic::GranuleRejected).await;
    let [event] = refused.as_slice() else {
        panic!("{refused:?}")
    };
    let Body::GranuleRejected { detail, .. } = &event.body else {
        panic!("{event:?}")
    };
    assert!(detail.contains("numeric field overflow"), "{detail}");
    assert_eq!(notes(&station.place.store).await.unwrap(), vec![]);
}
