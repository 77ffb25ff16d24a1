//! The reader process as an enemy: it dies, hangs, floods, lies or is asked for what lies outside its file.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use contract::event::RejectReason;
use contract::topic::Topic;
use hdf5::Extent;
use ingest::{
    DecoderCommand, IngestError, IngestService, Outcome, Progress, Quiet, Settings, Stage,
};
use storage::log::{EmbeddedLog, EventLog};

use crate::fixture::{FILL, Place, SmallFile, open_again, refusal, settings, text};

/// Settings whose reader is a shell script; the file and the limits come as its arguments.
fn scripted(script: &str) -> Settings {
    let program = "/bin/sh".into();
    let arguments = vec!["-c".into(), script.into()];
    let mut settings = Settings {
        decoder: DecoderCommand { program, arguments },
        ..settings()
    };
    // Where processor time is the limit, a busy machine may take long to give it.
    settings.limits.wall = Duration::from_mins(10);
    settings
}

async fn land(place: &Place, settings: &Settings, name: &str) -> Result<Vec<Outcome>, IngestError> {
    let files = [place.path(name)];
    place.land_as(settings.clone(), &files, &Quiet).await
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

/// Its end would not be told by its output, and a place for readers would be taken until the file's time is over.
#[tokio::test]
async fn a_reader_that_closes_its_output_and_goes_on_is_killed() {
    let start = std::time::Instant::now();
    let (reason, line) = refused_by("exec >&-; exec sleep 300").await;
    assert_eq!(reason, RejectReason::Corrupt);
    assert!(line.contains("close its output and go on"), "{line}");
    assert!(start.elapsed() < Duration::from_mins(1));
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

/// A file is planned from what its reader tells and from axes that are read by it: whatever these do to the library, the
/// partition goes on.
#[tokio::test]
async fn a_reader_that_dies_while_its_file_is_planned_refuses_it_and_the_next_one_lands() {
    for (end, reason) in [
        ("kill -SEGV $$", RejectReason::Corrupt),
        (
            "echo memory allocation failed >&2; exit 1",
            RejectReason::TooLarge,
        ),
        ("yes", RejectReason::Corrupt),
    ] {
        let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
        SmallFile::new().write_classic(&place.path("bad.nc"));
        SmallFile::new().write_hdf5(&place.path("good.h5"));
        let reader = env!("CARGO_BIN_EXE_decode-file");
        // It describes the file, and ends when its first axis is asked for.
        let bad = format!("{reader} \"$0\" \"$@\" </dev/null; head -c 1 >/dev/null; {end}");
        let script = format!("case \"$0\" in *bad*) {bad};; esac; exec {reader} \"$0\" \"$@\"");
        let service = IngestService::new(
            place.store.clone(),
            Arc::clone(&log) as Arc<dyn EventLog>,
            scripted(&script),
        );
        let files = [place.path("bad.nc"), place.path("good.h5")];
        service.notify(&files, None, None).await.unwrap();
        let stages = Stages::default();
        let outcomes = service.drain(&stages).await.unwrap();
        assert_eq!(refusal(&outcomes[..1]).0, reason, "{}", outcomes[0]);
        assert!(
            matches!(outcomes[1], Outcome::Landed { .. }),
            "{}",
            outcomes[1]
        );
        assert_eq!(stages.last_of("bad.nc"), Some(Stage::Plan));
        assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
    }
}

/// How far each file came.
#[derive(Default)]
struct Stages(Mutex<Vec<(PathBuf, Stage)>>);

impl Stages {
    fn last_of(&self, name: &str) -> Option<Stage> {
        let told = self.0.lock().unwrap();
        let own = told.iter().rfind(|(file, _)| file.ends_with(name));
        own.map(|(_, stage)| *stage)
    }
}

impl Progress for Stages {
    fn stage(&self, file: &Path, stage: Stage, _step: usize, _steps: usize) {
        self.0.lock().unwrap().push((file.to_owned(), stage));
    }

    fn done(&self, _outcome: &Outcome) {}
}

/// The libraries that parse files are called by the reader process alone; the other files here write one, for tests.
#[test]
fn nothing_but_the_reader_process_opens_data_files() {
    fn files(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                files(&path, found);
            } else {
                found.push(path);
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = vec![];
    files(&root, &mut found);
    let opens = |path: &PathBuf| {
        let text = std::fs::read_to_string(path).unwrap();
        ["hdf5::", "netcdf3::", "DataFile"]
            .iter()
            .any(|word| text.contains(word))
    };
    let own = |path: &PathBuf| {
        let path = path.strip_prefix(&root).unwrap();
        ["inspect/file", "inspect/reader/child.rs", "generate"]
            .iter()
            .any(|own| path.starts_with(own))
    };
    let (known, others): (Vec<_>, Vec<_>) = found.into_iter().filter(opens).partition(own);
    assert!(known.len() > 3, "{known:?}");
    assert_eq!(others, Vec::<PathBuf>::new());
}

/// What a file declares is told in a message of bounded length: a longer one is the file's fault, and not the reader's.
#[tokio::test]
async fn attributes_beyond_what_a_description_may_hold_refuse_the_file() {
    let place = Place::new();
    let mut set = netcdf3::DataSet::new();
    set.add_fixed_dim("x", 1).unwrap();
    // Each byte is six in a message.
    let text = "\u{1}".repeat(4096);
    set.add_var_i8("wordy", &["x"]).unwrap();
    for number in 0..1000 {
        let name = format!("a{number}");
        set.add_var_attr_string("wordy", &name, &text).unwrap();
    }
    let path = place.path("wordy.nc");
    let mut writer = netcdf3::FileWriter::open(&path).unwrap();
    writer.set_def(&set, netcdf3::Version::Classic, 0).unwrap();
    writer.write_var_i8("wordy", &[0]).unwrap();
    writer.close().unwrap();
    let (reason, line) = refusal(&land(&place, &settings(), "wordy.nc").await.unwrap());
    assert_eq!(reason, RejectReason::TooLarge, "{line}");
    assert!(line.contains("attributes"), "{line}");
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
