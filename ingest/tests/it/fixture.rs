//! Small files written by other libraries than the readers under test, and a folder to land them in.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use contract::event::Event;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::topic::Topic;
use hdf5::types::VarLenUnicode;
use ingest::{
    DecoderCommand, IngestError, IngestService, Outcome, Profile, Progress, Quiet, Settings,
};
use storage::Store;
use storage::log::{EmbeddedLog, EventLog, Start};
use tempfile::TempDir;

/// A store, a log and a folder for files, gone when dropped.
pub(crate) struct Place {
    pub(crate) folder: TempDir,
    pub(crate) store: Store,
    pub(crate) log: EmbeddedLog,
}

impl Place {
    pub(crate) fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
            store: Store::memory(),
            log: EmbeddedLog::memory(),
        }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) async fn land(&self, files: &[PathBuf]) -> Vec<Outcome> {
        self.land_with(files, None).await
    }

    pub(crate) async fn land_with(
        &self,
        files: &[PathBuf],
        profile: Option<&Profile>,
    ) -> Vec<Outcome> {
        let mut settings = settings();
        if let Some(profile) = profile {
            settings.profiles = [profile.clone()].into_iter().collect();
        }
        let service = self.service(settings);
        let name = profile.map(|profile| profile.name.as_str());
        service.notify(files, name, None).await.unwrap();
        service.drain(&Quiet).await.unwrap()
    }

    /// Lands files with settings of one's own, as a command does.
    pub(crate) async fn land_as(
        &self,
        settings: Settings,
        files: &[PathBuf],
        progress: &dyn Progress,
    ) -> Result<Vec<Outcome>, IngestError> {
        let service = self.service(settings);
        service.notify(files, None, None).await?;
        service.drain(progress).await
    }

    fn service(&self, settings: Settings) -> IngestService {
        let log: Arc<dyn EventLog> = Arc::new(self.log.clone());
        IngestService::new(self.store.clone(), log, settings)
    }

    pub(crate) async fn newest(&self, product: &str) -> Manifest {
        let product: ProductId = product.parse().unwrap();
        storage::manifests::latest(&self.store, &product)
            .await
            .unwrap()
            .unwrap()
    }

    /// Values of a step, `[row, col]`.
    pub(crate) async fn values(&self, manifest: &Manifest, step: usize) -> Vec<f32> {
        storage::fields::read(&self.store, &manifest.steps[step].field, &manifest.grid)
            .await
            .unwrap()
    }
}

/// All events of a topic, in their order.
pub(crate) async fn events(log: &dyn EventLog, topic: Topic) -> Vec<Event> {
    let mut follower = log.follow(topic, Start::Oldest).await.unwrap();
    let messages = follower
        .next(10_000, std::time::Duration::ZERO)
        .await
        .unwrap();
    messages
        .iter()
        .map(|message| message.event().unwrap())
        .collect()
}

/// The reader process of this crate's own binary, with limits for small files.
pub(crate) fn settings() -> Settings {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_decode-file"));
    let mut settings = Settings::with_decoder(DecoderCommand {
        program,
        arguments: vec![],
    });
    settings.limits.memory_bytes = 1 << 30;
    settings.limits.cpu_s = 20;
    settings.limits.wall = std::time::Duration::from_mins(1);
    settings
}

/// A small CF file: 2 steps of a 4 x 8 grid of 45 degrees, carbon flux.
pub(crate) struct SmallFile {
    pub(crate) lat: Vec<f64>,
    pub(crate) lon: Vec<f64>,
    pub(crate) time: Vec<f64>,
    pub(crate) time_unit: Option<&'static str>,
    pub(crate) name: &'static str,
    pub(crate) standard_name: &'static str,
    pub(crate) unit: &'static str,
    /// `[time, lat, lon]`.
    pub(crate) values: Vec<f32>,
}

pub(crate) const FILL: f32 = -999.0;
pub(crate) const GRID: Grid = Grid {
    rows: 4,
    cols: 8,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 45.0,
    dlon_deg: 45.0,
};

impl SmallFile {
    /// January and February 2001; the value is 100 * month + 10 * row + column, and the first cell has no data.
    pub(crate) fn new() -> Self {
        let value = |month: usize, row: usize, col: usize| {
            if row + col == 0 {
                FILL
            } else {
                (100 * month + 10 * row + col) as f32
            }
        };
        let values = (1..=2)
            .flat_map(|m| (0..4).flat_map(move |r| (0..8).map(move |c| value(m, r, c))))
            .collect();
        Self {
            lat: vec![67.5, 22.5, -22.5, -67.5],
            lon: (0..8).map(|i| -157.5 + 45.0 * f64::from(i)).collect(),
            time: vec![15.0, 45.0],
            time_unit: Some("days since 2001-01-01"),
            name: "fgco2",
            standard_name: "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon",
            unit: "g C m-2 month-1",
            values,
        }
    }

    /// Only its first month.
    pub(crate) fn first_month(mut self) -> Self {
        self.values.truncate(self.lat.len() * self.lon.len());
        self.time = vec![0.0];
        self.time_unit = Some("days since 2001-01-01");
        self
    }

    /// NetCDF classic, by the crate netcdf3.
    pub(crate) fn write_classic(&self, path: &Path) {
        let mut set = netcdf3::DataSet::new();
        let stamped = self.time_unit.is_some();
        set.add_global_attr_string("time_coverage_resolution", if stamped { "P1M" } else { "" })
            .unwrap();
        if stamped {
            set.set_unlimited_dim("time", self.time.len()).unwrap();
        }
        set.add_fixed_dim("lat", self.lat.len()).unwrap();
        set.add_fixed_dim("lon", self.lon.len()).unwrap();
        set.add_var_f64("lat", &["lat"]).unwrap();
        set.add_var_attr_string("lat", "units", "degrees_north")
            .unwrap();
        set.add_var_f64("lon", &["lon"]).unwrap();
        set.add_var_attr_string("lon", "units", "degrees_east")
            .unwrap();
        if let Some(unit) = self.time_unit {
            set.add_var_f64("time", &["time"]).unwrap();
            set.add_var_attr_string("time", "units", unit).unwrap();
        }
        let dimensions: &[&str] = if stamped {
            &["time", "lat", "lon"]
        } else {
            &["lat", "lon"]
        };
        set.add_var_f32(self.name, dimensions).unwrap();
        set.add_var_attr_string(self.name, "units", self.unit)
            .unwrap();
        set.add_var_attr_string(self.name, "standard_name", self.standard_name)
            .unwrap();
        set.add_var_attr_f32(self.name, "_FillValue", vec![FILL])
            .unwrap();
        let mut writer = netcdf3::FileWriter::open(path).unwrap();
        writer.set_def(&set, netcdf3::Version::Classic, 0).unwrap();
        writer.write_var_f64("lat", &self.lat).unwrap();
        writer.write_var_f64("lon", &self.lon).unwrap();
        if stamped {
            writer.write_var_f64("time", &self.time).unwrap();
        }
        writer.write_var_f32(self.name, &self.values).unwrap();
        writer.close().unwrap();
    }

    /// Only its axes, as plain HDF5.
    pub(crate) fn write_axes(&self, path: &Path) -> hdf5::File {
        let file = hdf5::File::create(path).unwrap();
        let axis = |name: &str, values: &[f64], unit: &str| {
            let dataset = file
                .new_dataset::<f64>()
                .shape([values.len()])
                .create(name)
                .unwrap();
            dataset.write_raw(values).unwrap();
            text(&dataset, "units", unit);
        };
        axis("lat", &self.lat, "degrees_north");
        axis("lon", &self.lon, "degrees_east");
        if let Some(unit) = self.time_unit {
            axis("time", &self.time, unit);
            text(&file, "time_coverage_resolution", "P1M");
        }
        file
    }

    /// Plain HDF5 without dimension scales, by libhdf5.
    pub(crate) fn write_hdf5(&self, path: &Path) {
        drop(self.write_hdf5_open(path));
    }

    /// The same, for more to be written to it.
    pub(crate) fn write_hdf5_open(&self, path: &Path) -> hdf5::File {
        let file = self.write_axes(path);
        let (rows, cols) = (self.lat.len(), self.lon.len());
        let shape: Vec<usize> = if self.time_unit.is_some() {
            vec![self.time.len(), rows, cols]
        } else {
            vec![rows, cols]
        };
        let chunk: Vec<usize> = shape.iter().map(|n| (*n).clamp(1, 4)).collect();
        let dataset = file
            .new_dataset::<f32>()
            .chunk(chunk)
            .shuffle()
            .deflate(4)
            .shape(shape)
            .create(self.name)
            .unwrap();
        dataset.write_raw(&self.values).unwrap();
        text(&dataset, "units", self.unit);
        text(&dataset, "standard_name", self.standard_name);
        dataset
            .new_attr::<f32>()
            .create("_FillValue")
            .unwrap()
            .write_scalar(&FILL)
            .unwrap();
        file
    }
}

/// The maps of the newest state of a product's cube, `[step][row, col]`.
pub(crate) async fn cube_maps(store: &Store, manifest: &Manifest) -> Vec<Vec<f32>> {
    let repository = cube::Repository::open(store, &cube::folder(&manifest.product)).await;
    let cube = repository.unwrap().at(&cube::At::Newest).await.unwrap();
    assert_eq!(cube.description().version, Some(manifest.id()));
    let mut maps = vec![];
    for step in 0..cube.steps().len() {
        maps.push(cube.field(step).await.unwrap());
    }
    maps
}

/// Opens an HDF5 file for writing that was closed just now. The library's lock on it can outlive the closing for a moment:
/// a reader process that another test was starting meanwhile has it too until it runs its own program.
pub(crate) fn open_again(path: &Path) -> hdf5::File {
    let start = std::time::Instant::now();
    loop {
        match hdf5::File::open_rw(path) {
            Ok(file) => return file,
            Err(error) => assert!(start.elapsed().as_secs() < 10, "{error}"),
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

/// Writes a text attribute.
pub(crate) fn text(owner: &hdf5::Location, name: &str, value: &str) {
    let value: VarLenUnicode = value.parse().unwrap();
    owner
        .new_attr::<VarLenUnicode>()
        .create(name)
        .unwrap()
        .write_scalar(&value)
        .unwrap();
}

/// The one refusal of a batch of one, as reason and line.
pub(crate) fn refusal(outcomes: &[Outcome]) -> (contract::event::RejectReason, String) {
    match outcomes {
        [outcome @ Outcome::Rejected { reason, .. }] => (*reason, outcome.to_string()),
        other => panic!("no refusal: {other:?}"),
    }
}
