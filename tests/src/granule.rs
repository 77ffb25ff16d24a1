//! Small monthly flux granules that the tests make themselves: CF files, a month each, smooth fields without surprises.

use std::path::{Path, PathBuf};

use anyhow::Result;

/// Cells of 5 degrees.
const ROWS: usize = 36;
const COLS: usize = 72;
const CELL_DEG: f64 = 5.0;
const FILL: f32 = -999.0;
/// First year of the months.
const FIRST_YEAR: usize = 2000;

/// Writes the granule of one month, counted from January 2000; another `edition` has other values.
#[expect(
    clippy::unwrap_used,
    reason = "the file is this function's own: it cannot be wrong"
)]
pub fn write(folder: &Path, month: usize, edition: usize) -> Result<PathBuf> {
    let (year, month_of_year) = (FIRST_YEAR + month / 12, month % 12 + 1);
    let file = folder.join(format!("flux-{year}-{month_of_year:02}-{edition}.nc"));
    let axis = |count: usize, first: f64, step: f64| -> Vec<f64> {
        (0..count).map(|i| first + step * i as f64).collect()
    };
    let lat = axis(ROWS, 90.0 - CELL_DEG / 2.0, -CELL_DEG);
    let lon = axis(COLS, -180.0 + CELL_DEG / 2.0, CELL_DEG);
    let mut values = Vec::with_capacity(ROWS * COLS);
    for lat in &lat {
        for lon in &lon {
            values.push(value(*lat, *lon, month, edition));
        }
    }
    let mut set = netcdf3::DataSet::new();
    set.add_global_attr_string("time_coverage_resolution", "P1M")
        .unwrap();
    set.set_unlimited_dim("time", 1).unwrap();
    set.add_fixed_dim("lat", ROWS).unwrap();
    set.add_fixed_dim("lon", COLS).unwrap();
    for (name, unit) in [("lat", "degrees_north"), ("lon", "degrees_east")] {
        set.add_var_f64(name, &[name]).unwrap();
        set.add_var_attr_string(name, "units", unit).unwrap();
    }
    set.add_var_f64("time", &["time"]).unwrap();
    let since = format!("days since {year}-{month_of_year:02}-01");
    set.add_var_attr_string("time", "units", &since).unwrap();
    set.add_var_f32("fgco2", &["time", "lat", "lon"]).unwrap();
    set.add_var_attr_string("fgco2", "units", "mol m-2 s-1")
        .unwrap();
    set.add_var_attr_string(
        "fgco2",
        "standard_name",
        "surface_upward_mole_flux_of_carbon_dioxide",
    )
    .unwrap();
    set.add_var_attr_f32("fgco2", "_FillValue", vec![FILL])
        .unwrap();
    let mut writer = netcdf3::FileWriter::open(&file).unwrap();
    writer.set_def(&set, netcdf3::Version::Classic, 0).unwrap();
    writer.write_var_f64("lat", &lat).unwrap();
    writer.write_var_f64("lon", &lon).unwrap();
    writer.write_var_f64("time", &[0.0]).unwrap();
    writer.write_var_f32("fgco2", &values).unwrap();
    writer.close().unwrap();
    Ok(file)
}

/// Sources at the equator, sinks at mid latitudes, a season, no data beyond 75 degrees.
fn value(lat: f64, lon: f64, month: usize, edition: usize) -> f32 {
    if lat.abs() > 75.0 {
        return FILL;
    }
    let season = (month as f64 * std::f64::consts::TAU / 12.0 + lon.to_radians()).sin();
    let band = (3.0 * lat.to_radians()).cos();
    (1e-8 * (band + 0.4 * season + 0.05 * edition as f64)) as f32
}
