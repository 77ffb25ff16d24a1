//! Small masks that the tests make themselves: CF files of one map of codes, which say what these mean.

use std::path::{Path, PathBuf};

use anyhow::Result;

/// Cells of 4 degrees, none of which is one of a granule's.
const ROWS: usize = 45;
const COLS: usize = 90;
const CELL_DEG: f64 = 4.0;

/// Writes `NAME.nc`: 1 north of the equator, 12 south of it, 3 nowhere; `meanings` are of 1, 3 and 12, if any are told.
#[expect(
    clippy::unwrap_used,
    reason = "the file is this function's own: it cannot be wrong"
)]
pub fn write(folder: &Path, name: &str, meanings: Option<&str>) -> Result<PathBuf> {
    let file = folder.join(format!("{name}.nc"));
    let axis = |count: usize, first: f64, step: f64| -> Vec<f64> {
        (0..count).map(|i| first + step * i as f64).collect()
    };
    let lat = axis(ROWS, 90.0 - CELL_DEG / 2.0, -CELL_DEG);
    let lon = axis(COLS, -180.0 + CELL_DEG / 2.0, CELL_DEG);
    let code = |lat: &f64| if *lat > 0.0 { 1_i8 } else { 12 };
    let codes: Vec<i8> = lat.iter().flat_map(|lat| [code(lat); COLS]).collect();
    let mut set = netcdf3::DataSet::new();
    set.add_fixed_dim("lat", ROWS).unwrap();
    set.add_fixed_dim("lon", COLS).unwrap();
    for (name, unit) in [("lat", "degrees_north"), ("lon", "degrees_east")] {
        set.add_var_f64(name, &[name]).unwrap();
        set.add_var_attr_string(name, "units", unit).unwrap();
    }
    set.add_var_i8("basin", &["lat", "lon"]).unwrap();
    set.add_var_attr_string("basin", "units", "1").unwrap();
    if let Some(meanings) = meanings {
        set.add_var_attr_i8("basin", "flag_values", vec![1, 3, 12])
            .unwrap();
        set.add_var_attr_string("basin", "flag_meanings", meanings)
            .unwrap();
    }
    let mut writer = netcdf3::FileWriter::open(&file).unwrap();
    writer.set_def(&set, netcdf3::Version::Classic, 0).unwrap();
    writer.write_var_f64("lat", &lat).unwrap();
    writer.write_var_f64("lon", &lon).unwrap();
    writer.write_var_i8("basin", &codes).unwrap();
    writer.close().unwrap();
    Ok(file)
}
