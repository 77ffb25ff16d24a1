//! One NetCDF-4 file by the CF conventions: the arrays of a cube, as dimension scales and variables of HDF5.

use std::path::{Path, PathBuf};

use contract::grid::Grid;
use contract::time::Period;
use cube::{Description, cf};
use hdf5::{Dataset, File, Hyperslab, Location, SliceOrIndex};
use ndarray::ArrayView2;
use netcdf4::{attach, scale, texts};
use serde_json::{Map, Value};
use tempfile::TempPath;

use crate::cells::Cells;
use crate::{ExportError, Values, Written, part_of};

/// Cells of a chunk along each side, as a cube's.
const CHUNK_CELLS: usize = 512;
/// Level of deflate: higher ones gain little on measurements.
const DEFLATE_LEVEL: u8 = 4;
/// Unit of time. Whole seconds are exact in 64 bits, and every program knows them.
const TIME_UNITS: &str = "seconds since 1970-01-01 00:00:00";

/// The file as it is being written.
pub struct NetCdf {
    path: PathBuf,
    /// The unfinished file, which goes if it is never finished.
    part: TempPath,
    file: File,
    values: Dataset,
    grid: Grid,
    periods: Vec<Period>,
    next: usize,
}

impl NetCdf {
    pub(crate) fn create(
        path: &Path,
        description: &Description,
        periods: &[Period],
    ) -> Result<Self, ExportError> {
        let part = part_of(path)?.into_temp_path();
        let begun = begin(&part, description, periods);
        let (file, values) = begun.map_err(ExportError::library(path))?;
        Ok(Self {
            path: path.to_owned(),
            part,
            file,
            values,
            grid: description.grid,
            periods: periods.to_vec(),
            next: 0,
        })
    }
}

impl Written for NetCdf {
    fn append(&mut self, period: Period, values: Values<'_>) -> Result<(), ExportError> {
        if self.periods.get(self.next) != Some(&period) {
            return Err(ExportError::Step {
                found: period.to_string(),
            });
        }
        let cols = self.grid.cols as usize;
        let some = |start, count| SliceOrIndex::SliceCount {
            start,
            step: 1,
            count,
            block: 1,
        };
        // Whole rows of chunks, so that each is packed once.
        let mut cells = Cells::new(values, &self.grid);
        let mut first = 0;
        while let Some(values) = cells.next(CHUNK_CELLS * cols)? {
            let rows = values.len() / cols;
            let part = Hyperslab::from(vec![
                SliceOrIndex::Index(self.next),
                some(first, rows),
                some(0, cols),
            ]);
            let map = ArrayView2::from_shape((rows, cols), values);
            let map = map.map_err(ExportError::library(&self.path))?;
            let written = self.values.write_slice(map, part);
            written.map_err(ExportError::library(&self.path))?;
            first += rows;
        }
        self.next += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        let Self {
            path,
            part,
            file,
            values,
            periods,
            next,
            ..
        } = *self;
        if let Some(missing) = periods.get(next) {
            return Err(ExportError::Step {
                found: format!("the end before {missing}"),
            });
        }
        drop(values);
        file.close().map_err(ExportError::library(&path))?;
        let kept = part.persist_noclobber(&path);
        kept.map_err(|e| ExportError::io(&path)(e.error))
    }
}

/// The file with all that is known before the first step.
fn begin(
    part: &Path,
    description: &Description,
    periods: &[Period],
) -> hdf5::Result<(File, Dataset)> {
    let file = netcdf4::create(part)?;
    attributes(&file, description.attributes())?;
    let (lat, lon) = cube::places(&description.grid);
    let time = write_time(&file, description.is_sum(), periods)?;
    let place = |name: &str, centres: &[f64], said| {
        let axis = scale(&file, name, centres)?;
        attributes(&axis, said)?;
        Ok::<_, hdf5::Error>(axis)
    };
    let lat_axis = place("lat", &lat.centres, cf::of_lat())?;
    let lon_axis = place("lon", &lon.centres, cf::of_lon())?;
    let side = scale(&file, "bnds", &[0.0, 1.0])?;
    pairs(&file, "lat_bnds", &lat.bounds, [&lat_axis, &side])?;
    pairs(&file, "lon_bnds", &lon.bounds, [&lon_axis, &side])?;
    let edges: Vec<f64> = periods
        .iter()
        .flat_map(|period| {
            [
                bounds_start(description.is_sum(), periods, *period),
                seconds(period.end.ms()),
            ]
        })
        .collect();
    pairs(&file, "time_bnds", &edges, [&time, &side])?;
    let crs = file
        .new_dataset::<i32>()
        .obj_track_times(false)
        .create("crs")?;
    crs.write_scalar(&0)?;
    attributes(&crs, cf::of_crs())?;
    let corner = corner(&description.grid);
    texts(
        &crs,
        &[
            ("crs_wkt", cube::cf::WGS84_WKT),
            ("GeoTransform", corner.as_str()),
        ],
    )?;
    let values = write_values(
        &file,
        description,
        periods.len(),
        [&time, &lat_axis, &lon_axis],
    )?;
    Ok((file, values))
}

fn write_values(
    file: &File,
    description: &Description,
    steps: usize,
    axes: [&Dataset; 3],
) -> hdf5::Result<Dataset> {
    let (rows, cols) = (
        description.grid.rows as usize,
        description.grid.cols as usize,
    );
    let values = file
        .new_dataset::<f32>()
        .obj_track_times(false)
        .chunk([1, rows.min(CHUNK_CELLS), cols.min(CHUNK_CELLS)])
        .shuffle()
        .deflate(DEFLATE_LEVEL)
        .fill_value(f32::NAN)
        .shape([steps, rows, cols])
        .create(cf::variable(description.quantity).as_str())?;
    attributes(&values, cf::of_values(description))?;
    values
        .new_attr::<f32>()
        .create("_FillValue")?
        .write_scalar(&f32::NAN)?;
    attach(file, &values, &axes)?;
    Ok(values)
}

/// Where values hold: the middle of what they are a mean over, the end of a sum, of which the steps' starts are written too.
fn write_time(file: &File, is_sum: bool, periods: &[Period]) -> hdf5::Result<Dataset> {
    let at = |period: &Period| {
        let time = if is_sum { period.end } else { period.mid() };
        seconds(time.ms())
    };
    let times: Vec<f64> = periods.iter().map(at).collect();
    let time = scale(file, "time", &times)?;
    attributes(&time, with_units(cf::of_time()))?;
    if is_sum {
        let starts: Vec<f64> = periods
            .iter()
            .map(|period| seconds(period.start.ms()))
            .collect();
        let start = file
            .new_dataset::<f64>()
            .obj_track_times(false)
            .shape([starts.len()])
            .create("step_start")?;
        start.write_raw(&starts)?;
        attributes(&start, with_units(cf::of_step_start()))?;
        attach(file, &start, &[&time])?;
    }
    Ok(time)
}

/// North-western corner and sides of cells as GDAL writes and reads them: from centres alone it makes no places of one row or one column, and
/// turns a column upside down.
fn corner(grid: &Grid) -> String {
    let Grid {
        north_deg,
        west_deg,
        dlat_deg,
        dlon_deg,
        ..
    } = grid;
    format!("{west_deg} {dlon_deg} 0 {north_deg} 0 -{dlat_deg}")
}

/// A sum is one since the first step.
fn bounds_start(is_sum: bool, periods: &[Period], period: Period) -> f64 {
    let first = periods.first().filter(|_| is_sum).copied();
    seconds(first.unwrap_or(period).start.ms())
}

fn seconds(ms: i64) -> f64 {
    ms as f64 / 1000.0
}

fn with_units(mut said: Map<String, Value>) -> Map<String, Value> {
    said.insert("units".to_owned(), TIME_UNITS.into());
    said
}

fn pairs(file: &File, name: &str, numbers: &[f64], axes: [&Dataset; 2]) -> hdf5::Result<()> {
    let bounds = file
        .new_dataset::<f64>()
        .obj_track_times(false)
        .shape([numbers.len() / 2, 2])
        .create(name)?;
    bounds.write_raw(numbers)?;
    attach(file, &bounds, &axes)
}

/// Texts as texts, numbers as numbers, lists of numbers in the type of values, and what this program keeps for itself as JSON.
fn attributes(owner: &Location, said: Map<String, Value>) -> hdf5::Result<()> {
    for (name, value) in said {
        match value {
            Value::String(text) => texts(owner, &[(name.as_str(), text.as_str())])?,
            Value::Number(number) => {
                let number = number.as_f64().unwrap_or(f64::NAN);
                owner
                    .new_attr::<f64>()
                    .create(name.as_str())?
                    .write_scalar(&number)?;
            }
            Value::Array(all) if all.iter().all(Value::is_number) => {
                let numbers = all.iter().filter_map(Value::as_f64);
                let numbers: Vec<f32> = numbers.map(|number| number as f32).collect();
                let attribute = owner.new_attr::<f32>().shape([numbers.len()]);
                attribute.create(name.as_str())?.write_raw(&numbers)?;
            }
            other => texts(owner, &[(name.as_str(), other.to_string().as_str())])?,
        }
    }
    Ok(())
}
