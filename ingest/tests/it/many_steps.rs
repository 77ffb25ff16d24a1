//! A file of more steps than an event can list: its event stays within what the event log takes. What is done about as
//! many steps as a file may have without reading them is tested where it is done (`commit::merge`, `contract::event`).

use std::path::Path;
use std::sync::Arc;

use contract::event::{Body, MAX_EVENT_BYTES, RejectReason};
use contract::time::Period;
use contract::topic::Topic;
use ingest::{IngestService, Outcome, Quiet};
use storage::log::{EmbeddedLog, EventLog as _};

use crate::fixture::{Place, SmallFile, events, refusal, settings};

/// A period takes 62 bytes of an event: these are more than one may have, by a fifth.
const STEPS: usize = 20_000;
const HOUR_MS: i64 = 3_600_000;
const LAT: [f64; 2] = [45.0, -45.0];
const LON: [f64; 4] = [-135.0, -45.0, 45.0, 135.0];

/// Hourly maps of eight cells from 2001 on.
fn write(path: &Path) {
    let mut set = netcdf3::DataSet::new();
    set.add_global_attr_string("time_coverage_resolution", "PT1H")
        .unwrap();
    set.set_unlimited_dim("time", STEPS).unwrap();
    set.add_fixed_dim("lat", LAT.len()).unwrap();
    set.add_fixed_dim("lon", LON.len()).unwrap();
    for (name, unit) in [
        ("lat", "degrees_north"),
        ("lon", "degrees_east"),
        ("time", "hours since 2001-01-01"),
    ] {
        set.add_var_f64(name, &[name]).unwrap();
        set.add_var_attr_string(name, "units", unit).unwrap();
    }
    set.add_var_f32("fgco2", &["time", "lat", "lon"]).unwrap();
    let standard_name = "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon";
    for (name, value) in [
        ("units", "g C m-2 month-1"),
        ("standard_name", standard_name),
    ] {
        set.add_var_attr_string("fgco2", name, value).unwrap();
    }
    let hours: Vec<f64> = (0..STEPS).map(|hour| hour as f64).collect();
    let cells = LAT.len() * LON.len();
    let value = |index: usize| (index / cells % 1000 + index % cells) as f32 / 100.0;
    let values: Vec<f32> = (0..STEPS * cells).map(value).collect();
    let mut writer = netcdf3::FileWriter::open(path).unwrap();
    writer.set_def(&set, netcdf3::Version::Classic, 0).unwrap();
    writer.write_var_f64("lat", &LAT).unwrap();
    writer.write_var_f64("lon", &LON).unwrap();
    writer.write_var_f64("time", &hours).unwrap();
    writer.write_var_f32("fgco2", &values).unwrap();
    writer.close().unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_of_more_steps_than_an_event_can_list_lands_and_is_told_in_a_bounded_event() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    write(&place.path("hourly.nc"));
    let mut settings = settings();
    // As the service has them: those of the fixture are for small files.
    settings.limits.cpu_s = 600;
    settings.limits.wall = std::time::Duration::from_mins(30);
    let service = IngestService::new(place.store.clone(), Arc::clone(&log) as _, settings);
    let mut outcomes = vec![];
    for _ in 0..2 {
        let file = [place.path("hourly.nc")];
        service.notify(&file, None, None).await.unwrap();
        outcomes.extend(service.drain(&Quiet).await.unwrap());
    }
    assert!(
        matches!(&outcomes[0], Outcome::Landed { periods, .. } if periods.len() == STEPS),
        "{}",
        outcomes[0]
    );
    assert!(!outcomes[1].is_rejected(), "{}", outcomes[1]);
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
    assert!(
        events(log.as_ref(), Topic::GranuleRejected)
            .await
            .is_empty()
    );
    let manifest = place.newest("fgco2").await;
    assert_eq!((manifest.number, manifest.steps.len()), (1, STEPS));

    let landed = events(log.as_ref(), Topic::GranuleLanded).await;
    assert_eq!(landed.len(), 1, "the second notice is a duplicate");
    assert!(landed[0].to_json().len() < MAX_EVENT_BYTES / 100);
    let first = manifest.steps[0].period.start;
    let whole = Period {
        start: first,
        end: contract::time::TimeMs::new(first.ms() + STEPS as i64 * HOUR_MS).unwrap(),
    };
    let Body::GranuleLanded {
        periods,
        step_count,
        manifest: id,
        ..
    } = &landed[0].body
    else {
        panic!("{landed:?}")
    };
    assert_eq!(
        (periods.as_slice(), *step_count),
        (&[whole][..], Some(STEPS as u64))
    );
    assert_eq!(*id, manifest.id());
}

#[tokio::test]
async fn a_file_of_one_step_more_than_a_file_may_have_is_refused() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("two.nc"));
    let mut settings = settings();
    settings.limits.steps = 1;
    let files = [place.path("two.nc")];
    let landed = place.land_as(settings, &files, &Quiet);
    let (reason, line) = refusal(&landed.await.unwrap());
    assert_eq!(reason, RejectReason::TooLarge, "{line}");
    assert!(line.contains("2 steps, 1 to 1"), "{line}");
}
