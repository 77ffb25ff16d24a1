//! The synthetic product as an HDF5 file that the netCDF library opens: dimension scales, CF attributes, no time stamps.

use std::ops::Range;
use std::path::Path;

use hdf5::{Dataset, File, SliceOrIndex};
use ndarray::ArrayView2;
use netcdf4::{attach, create, scale, texts};

use super::grid::FileGrid;
use super::product::{FILL, Texts};

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

/// Cells that are made and written at once, at most, but for a row of chunks: 32 MB.
const BAND_CELLS: usize = 1 << 23;

/// Writes the file; the title ends with `years`, `edges_days` are days since the start of 2009 at which steps begin and the last one ends, `values`
/// gives those of some rows of a step, `[row, col]` from the south.
pub(super) fn write(
    path: &Path,
    grid: FileGrid,
    (own, years): (Texts, &str),
    edges_days: &[f64],
    mut values: impl FnMut(usize, Range<u32>) -> Vec<f32>,
) -> hdf5::Result<()> {
    let file = create(path)?;
    let Texts { sea, command, seed } = own;
    let generator = format!("fluxglobe {command}, seed {seed}");
    let source = format!("fluxglobe generate {command}");
    let title =
        format!("SYNTHETIC {sea} air-sea CO2 flux{years}: made up by a program, no measurement");
    texts(
        &file,
        &[
            ("Conventions", "CF-1.8"),
            ("title", &title),
            ("source", &source),
            ("generator", &generator),
        ],
    )?;
    file.new_attr::<i32>()
        .create("synthetic")?
        .write_scalar(&1)?;
    let axes = write_axes(&file, grid, edges_days)?;
    let step_count = edges_days.len() - 1;
    let flux = create_flux(&file, grid, step_count, &axes)?;
    for step in 0..step_count {
        for rows in bands(grid) {
            write_rows(&flux, step, rows.clone(), &values(step, rows))?;
        }
    }
    file.close()
}

/// Rows that are written together: whole rows of chunks.
fn bands(grid: FileGrid) -> impl Iterator<Item = Range<u32>> {
    let chunk_cells = CHUNK_ROWS * grid.cols as usize;
    let rows = (BAND_CELLS / chunk_cells).max(1) * CHUNK_ROWS;
    let band = move |first: u32| first..(first + rows as u32).min(grid.rows);
    (0..grid.rows).step_by(rows).map(band)
}

fn write_rows(flux: &Dataset, step: usize, rows: Range<u32>, values: &[f32]) -> hdf5::Result<()> {
    let count = rows.len();
    let map = ArrayView2::from_shape((count, values.len() / count), values)?;
    let from = |start: u32, count: usize| SliceOrIndex::SliceCount {
        start: start as usize,
        step: 1,
        count,
        block: 1,
    };
    let selection = hdf5::Hyperslab::from(vec![
        SliceOrIndex::Index(step),
        from(rows.start, count),
        from(0, map.ncols()),
    ]);
    flux.write_slice(map, selection)
}

fn write_axes(file: &File, grid: FileGrid, days: &[f64]) -> hdf5::Result<Axes> {
    let middles: Vec<f64> = days.windows(2).map(|d| f64::midpoint(d[0], d[1])).collect();
    let lats: Vec<f64> = (0..grid.rows).map(|r| grid.lat_deg(r)).collect();
    let lons: Vec<f64> = (0..grid.cols).map(|c| grid.lon_deg(c)).collect();
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

fn create_flux(
    file: &File,
    grid: FileGrid,
    step_count: usize,
    axes: &Axes,
) -> hdf5::Result<Dataset> {
    let (rows, cols) = (grid.rows as usize, grid.cols as usize);
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
