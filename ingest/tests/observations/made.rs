//! Files made here: every layout of the conventions with one truth, and ones whose parts contradict each other.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use async_trait::async_trait;
use contract::event::RejectReason;
use contract::masked::MaskedCells;
use contract::observation::{Observation, PlatformKind, Quality};
use ingest::observation::{ObservationSink, SinkError, Stored};
use ingest::{DecoderCommand, IngestService, Outcome, Quiet, Rejection, Settings};
use netcdf3::{DataSet, FileWriter, Version};
use storage::Store;
use storage::log::EmbeddedLog;

pub(crate) fn settings() -> Settings {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_decode-file"));
    let mut settings = Settings::with_decoder(DecoderCommand {
        program,
        arguments: vec![],
    });
    settings.limits.memory_bytes = 1 << 30;
    settings.limits.cpu_s = 30;
    settings
}

/// Keeps what it is given.
#[derive(Default)]
struct Kept(Mutex<Vec<Observation>>);

#[async_trait]
impl ObservationSink for Kept {
    async fn put(&self, observations: Vec<Observation>) -> Result<Stored, SinkError> {
        self.0.lock().unwrap().extend(observations);
        Ok(Stored::default())
    }
}

/// What becomes of a file, and its observations.
async fn outcome(path: &Path, settings: &Settings) -> (Outcome, Vec<Observation>) {
    let (kept, log) = (Arc::new(Kept::default()), Arc::new(EmbeddedLog::memory()));
    let service = IngestService::new(Store::memory(), log, settings.clone())
        .with_observations(Arc::clone(&kept) as Arc<dyn ObservationSink>);
    service
        .notify(&[path.to_owned()], None, None)
        .await
        .unwrap();
    let outcome = service.drain(&Quiet).await.unwrap().remove(0);
    let observations = std::mem::take(&mut *kept.0.lock().unwrap());
    (outcome, observations)
}

/// Observations of a file and what is masked of it, as `fluxglobe ingest` has them, or why there are none.
pub(crate) async fn read(
    path: &Path,
    settings: &Settings,
) -> Result<(Vec<Observation>, MaskedCells), Rejection> {
    match outcome(path, settings).await {
        (Outcome::Observed { masked, .. }, observations) => Ok((observations, masked)),
        (
            Outcome::Rejected {
                reason,
                object,
                detail,
                ..
            },
            _,
        ) => Err(Rejection {
            reason,
            object,
            detail,
        }),
        (other, _) => panic!("{other}"),
    }
}

/// What of a file was measured and is not read.
pub(crate) async fn passed_over(path: &Path) -> Vec<String> {
    match outcome(path, &settings()).await {
        (Outcome::Observed { passed_over, .. }, _) => passed_over,
        (other, _) => panic!("{other}"),
    }
}

pub(crate) async fn observations(path: &Path) -> Vec<Observation> {
    let read = read(path, &settings()).await;
    read.unwrap_or_else(|refused| panic!("{}: {refused}", path.display()))
        .0
}

pub(crate) async fn refusal(path: &Path) -> Rejection {
    let read = read(path, &settings()).await;
    read.expect_err("they are taken")
}

/// A NetCDF classic file in the making.
pub(crate) struct Draft {
    pub(crate) set: DataSet,
    numbers: Vec<(&'static str, Vec<f64>)>,
    letters: Vec<(&'static str, Vec<u8>)>,
}

impl Draft {
    pub(crate) fn new(feature: &str, dimensions: &[(&str, usize)]) -> Self {
        let mut set = DataSet::new();
        set.add_global_attr_string("featureType", feature).unwrap();
        for (name, len) in dimensions {
            set.add_fixed_dim(name, *len).unwrap();
        }
        Self {
            set,
            numbers: vec![],
            letters: vec![],
        }
    }

    pub(crate) fn variable(
        mut self,
        name: &'static str,
        dimensions: &[&str],
        attributes: &[(&str, &str)],
        values: Vec<f64>,
    ) -> Self {
        self.set.add_var_f64(name, dimensions).unwrap();
        for (attribute, text) in attributes {
            self.set.add_var_attr_string(name, attribute, text).unwrap();
        }
        self.numbers.push((name, values));
        self
    }

    /// Names of two letters each.
    pub(crate) fn names(self, dimension: &str, role: &str, names: &str) -> Self {
        self.letters("name", &[dimension, "letters"], &[("cf_role", role)], names)
    }

    pub(crate) fn letters(
        mut self,
        name: &'static str,
        dimensions: &[&str],
        attributes: &[(&str, &str)],
        letters: &str,
    ) -> Self {
        self.set.add_var_u8(name, dimensions).unwrap();
        for (attribute, text) in attributes {
            self.set.add_var_attr_string(name, attribute, text).unwrap();
        }
        self.letters.push((name, letters.bytes().collect()));
        self
    }

    /// Longitude, latitude and time on one dimension each, 1-based tens, units and hours of an index.
    pub(crate) fn axes(self, place: &str, time: &str, places: usize, times: usize) -> Self {
        let run =
            |count: usize, scale: f64| (1..=count).map(|i| scale * i as f64).collect::<Vec<_>>();
        self.variable(
            "lon",
            &[place],
            &[("units", "degrees_east")],
            run(places, 100.0),
        )
        .variable(
            "lat",
            &[place],
            &[("units", "degrees_north")],
            run(places, 1.0),
        )
        .variable(
            "time",
            &[time],
            &[("units", "hours since 2000-01-01")],
            run(times, 1.0),
        )
    }

    pub(crate) fn write(self, folder: &Path) -> PathBuf {
        let path = folder.join("made.nc");
        let mut writer = FileWriter::open(&path).unwrap();
        writer.set_def(&self.set, Version::Classic, 0).unwrap();
        for (name, values) in &self.numbers {
            writer.write_var_f64(name, values).unwrap();
        }
        for (name, values) in &self.letters {
            writer.write_var_u8(name, values).unwrap();
        }
        writer.close().unwrap();
        path
    }
}

pub(crate) const SST: &[(&str, &str)] = &[
    ("standard_name", "sea_surface_temperature"),
    ("units", "degree_Celsius"),
    ("coordinates", "time lat lon"),
];

/// Platform, hour, longitude and value in degrees Celsius of each observation, sorted.
pub(crate) fn seen(observations: &[Observation]) -> Vec<(String, i64, i64, i64)> {
    let start: contract::time::TimeMs = "2000-01-01".parse().unwrap();
    let mut seen: Vec<_> = observations
        .iter()
        .map(|o| {
            let hour = (o.time.ms() - start.ms()) / 3_600_000;
            (
                o.platform.clone(),
                hour,
                o.lon_deg.round() as i64,
                (o.value - 273.15).round() as i64,
            )
        })
        .collect();
    seen.sort();
    seen
}

fn truth() -> Vec<(String, i64, i64, i64)> {
    // Two platforms at 100 and 200 (-160) degrees east; three samples of the first, two of the second.
    let row = |name: &str, hour, lon, value| (name.to_owned(), hour, lon, value);
    vec![
        row("aa", 1, 100, 11),
        row("aa", 2, 100, 12),
        row("aa", 3, 100, 13),
        row("bb", 4, -160, 21),
        row("bb", 5, -160, 22),
    ]
}

#[tokio::test]
async fn ragged_one_behind_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let file = Draft::new("timeSeries", &[("platform", 2), ("obs", 5), ("letters", 2)])
        .names("platform", "timeseries_id", "aabb")
        .axes("platform", "obs", 2, 5)
        .variable(
            "count",
            &["platform"],
            &[("sample_dimension", "obs")],
            vec![3.0, 2.0],
        )
        .variable("sst", &["obs"], SST, vec![11.0, 12.0, 13.0, 21.0, 22.0])
        .write(folder.path());
    let found = observations(&file).await;
    assert_eq!(seen(&found), truth());
    assert_eq!(found[0].kind, PlatformKind::Buoy);
    assert_eq!(found[0].dataset.as_str(), "made");
}

#[tokio::test]
async fn ragged_by_index() {
    let folder = tempfile::tempdir().unwrap();
    let file = Draft::new("trajectory", &[("platform", 2), ("obs", 5), ("letters", 2)])
        .names("platform", "trajectory_id", "aabb")
        .axes("platform", "obs", 2, 5)
        .variable(
            "of",
            &["obs"],
            &[("instance_dimension", "platform")],
            vec![0.0, 0.0, 0.0, 1.0, 1.0],
        )
        .variable("sst", &["obs"], SST, vec![11.0, 12.0, 13.0, 21.0, 22.0])
        .write(folder.path());
    let found = observations(&file).await;
    assert_eq!(seen(&found), truth());
    assert_eq!(found[0].kind, PlatformKind::Ship);
}

#[tokio::test]
async fn rows_with_gaps() {
    let folder = tempfile::tempdir().unwrap();
    let fill = f64::NAN;
    let file = Draft::new(
        "timeSeries",
        &[("platform", 2), ("time", 5), ("letters", 2)],
    )
    .names("platform", "timeseries_id", "aabb")
    .axes("platform", "time", 2, 5)
    .variable(
        "sst",
        &["platform", "time"],
        SST,
        vec![11.0, 12.0, 13.0, fill, fill, fill, fill, fill, 21.0, 22.0],
    )
    .write(folder.path());
    assert_eq!(seen(&observations(&file).await), truth());
}

#[tokio::test]
async fn rows_the_other_way_round() {
    let folder = tempfile::tempdir().unwrap();
    let fill = 1e36;
    let file = Draft::new(
        "timeSeries",
        &[("time", 5), ("platform", 2), ("letters", 2)],
    )
    .names("platform", "timeseries_id", "aabb")
    .axes("platform", "time", 2, 5)
    .variable(
        "sst",
        &["time", "platform"],
        SST,
        vec![11.0, fill, 12.0, fill, 13.0, fill, fill, 21.0, fill, 22.0],
    )
    .write(folder.path());
    assert_eq!(seen(&observations(&file).await), truth());
}

#[tokio::test]
async fn values_outside_the_range_of_their_file_are_counted_and_fill_values_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let mut draft = Draft::new(
        "timeSeries",
        &[("platform", 1), ("time", 5), ("letters", 2)],
    )
    .names("platform", "timeseries_id", "aa")
    .axes("platform", "time", 1, 5)
    .variable(
        "sst",
        &["platform", "time"],
        SST,
        vec![11.0, 12.0, f64::NAN, 21.0, 22.0],
    );
    draft
        .set
        .add_var_attr_f64("sst", "valid_max", vec![20.0])
        .unwrap();
    let path = draft.write(folder.path());
    let (found, masked) = read(&path, &settings()).await.unwrap();
    assert_eq!(found.len(), 2);
    assert_eq!((masked.out_of_range, masked.implausible), (2, 0));
}

#[tokio::test]
async fn casts_have_the_depth_of_each_sample_and_flags_that_say_what_they_mean() {
    let folder = tempfile::tempdir().unwrap();
    let file = Draft::new("profile", &[("cast", 2), ("z", 2), ("letters", 2)])
        .names("cast", "profile_id", "aabb")
        .axes("cast", "cast", 2, 2)
        .variable(
            "height",
            &["cast", "z"],
            &[
                ("units", "cm"),
                ("positive", "up"),
                ("standard_name", "height"),
            ],
            vec![-100.0, -200.0, -300.0, -400.0],
        )
        .variable(
            "temp",
            &["cast", "z"],
            &[("units", "K"), ("ancillary_variables", "flag")],
            vec![280.0, 281.0, 282.0, 283.0],
        )
        .variable(
            "flag",
            &["cast", "z"],
            &[("standard_name", "status_flag")],
            vec![1.0, 3.0, 4.0, 9.0],
        )
        .write(folder.path());
    let found = observations(&file).await;
    let seen: Vec<_> = found
        .iter()
        .map(|o| (o.platform.as_str(), o.depth_m, o.value, o.quality))
        .collect();
    let expected = [
        ("aa", 1.0, 280.0, Quality::Good),
        ("aa", 2.0, 281.0, Quality::Questionable),
        ("bb", 3.0, 282.0, Quality::Bad),
    ];
    assert_eq!(seen, expected);
    assert_eq!(found[0].property, "sea_water_temperature");
    assert_eq!(found[0].kind, PlatformKind::Profile);
}

#[tokio::test]
async fn counts_that_contradict_the_samples_are_refused() {
    for counts in [
        vec![3.0, 3.0],
        vec![3.0, 1.0],
        vec![-1.0, 6.0],
        vec![1e18, 1.0],
    ] {
        let folder = tempfile::tempdir().unwrap();
        let file = Draft::new("timeSeries", &[("platform", 2), ("obs", 5), ("letters", 2)])
            .names("platform", "timeseries_id", "aabb")
            .axes("platform", "obs", 2, 5)
            .variable(
                "count",
                &["platform"],
                &[("sample_dimension", "obs")],
                counts.clone(),
            )
            .variable("sst", &["obs"], SST, vec![0.0; 5])
            .write(folder.path());
        assert_eq!(
            refusal(&file).await.reason,
            RejectReason::Corrupt,
            "{counts:?}"
        );
    }
}

#[tokio::test]
async fn a_file_without_places_units_or_values_is_refused_with_its_reason() {
    let draft = || Draft::new("timeSeries", &[("time", 2)]);
    let time = |draft: Draft| {
        draft.variable(
            "time",
            &["time"],
            &[("units", "days since 2000-01-01")],
            vec![0.0, 1.0],
        )
    };
    let place = |draft: Draft| {
        draft
            .variable("lat", &[], &[("units", "degrees_north")], vec![1.0])
            .variable("lon", &[], &[("units", "degrees_east")], vec![2.0])
    };
    let sst = |draft: Draft, unit: &str, values: Vec<f64>| {
        draft.variable(
            "sst",
            &["time"],
            &[
                ("standard_name", "sea_surface_temperature"),
                ("units", unit),
            ],
            values,
        )
    };
    let good = vec![290.0, 291.0];
    for (draft, reason) in [
        (
            sst(time(draft()), "K", good.clone()),
            RejectReason::NoVariable,
        ),
        (
            sst(place(draft()), "K", good.clone()),
            RejectReason::NoVariable,
        ),
        (
            sst(place(time(draft())), "m", good.clone()),
            RejectReason::Unit,
        ),
        (
            sst(place(time(draft())), "K", vec![1e36, f64::NAN]),
            RejectReason::NoVariable,
        ),
        (place(time(draft())), RejectReason::NoVariable),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let rejection = refusal(&draft.write(folder.path())).await;
        assert_eq!(rejection.reason, reason, "{rejection}");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = sst(place(time(draft())), "K", good).write(folder.path());
    assert_eq!(
        observations(&file).await.len(),
        2,
        "nothing was wrong with the rest"
    );
}

#[tokio::test]
async fn grids_and_other_texts_are_no_observations() {
    let folder = tempfile::tempdir().unwrap();
    let grid = Draft::new("grid", &[("lat", 2), ("lon", 2)])
        .variable(
            "lat",
            &["lat"],
            &[("units", "degrees_north")],
            vec![1.0, 2.0],
        )
        .variable(
            "lon",
            &["lon"],
            &[("units", "degrees_east")],
            vec![1.0, 2.0],
        )
        .variable("sst", &["lat", "lon"], SST, vec![1.0; 4])
        .write(folder.path());
    let planned = refusal(&grid).await;
    assert_eq!(planned.reason, RejectReason::Time, "as a map: {planned}");
    let text = folder.path().join("text.csv");
    std::fs::write(&text, "lat,lon,flux\n1,2,3\n").unwrap();
    assert_eq!(refusal(&text).await.reason, RejectReason::Unreadable);
    assert_eq!(
        refusal(folder.path()).await.reason,
        RejectReason::Unreadable
    );
    assert_eq!(
        refusal(&folder.path().join("absent")).await.reason,
        RejectReason::Unreadable
    );
}

/// Every byte of a good file changed, and every length of it: a refusal or observations, never a crash or a hang.
#[tokio::test(flavor = "multi_thread")]
async fn mutated_texts_end_in_observations_or_a_refusal() {
    let folder = tempfile::tempdir().unwrap();
    let good = "Expocode\tyr\tmon\tday\thh\tmm\tss\tlongitude [dec.deg.E]\tlatitude [dec.deg.N]\tSST [deg.C]\tfCO2rec [uatm]\tfCO2rec_flag\n33HQ\t2015\t7\t14\t7\t14\t40\t181.5\t70.9\t-1.0\t271.4\t2\n";
    let path = folder.path().join("mutated.tsv");
    let mut outcomes = [0; 2];
    for at in 0..good.len() {
        for byte in [0u8, b'\t', b'\n', b'9', 0xff] {
            let mut bytes = good.as_bytes().to_vec();
            bytes[at] = byte;
            std::fs::write(&path, &bytes).unwrap();
            // A text that is no table any more goes to the reader process: that is slow and tested elsewhere.
            if byte == 0 {
                continue;
            }
            match read(&path, &settings()).await {
                Ok((all, _masked)) => {
                    assert!(all.iter().all(|o| o.validate().is_ok()));
                    outcomes[0] += 1;
                }
                Err(_refusal) => outcomes[1] += 1,
            }
        }
    }
    assert!(outcomes[0] > 100 && outcomes[1] > 100, "{outcomes:?}");
}
