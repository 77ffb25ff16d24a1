//! The synthetic product as an HDF5 file that the netCDF library opens: dimension scales, CF attributes, no time stamps.

use std::path::Path;

use hdf5::{Dataset, File, SliceOrIndex};
use ndarray::ArrayView2;
use netcdf4::{attach, create, scale, texts};

use super::{FILL, MONTHS, Shape, YEAR};

/// Cells of a chunk: a map at scale 1 is 12 x 6 of them.
const CHUNK_ROWS: usize = 205;
const CHUNK_COLS: usize = 300;
/// Level of deflate: higher ones gain little on noise.
const DEFLATE_LEVEL: u8 = 4;

/// The coordinate variables, which are also the dimensions.
struct Axes {
    time: Dataset,
    lat: Dataset,
    lon: Dataset,
    side: Dataset,
}

/// Writes the file; the title ends with `years`, `edges_days` are days since the start of 2009 at which steps begin and the last one ends, `values`
/// gives those of a step, `[row, col]` from the south.
pub(super) fn write(
    path: &Path,
    shape: Shape,
    (seed, years): (u64, &str),
    edges_days: &[f64],
    mut values: impl FnMut(usize) -> Vec<f32>,
) -> hdf5::Result<()> {
    let file = create(path)?;
    let generator = format!("fluxglobe china-sea, seed {seed}");
    let title = format!(
        "SYNTHETIC China Sea air-sea CO2 flux{years}: made up by a program, no measurement"
    );
    texts(
        &file,
        &[
            ("Conventions", "CF-1.8"),
            ("title", &title),
            ("source", "fluxglobe generate china-sea"),
            ("generator", &generator),
        ],
    )?;
    file.new_attr::<i32>()
        .create("synthetic")?
        .write_scalar(&1)?;
    let axes = write_axes(&file, shape, edges_days)?;
    let step_count = edges_days.len() - 1;
    let flux = create_flux(&file, shape, step_count, &axes)?;
    let (rows, cols) = (shape.rows as usize, shape.cols as usize);
    let all = |count| SliceOrIndex::SliceCount {
        start: 0,
        step: 1,
        count,
        block: 1,
    };
    for index in 0..step_count {
        let values = values(index);
        let map = ArrayView2::from_shape((rows, cols), &values)?;
        let selection =
            hdf5::Hyperslab::from(vec![SliceOrIndex::Index(index), all(rows), all(cols)]);
        flux.write_slice(map, selection)?;
    }
    file.close()
}

fn write_axes(file: &File, shape: Shape, days: &[f64]) -> hdf5::Result<Axes> {
    let middles: Vec<f64> = days.windows(2).map(|d| f64::midpoint(d[0], d[1])).collect();
    let lats: Vec<f64> = (0..shape.rows).map(|r| shape.lat_deg(r)).collect();
    let lons: Vec<f64> = (0..shape.cols).map(|c| shape.lon_deg(c)).collect();
    let time = scale(file, "time", &middles)?;
    let units = ("units", "days since 2009-01-01");
    texts(
        &time,
        &[
            ("standard_name", "time"),
            units,
            ("calendar", "standard"),
            ("axis", "T"),
            ("bounds", "time_bnds"),
        ],
    )?;
    let lat = scale(file, "lat", &lats)?;
    texts(
        &lat,
        &[("standard_name", "latitude"), ("units", "degrees_north")],
    )?;
    let lon = scale(file, "lon", &lons)?;
    texts(
        &lon,
        &[("standard_name", "longitude"), ("units", "degrees_east")],
    )?;
    let side = scale(file, "bnds", &[0.0, 1.0])?;
    let axes = Axes {
        time,
        lat,
        lon,
        side,
    };
    let pairs: Vec<f64> = days.windows(2).flatten().copied().collect();
    let bounds = file
        .new_dataset::<f64>()
        .obj_track_times(false)
        .shape([days.len() - 1, 2])
        .create("time_bnds")?;
    bounds.write_raw(&pairs)?;
    attach(file, &bounds, &[&axes.time, &axes.side])?;
    Ok(axes)
}

fn create_flux(file: &File, shape: Shape, step_count: usize, axes: &Axes) -> hdf5::Result<Dataset> {
    let (rows, cols) = (shape.rows as usize, shape.cols as usize);
    let flux = file
        .new_dataset::<f32>()
        .obj_track_times(false)
        .chunk([1, rows.min(CHUNK_ROWS), cols.min(CHUNK_COLS)])
        .shuffle()
        .deflate(DEFLATE_LEVEL)
        .fill_value(FILL)
        .shape([step_count, rows, cols])
        .create("co2_flux")?;
    let attributes = [
        (
            "standard_name",
            "surface_upward_mole_flux_of_carbon_dioxide",
        ),
        (
            "long_name",
            "SYNTHETIC air-sea CO2 flux, positive out of the sea",
        ),
        ("units", "mmol m-2 d-1"),
        ("cell_methods", "time: mean"),
    ];
    texts(&flux, &attributes)?;
    flux.new_attr::<f32>()
        .create("_FillValue")?
        .write_scalar(&FILL)?;
    attach(file, &flux, &[&axes.time, &axes.lat, &axes.lon])?;
    Ok(flux)
}

/// Days from the start of 2009 to the start of a month, 0 for that January, 12 for the one after.
pub(super) fn first_day(month: usize) -> f64 {
    let start = |month: usize| {
        let year = i32::from(YEAR) + (month / MONTHS) as i32;
        let start = contract::time::TimeMs::from_ymd(year, (month % MONTHS) as u32 + 1, 1);
        start.map(|t| t.ms() as f64 / 86_400_000.0)
    };
    start(month)
        .and_then(|day| Ok(day - start(0)?))
        .expect("months of 2009 and later exist")
}
