//! Nothing is masked uncounted: what a file gives a value for and what holds none is told in the line, the event, the
//! manifest and the metrics.

use std::path::PathBuf;
use std::sync::Arc;

use contract::event::{Body, Event, RejectReason};
use contract::masked::MaskedCells;
use contract::topic::Topic;
use ingest::{IngestService, Metrics, Outcome};
use prometheus::Registry;
use storage::log::{EmbeddedLog, EventLog};

use crate::fixture::{FILL, Place, SmallFile, events, open_again, refusal, settings};
use crate::made::{Made, MadeFile, Values};
use crate::service::run_until;

/// No flux is as high: 2.6e-4 kg C m-2 s-1.
const IMPLAUSIBLE: f32 = 7e8;

/// Cells of one step.
const CELLS: usize = 32;

fn write(place: &Place, name: &str, values: &[(usize, f32)]) -> PathBuf {
    let mut file = SmallFile::new();
    for (cell, value) in values {
        file.values[*cell] = *value;
    }
    let path = place.path(name);
    file.write_hdf5(&path);
    let open = open_again(&path);
    let limit = open.dataset("fgco2").unwrap().new_attr::<f32>();
    limit
        .create("valid_max")
        .unwrap()
        .write_scalar(&1e9f32)
        .unwrap();
    open.close().unwrap();
    path
}

fn masked(out_of_range: u64, implausible: u64) -> MaskedCells {
    MaskedCells {
        out_of_range,
        implausible,
        ..MaskedCells::default()
    }
}

fn told(events: &[Event]) -> Vec<MaskedCells> {
    let told = events.iter().map(|event| match &event.body {
        Body::GranuleLanded { masked, .. } => *masked,
        other => panic!("{other:?}"),
    });
    told.collect()
}

#[tokio::test]
async fn what_is_masked_is_counted_step_by_step_and_told() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    let path = write(&place, "a.h5", &[(5, IMPLAUSIBLE), (6, 2e9), (7, 3e9)]);
    let registry = Registry::new();
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings(),
    )
    .with_metrics(Metrics::register(&registry).unwrap());
    service
        .notify(std::slice::from_ref(&path), None, None)
        .await
        .unwrap();
    let landed = run_until(&service, log.as_ref(), Topic::GranuleLanded, 1).await;
    assert_eq!(told(&landed), [masked(2, 1)]);

    let manifest = place.newest("fgco2").await;
    let counted: Vec<_> = manifest
        .steps
        .iter()
        .map(|s| (s.valid_cells, s.masked))
        .collect();
    assert_eq!(
        counted,
        [(28, Some(masked(2, 1))), (31, Some(masked(0, 0)))]
    );
    let values = place.values(&manifest, 0).await;
    assert!(values[5..8].iter().all(|value| value.is_nan()));

    for (reason, count) in masked(2, 1).by_reason() {
        let all = registry.gather();
        let family = all
            .iter()
            .find(|f| f.name() == "fluxglobe_ingestd_masked_cells_total");
        let metrics = family.unwrap().get_metric();
        let has = |name: &str, value: &str, metric: &prometheus::proto::Metric| {
            let labels = metric.get_label();
            labels
                .iter()
                .any(|label| label.name() == name && label.value() == value)
        };
        let own = metrics
            .iter()
            .find(|m| has("reason", reason, m) && has("product", "fgco2", m));
        assert_eq!(
            own.unwrap().get_counter().get_value(),
            count as f64,
            "{reason}"
        );
    }

    // A file that is there says the same again.
    let again = place.land(&[path]).await;
    let [Outcome::AlreadyLanded { masked: found, .. }] = again.as_slice() else {
        panic!("{again:?}")
    };
    assert_eq!(*found, masked(2, 1));
}

#[tokio::test]
async fn the_line_of_a_file_says_what_was_masked_and_nothing_where_nothing_was() {
    let place = Place::new();
    let some = write(&place, "some.h5", &[(40, IMPLAUSIBLE)]);
    let line = place.land(&[some]).await[0].to_string();
    assert!(line.contains("; 1 value masked (1 implausible)"), "{line}");
    let none = write(&place, "none.h5", &[]);
    let line = place.land(&[none]).await[0].to_string();
    assert!(!line.contains("masked"), "{line}");
}

/// A step of which nothing is left is in no manifest: its cells are counted all the same.
#[tokio::test]
async fn a_step_that_is_masked_whole_is_counted() {
    let place = Place::new();
    let step: Vec<_> = (1..CELLS).map(|cell| (cell, 2e9)).collect();
    let path = write(&place, "first.h5", &step);
    let outcomes = place.land(&[path]).await;
    assert_eq!(
        outcomes[0].masked(),
        Some(masked(CELLS as u64 - 1, 0)),
        "{}",
        outcomes[0]
    );
    assert_eq!(place.newest("fgco2").await.steps.len(), 1);
    assert_eq!(
        told(&events(&place.log, Topic::GranuleLanded).await),
        [masked(31, 0)]
    );

    let all: Vec<_> = (0..2 * CELLS).map(|cell| (cell, 2e9)).collect();
    let path = write(&place, "all.h5", &all);
    let (reason, line) = refusal(&place.land(&[path]).await);
    assert_eq!(reason, RejectReason::Values);
    assert!(
        line.contains("64 values masked (64 outside the valid range)"),
        "{line}"
    );
}

/// They are in no manifest, so that a product begins after its file, or ends before it.
#[tokio::test]
async fn steps_without_any_value_are_told() {
    let place = Place::new();
    let mut file = SmallFile::new();
    file.values[..CELLS].fill(FILL);
    let path = place.path("first.nc");
    file.write_classic(&path);
    let outcomes = place.land(&[path]).await;
    let told = "fgco2: holds no value in 1 of 2 steps, 2001-01-01T00:00:00Z/2001-02-01T00:00:00Z, which is left out";
    let line = outcomes[0].to_string();
    assert!(line.contains(told), "{line}");
    assert_eq!(outcomes[0].masked(), Some(masked(0, 0)));
    assert_eq!(place.newest("fgco2").await.steps.len(), 1);
    let landed = events(&place.log, Topic::GranuleLanded).await;
    let Body::GranuleLanded { assumptions, .. } = &landed[0].body else {
        panic!("{landed:?}")
    };
    assert!(assumptions.iter().any(|own| own == told), "{assumptions:?}");

    let days = place.path("days.nc");
    let values = [vec![f32::NAN; 2 * CELLS], vec![20.0; CELLS]].concat();
    let file = MadeFile::sst(3).but("sst", |own| Made {
        values: Values::Floats(values),
        ..own
    });
    file.write(&days);
    let line = place.land(&[days]).await[0].to_string();
    let told = "sst: holds no value in 2 of 3 steps, which are left out; the first is 200";
    assert!(line.contains(told), "{line}");
}

/// More than one in twenty is a wrong unit or scale, and refused as ever; what the file calls empty counts for nothing.
#[tokio::test]
async fn above_the_limit_the_file_is_refused() {
    let place = Place::new();
    let one = write(&place, "one.h5", &[(1, IMPLAUSIBLE), (2, FILL), (3, FILL)]);
    let outcomes = place.land(&[one]).await;
    assert_eq!(outcomes[0].masked(), Some(masked(0, 1)), "{}", outcomes[0]);
    let two = write(&place, "two.h5", &[(1, IMPLAUSIBLE), (2, IMPLAUSIBLE)]);
    let (reason, line) = refusal(&place.land(&[two]).await);
    assert_eq!(reason, RejectReason::Values);
    assert!(line.contains("2 of 31"), "{line}");
}
