//! The reader process as an enemy: it dies, hangs, floods, lies or is asked for what lies outside its file.

use std::time::Duration;

use contract::event::RejectReason;
use hdf5::Extent;
use ingest::{Batch, DecoderCommand, IngestError, Outcome, Quiet, Settings};

use crate::fixture::{FILL, Place, SmallFile, open_again, refusal, settings, text};

/// Settings whose reader is a shell script; the file and the limits come as its arguments.
fn scripted(script: &str) -> Settings {
    let program = "/bin/sh".into();
    let arguments = vec!["-c".into(), script.into()];
    Settings {
        decoder: DecoderCommand { program, arguments },
        ..settings()
    }
}

async fn land(place: &Place, settings: &Settings, name: &str) -> Result<Vec<Outcome>, IngestError> {
    let batch = Batch {
        files: vec![place.path(name)],
        ..Batch::default()
    };
    ingest::land_files(&place.store, &place.log, settings, batch, &Quiet).await
}

async fn refused_by(script: &str) -> (RejectReason, String) {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    refusal(&land(&place, &scripted(script), "a.nc").await.unwrap())
}

#[tokio::test]
async fn a_reader_that_dies_refuses_its_file() {
    let (reason, line) = refused_by("kill -SEGV $$").await;
    assert_eq!(reason, RejectReason::Corrupt);
    assert!(line.contains("signal 11"), "{line}");
}

#[tokio::test]
async fn a_reader_that_hangs_is_killed() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    let mut settings = scripted("sleep 60");
    settings.limits.wall = Duration::from_millis(300);
    let start = std::time::Instant::now();
    let (reason, line) = refusal(&land(&place, &settings, "a.nc").await.unwrap());
    assert_eq!(reason, RejectReason::TooLarge);
    assert!(line.contains("was not read within"), "{line}");
    assert!(start.elapsed() < Duration::from_secs(10));
}

#[tokio::test]
async fn a_reader_out_of_processor_time_says_too_large() {
    let (reason, line) = refused_by("ulimit -S -t 1; while :; do :; done").await;
    assert_eq!(reason, RejectReason::TooLarge);
    assert!(line.contains("processor time"), "{line}");
}

#[tokio::test]
async fn a_reader_that_floods_or_lies_is_not_believed() {
    for script in [
        "yes",
        "head -c 100000 /dev/zero",
        "printf '\\005\\000\\000\\000hello'",
    ] {
        let (reason, line) = refused_by(script).await;
        assert_eq!(reason, RejectReason::Corrupt, "{script}: {line}");
    }
}

/// A reader that somebody else kills is started again; if it dies again and again the file is refused and not the others.
#[tokio::test]
async fn a_reader_that_is_killed_is_started_again() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    let counter = place.path("starts");
    let script = format!("echo x >> {}; kill -KILL $$", counter.display());
    let outcomes = land(&place, &scripted(&script), "a.nc").await.unwrap();
    let (reason, line) = refusal(&outcomes);
    assert_eq!(reason, RejectReason::TooLarge);
    assert!(line.contains("killed again and again"), "{line}");
    let starts = std::fs::read_to_string(counter).unwrap();
    assert_eq!(starts.lines().count(), 3);
}

/// The reader has no environment but the switch that keeps the HDF5 library from loading plugins.
#[tokio::test]
async fn a_reader_has_plugins_switched_off_and_no_environment() {
    let script = "[ \"$HDF5_PLUGIN_PRELOAD\" = '::' ] && [ -z \"$HOME\" ] && exit 3; exit 4";
    let (_, line) = refused_by(script).await;
    assert!(line.contains("exit status: 3"), "{line}");
}

/// No reader at all is a fault of the installation, not of the file.
#[tokio::test]
async fn a_missing_reader_stops_the_program() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    let mut settings = settings();
    settings.decoder.program = place.path("nothing-here");
    let error = land(&place, &settings, "a.nc").await.unwrap_err();
    assert!(
        matches!(error, IngestError::Spawn { .. }) && !error.is_retryable(),
        "{error}"
    );
}

/// An HDF5 file may name other files for its values: they are not opened.
#[tokio::test]
async fn values_in_other_files_are_not_read() {
    let place = Place::new();
    let mut file = SmallFile::new().first_month();
    file.name = "elsewhere";
    file.write_hdf5(&place.path("b.h5"));
    std::fs::write(place.path("secret"), [0x40u8; 128]).unwrap();
    let open = open_again(&place.path("b.h5"));
    let secret = place.path("secret");
    let dataset = open
        .new_dataset::<f32>()
        .external(secret.to_str().unwrap(), 0, 128)
        .shape([1, 4, 8])
        .create("fgco2")
        .unwrap();
    text(&dataset, "units", "g C m-2 month-1");
    text(
        &dataset,
        "standard_name",
        "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon",
    );
    drop(dataset); // else the library keeps the file open past its close
    open.unlink("elsewhere").unwrap();
    open.close().unwrap();
    let (reason, line) = refusal(&place.land(&[place.path("b.h5")]).await);
    assert_eq!(reason, RejectReason::Corrupt, "{line}");
    assert!(line.contains("other files"), "{line}");
}

/// A link to a variable of another file is not followed.
#[tokio::test]
async fn links_to_other_files_are_not_followed() {
    let place = Place::new();
    SmallFile::new().write_hdf5(&place.path("target.h5"));
    let file = hdf5::File::create(place.path("link.h5")).unwrap();
    let target = place.path("target.h5");
    for name in ["fgco2", "lat", "lon", "time"] {
        file.link_external(target.to_str().unwrap(), name, name)
            .unwrap();
    }
    file.close().unwrap();
    let (reason, line) = refusal(&place.land(&[place.path("link.h5")]).await);
    assert_eq!(reason, RejectReason::NoVariable, "{line}");
}

/// The library holds a chunk in memory whole, however little of it is in the map.
#[tokio::test]
async fn a_huge_chunk_is_refused_before_it_is_read() {
    let place = Place::new();
    let mut file = SmallFile::new();
    file.name = "small";
    file.write_hdf5(&place.path("chunk.h5"));
    let open = open_again(&place.path("chunk.h5"));
    let dataset = open
        .new_dataset::<f32>()
        .chunk([1, 30_000, 30_000])
        .fill_value(FILL)
        .shape([
            Extent::resizable(2),
            Extent::resizable(4),
            Extent::resizable(8),
        ])
        .create("fgco2")
        .unwrap();
    text(&dataset, "units", "g C m-2 month-1");
    text(
        &dataset,
        "standard_name",
        "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon",
    );
    drop(dataset);
    open.unlink("small").unwrap();
    open.close().unwrap();
    let (reason, line) = refusal(&place.land(&[place.path("chunk.h5")]).await);
    assert_eq!(reason, RejectReason::TooLarge, "{line}");
    assert!(
        line.contains("fgco2") && line.contains("900000000"),
        "{line}"
    );
}
