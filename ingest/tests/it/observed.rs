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
/// Lines of a file that takes far longer to read.
const MANY_LINES: usize = 20_000;

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
        let stop = all_finished(Arc::clone(&self.log));
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

/// Until no notice is left.
async fn all_finished(log: Arc<EmbeddedLog>) {
    let start = Instant::now();
    while log.lag(Topic::GranuleNotice, "ingest").await.unwrap() > 0 {
        assert!(start.elapsed() < Duration::from_mins(2));
        tokio::time::sleep(Duration::from_millis(20)).await;
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

/// Minutes of a buoy from the first of January on.
fn write_minutes(place: &Place, name: &str, lines: usize) -> PathBuf {
    let line = |minute: usize| {
        let (day, hour, minute) = (minute / 1440 + 1, minute / 60 % 24, minute % 60);
        format!("2012 01 {day:02} {hour:02} {minute:02}  5.5   6.1\n")
    };
    let lines: String = (0..lines).map(line).collect();
    std::fs::create_dir_all(place.path(name)).unwrap();
    let path = place.path(name).join("44005h2012.txt");
    std::fs::write(&path, format!("#YY  MM DD hh mm WSPD  ATMP\n{lines}")).unwrap();
    path
}

/// Notes how many observations it is given each time.
#[derive(Default)]
struct Counted(Mutex<Vec<usize>>);

#[async_trait]
impl ObservationSink for Counted {
    async fn put(&self, observations: Vec<Observation>) -> Result<Stored, SinkError> {
        self.0.lock().unwrap().push(observations.len());
        Ok(Stored::default())
    }
}

/// A file that was offered first is stored first, however long it takes to read: what a later one says of the same stays.
#[tokio::test]
async fn observations_are_stored_in_the_order_in_which_their_files_were_offered() {
    let place = Place::new();
    let files = [("first", MANY_LINES), ("second", LINES)]
        .map(|(name, lines)| write_minutes(&place, name, lines));
    // A service keeps the order of what is named the same.
    for dataset in [None, Some("buoys".parse().unwrap())] {
        let (counted, log) = (
            Arc::new(Counted::default()),
            Arc::new(EmbeddedLog::memory()),
        );
        let service = IngestService::new(
            place.store.clone(),
            Arc::clone(&log) as Arc<dyn EventLog>,
            settings(),
        )
        .with_observations(Arc::clone(&counted) as Arc<dyn ObservationSink>);
        service
            .notify(&files, None, dataset.as_ref())
            .await
            .unwrap();
        if dataset.is_some() {
            service
                .run(&Quiet, all_finished(Arc::clone(&log)))
                .await
                .unwrap();
        } else {
            assert_eq!(service.drain(&Quiet).await.unwrap().len(), 2);
        }
        let counts = counted.0.lock().unwrap().clone();
        assert_eq!(counts, [2 * MANY_LINES, 2 * LINES], "{dataset:?}");
    }
}
