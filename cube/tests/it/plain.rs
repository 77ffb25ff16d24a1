//! Plain Zarr: whole or not to be opened, and described in one place.

use std::path::Path;

use contract::quantity::Quantity;
use cube::{CubeError, PlainZarr, ZarrVersion};
use serde_json::Value;
use storage::Store;

use crate::product::{description, grid, month, values};

fn metadata(folder: &Path, name: &str) -> Value {
    let file = folder.join(name).join("zarr.json");
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

#[tokio::test]
async fn it_can_be_opened_when_it_is_finished_and_one_document_describes_all() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let description = description(Quantity::AccumulatedCarbon, grid(700, 1500));
    let mut zarr = PlainZarr::create(&store, "", &description, ZarrVersion::Three)
        .await
        .unwrap();
    for number in [1, 3] {
        let put = zarr.append(month(number), values(&description.grid, number));
        put.await.unwrap();
    }
    let late = zarr.append(month(2), values(&description.grid, 2)).await;
    assert!(matches!(late, Err(CubeError::Overlap { .. })), "{late:?}");
    let short = zarr.append(month(4), vec![0.0; 7].into()).await;
    assert!(
        matches!(short, Err(CubeError::Shape { found: 7, .. })),
        "{short:?}"
    );
    assert!(
        !folder.path().join("zarr.json").exists(),
        "half of it can be opened"
    );
    zarr.finish().await.unwrap();
    described(folder.path());
}

/// Each array's own metadata are in the group's too, and say what the conventions ask for.
fn described(folder: &Path) {
    let group = metadata(folder, "");
    let arrays = group["consolidated_metadata"]["metadata"]
        .as_object()
        .unwrap();
    let mut names: Vec<&str> = arrays.keys().map(String::as_str).collect();
    names.sort_unstable();
    let expected = [
        "accumulated_carbon",
        "crs",
        "lat",
        "lat_bnds",
        "lon",
        "lon_bnds",
        "step_start",
        "time",
        "time_bnds",
        "values_sha256",
    ];
    assert_eq!(names, expected);
    for name in names {
        assert_eq!(arrays[name], metadata(folder, name), "{name}");
        // The grid mapping's number is the fill value, which is not stored.
        let has_chunks = folder.join(name).join("c").exists();
        assert!(has_chunks || name == "crs", "{name} has no values");
    }
    let of = |name: &str, attribute: &str| arrays[name]["attributes"][attribute].clone();
    assert_eq!(of("accumulated_carbon", "units"), "kg m-2");
    assert_eq!(
        of("accumulated_carbon", "cell_methods"),
        "area: mean time: sum"
    );
    assert_eq!(of("accumulated_carbon", "grid_mapping"), "crs");
    assert_eq!(of("time", "bounds"), "time_bnds");
    assert_eq!(
        arrays["accumulated_carbon"]["shape"],
        serde_json::json!([2, 700, 1500])
    );
    assert_eq!(
        arrays["accumulated_carbon"]["dimension_names"],
        serde_json::json!(["time", "lat", "lon"])
    );
    assert_eq!(arrays["accumulated_carbon"]["fill_value"], "NaN");
    assert_eq!(group["attributes"]["Conventions"], "CF-1.11");
    // zarr-python understands codecs as objects only, though a name alone is allowed.
    for array in arrays.values() {
        let codecs = array["codecs"].as_array().unwrap();
        assert!(codecs.iter().all(Value::is_object), "{codecs:?}");
        assert_eq!(codecs.last().unwrap()["name"], "crc32c");
    }
    let attributes = serde_json::to_string(arrays).unwrap();
    assert!(
        !attributes.contains("_zarrs"),
        "the library signs what is ours"
    );
}
