//! What was exported, read by others: netCDF4 with its C library, GDAL by rasterio, Arrow for Python. Bit for bit.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

use arrow::array::{AsArray as _, RecordBatch};
use arrow::datatypes::{Float32Type, Float64Type};
use contract::analysis::MapStatistic;
use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::time::Period;
use cube::Description;
use export::{ExportError, Format, create};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::{Value, json};

/// Across the date line, with steps that are no round fraction of a degree.
const GRID: Grid = Grid {
    rows: 30,
    cols: 41,
    north_deg: 12.25,
    west_deg: 170.5,
    dlat_deg: 0.25,
    dlon_deg: 1.0 / 3.0,
};

fn description(quantity: Quantity) -> Description {
    Description {
        product: "some-product".parse().unwrap(),
        title: "Flux <of> \"CO₂\" & more".to_owned(),
        quantity,
        synthetic: true,
        source: "Somebody et al. (2000)".to_owned(),
        grid: GRID,
        version: "some-product@3-0a1b2c3d".parse().ok(),
        statistic: None,
    }
}

fn periods() -> Vec<Period> {
    [1, 2, 4]
        .map(|month| Period::month(2000, month).unwrap())
        .to_vec()
}

/// Numbers of every size, no data here and there.
fn values(step: usize) -> Vec<f32> {
    let value = |cell: usize| match (cell * 7 + step * 13) % 11 {
        0 => f32::NAN,
        1 => -0.0,
        2 => f32::MIN_POSITIVE / 4.0,
        other => (other as f32 - 5.5) * 1.2345e-9 * (cell as f32 + 1.0).powi(step as i32 + 1),
    };
    (0..GRID.cell_count()).map(value).collect()
}

fn written(format: Format, path: &Path, quantity: Quantity) -> Result<(), ExportError> {
    written_in(GRID.rows as usize, format, path, quantity)
}

/// The same in bands of so many rows.
fn written_in(
    rows: usize,
    format: Format,
    path: &Path,
    quantity: Quantity,
) -> Result<(), ExportError> {
    let mut written = create(format, path, &description(quantity), &periods())?;
    for (step, period) in periods().into_iter().enumerate() {
        let values = values(step);
        let bands = values.chunks(rows * GRID.cols as usize);
        written.append(period, &mut bands.map(<[f32]>::to_vec))?;
    }
    written.finish()
}

/// What must be found, each value as its bits.
fn expected(quantity: Quantity) -> Value {
    let (lat, lon) = cube::places(&GRID);
    let steps: Vec<Value> = periods()
        .iter()
        .enumerate()
        .map(|(step, period)| {
            let bits: Vec<u32> = values(step).iter().map(|value| value.to_bits()).collect();
            json!({ "start_ms": period.start.ms(), "end_ms": period.end.ms(), "bits": bits })
        })
        .collect();
    json!({
        "variable": quantity.word(),
        "units": quantity.unit(),
        "long_name": quantity.title(),
        "is_sum": quantity == Quantity::AccumulatedCarbon,
        "lat": lat.centres,
        "lon": lon.centres,
        "edges": [GRID.west_deg, GRID.south_deg(), GRID.east_deg(), GRID.north_deg],
        "steps": steps,
    })
}

/// What the others find: how many values, or what is otherwise.
fn compared(format: &str, path: &Path, expected: &Value) -> Result<Value, String> {
    let folder = tempfile::tempdir().unwrap();
    let told = folder.path().join("expected.json");
    std::fs::write(&told, expected.to_string()).unwrap();
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/reference/exported_files.py"
    );
    let run = Command::new(test_data::python())
        .args([Path::new(script), Path::new(format), path, &told])
        .output()
        .unwrap();
    if run.status.success() {
        Ok(serde_json::from_slice(&run.stdout).unwrap())
    } else {
        Err(String::from_utf8_lossy(&run.stderr).into_owned())
    }
}

fn read_back(format: Format, name: &str, quantity: Quantity) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out");
    written(format, &path, quantity).unwrap();
    let right = expected(quantity);
    let found = compared(name, &path, &right).unwrap();
    assert_eq!(found["values"], GRID.cell_count() * 3);
    // The comparison sees one bit of one value, another place and another time.
    let wrong: [fn(&mut Value); 3] = [
        |told| {
            told["steps"][1]["bits"][700] =
                json!(told["steps"][1]["bits"][700].as_u64().unwrap() ^ 1);
        },
        |told| told["lat"][3] = json!(told["lat"][3].as_f64().unwrap() + 1e-9),
        |told| {
            told["steps"][2]["end_ms"] = json!(told["steps"][2]["end_ms"].as_i64().unwrap() + 1000);
        },
    ];
    for (number, change) in wrong.into_iter().enumerate() {
        let mut told = right.clone();
        change(&mut told);
        assert!(
            compared(name, &path, &told).is_err(),
            "{name}: fault {number}"
        );
    }
    assert!(
        matches!(
            written(format, &path, quantity),
            Err(ExportError::Exists { .. })
        ),
        "it takes the place of something"
    );
    let left: Vec<PathBuf> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    assert_eq!(left, [path], "something is left over");
}

#[test]
fn netcdf_is_read_by_the_netcdf_library() {
    read_back(Format::NetCdf, "netcdf", Quantity::CarbonFlux);
    read_back(Format::NetCdf, "netcdf", Quantity::AccumulatedCarbon);
}

/// The mean of sums is none of everything since its first step.
#[test]
fn a_statistic_of_sums_is_of_its_own_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out");
    let own = Description {
        statistic: Some(MapStatistic::Climatology),
        ..description(Quantity::AccumulatedCarbon)
    };
    let mut written = create(Format::NetCdf, &path, &own, &periods()).unwrap();
    for (step, period) in periods().into_iter().enumerate() {
        let mut values = std::iter::once(values(step));
        written.append(period, &mut values).unwrap();
    }
    written.finish().unwrap();
    let mut right = expected(Quantity::AccumulatedCarbon);
    right["is_sum"] = json!(false);
    let found = compared("netcdf", &path, &right).unwrap();
    assert_eq!(found["values"], GRID.cell_count() * 3);
}

#[test]
fn geotiff_is_read_by_gdal() {
    read_back(Format::GeoTiff, "geotiff", Quantity::CarbonFlux);
}

#[test]
fn parquet_is_read_by_arrow() {
    let open = Quantity::open("river_flux", "mol m-2 s-1", "River flux").unwrap();
    read_back(Format::Parquet, "parquet", open);
    read_back(Format::Parquet, "parquet", Quantity::AccumulatedCarbon);
}

#[test]
fn half_an_export_leaves_nothing_and_a_wrong_step_is_refused() {
    for format in [Format::NetCdf, Format::GeoTiff, Format::Parquet] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        let quantity = Quantity::CarbonFlux;
        let mut half = create(format, &path, &description(quantity), &periods()).unwrap();
        half.append(periods()[0], &mut [values(0)].into_iter())
            .unwrap();
        let short = half.append(periods()[1], &mut [values(1)[1..].to_vec()].into_iter());
        assert!(matches!(short, Err(ExportError::Shape { .. })));
        drop(half);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

#[test]
fn the_same_values_are_the_same_bytes() {
    for format in [Format::NetCdf, Format::Parquet] {
        let folder = tempfile::tempdir().unwrap();
        let bytes = |rows: usize| {
            let path = folder.path().join(rows.to_string());
            let _was = std::fs::remove_file(&path);
            written_in(rows, format, &path, Quantity::CarbonFlux).unwrap();
            std::fs::read(path).unwrap()
        };
        for rows in [1, 7] {
            assert!(bytes(30) == bytes(rows), "{format:?} in bands of {rows}");
        }
    }
}

/// More rows than a chunk of NetCDF has, and more cells than rows of Parquet are made at a time.
const LARGE: Grid = Grid {
    rows: 1100,
    cols: 1000,
    north_deg: 55.0,
    west_deg: -50.0,
    dlat_deg: 0.1,
    dlon_deg: 0.1,
};

/// Writes one step of that grid, in which each cell holds its index.
fn large(format: Format, path: &Path) -> Vec<f32> {
    let values: Vec<f32> = (0..LARGE.cell_count()).map(|cell| cell as f32).collect();
    let description = Description {
        grid: LARGE,
        ..description(Quantity::CarbonFlux)
    };
    let mut written = create(format, path, &description, &periods()[..1]).unwrap();
    let bands = values.chunks(420 * LARGE.cols as usize);
    let mut bands = bands.map(<[f32]>::to_vec);
    written.append(periods()[0], &mut bands).unwrap();
    written.finish().unwrap();
    values
}

#[test]
fn a_netcdf_that_is_written_in_parts_has_each_of_them_in_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.nc");
    let values = large(Format::NetCdf, &path);
    let file = hdf5::File::open(&path).unwrap();
    let found: Vec<f32> = file.dataset("carbon_flux").unwrap().read_raw().unwrap();
    assert!(found == values, "a part lies elsewhere");
}

#[test]
fn a_table_that_is_written_in_parts_has_the_place_of_each_cell() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.parquet");
    let values = large(Format::Parquet, &path);
    let (lat, lon) = cube::places(&LARGE);
    let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(&path).unwrap()).unwrap();
    let mut cell = 0;
    for batch in reader.build().unwrap() {
        let batch: RecordBatch = batch.unwrap();
        let places = [2, 3].map(|column| batch.column(column).as_primitive::<Float64Type>());
        let found = batch.column(4).as_primitive::<Float32Type>();
        for row in 0..batch.num_rows() {
            let [own_lat, own_lon] = places.map(|place| place.value(row).to_bits());
            let cols = LARGE.cols as usize;
            assert_eq!(own_lat, lat.centres[cell / cols].to_bits(), "cell {cell}");
            assert_eq!(own_lon, lon.centres[cell % cols].to_bits(), "cell {cell}");
            assert_eq!(
                found.value(row).to_bits(),
                values[cell].to_bits(),
                "cell {cell}"
            );
            cell += 1;
        }
    }
    assert_eq!(cell, LARGE.cell_count());
}
