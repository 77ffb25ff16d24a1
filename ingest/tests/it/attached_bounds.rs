//! Bounds of the axes of a store of others: those that are there and cannot be read are not taken for none.

use serde_json::json;

use crate::attached::Own;

/// Packs an array by a codec that this program does not have.
fn pack(own: &Own, array: &str) {
    own.edit(&format!("{array}/zarr.json"), |it| {
        let codecs = it["codecs"].as_array_mut().unwrap();
        codecs.push(json!({"name": "numcodecs.pcodec", "configuration": {}}));
    });
}

/// An array of these numbers beside those of the store, as its writer would have it.
fn add(own: &Own, name: &str, shape: &[u64], numbers: &[f64]) {
    let folder = own.path().join(name);
    let chunk = shape
        .iter()
        .fold(folder.join("c"), |path, _| path.join("0"));
    std::fs::create_dir_all(chunk.parent().unwrap()).unwrap();
    let bytes: Vec<u8> = numbers.iter().flat_map(|it| it.to_le_bytes()).collect();
    std::fs::write(chunk, bytes).unwrap();
    let document = json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": "float64",
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": shape}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": "NaN",
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
        "attributes": {},
    });
    std::fs::write(folder.join("zarr.json"), document.to_string()).unwrap();
}

/// The edges of the latitudes of the fixtures, from the south.
fn edges() -> Vec<f64> {
    let row = |row: u32| -75.0 + 30.0 * f64::from(row);
    (0..6)
        .flat_map(|at| [row(at) - 15.0, row(at) + 15.0])
        .collect()
}

/// A store whose latitude names bounds of this shape, which hold the edges of its cells as often as there is room.
fn with_bounds(shape: &[u64]) -> Own {
    let own = Own::with("v3-gzip.zarr");
    own.edit("lat/zarr.json", |it| {
        it["attributes"]["bounds"] = json!("lat_bnds");
    });
    let count: u64 = shape.iter().product();
    let numbers: Vec<f64> = edges().into_iter().cycle().take(count as usize).collect();
    add(&own, "lat_bnds", shape, &numbers);
    own
}

async fn assert_refused(own: &Own, words: &[&str]) {
    let error = own.attach().await.unwrap_err();
    for word in words {
        assert!(error.contains(word), "{word:?}: {error}");
    }
}

#[tokio::test]
async fn bounds_that_cannot_be_read_are_refused_and_those_that_are_not_there_are_told() {
    let own = with_bounds(&[6, 2]);
    let told = own.attach().await.unwrap().assumptions;
    assert!(
        !told.iter().any(|line| line.contains("lat_bnds")),
        "{told:?}"
    );
    pack(&own, "lat_bnds");
    assert_refused(
        &own,
        &[
            "array lat_bnds",
            "pcodec",
            "what lat names as its bounds",
            "the grid in a profile",
        ],
    )
    .await;
    std::fs::remove_dir_all(own.path().join("lat_bnds")).unwrap();
    let told = own.attach().await.unwrap().assumptions;
    let is_told = |line: &String| line.contains("\"lat_bnds\", which are not there");
    assert!(told.iter().any(is_told), "{told:?}");
}

#[tokio::test]
async fn bounds_of_another_shape_or_type_are_refused() {
    let own = with_bounds(&[3, 6]);
    let words = [
        "lat: ",
        "\"lat_bnds\"",
        "not two numbers",
        "float64 of the shape [3, 6]",
    ];
    assert_refused(&own, &words).await;
    let own = with_bounds(&[6, 2]);
    own.edit("lat_bnds/zarr.json", |it| {
        it["data_type"] = json!("complex64");
        it["fill_value"] = json!([0.0, 0.0]);
    });
    assert_refused(&own, &["lat: ", "\"lat_bnds\"", "of another type"]).await;
    let own = Own::with("v3-gzip.zarr");
    own.edit("time_bnds/zarr.json", |it| {
        it["shape"] = json!([3, 3]);
        it["chunk_grid"]["configuration"]["chunk_shape"] = json!([3, 3]);
    });
    assert_refused(&own, &["time: ", "\"time_bnds\"", "the time in a profile"]).await;
}

/// As programs leave them that put files one behind the other.
#[tokio::test]
async fn bounds_that_are_there_once_a_step_are_those_of_the_first() {
    let own = with_bounds(&[3, 6, 2]);
    let told = own.attach().await.unwrap().assumptions;
    let is_told = |line: &String| line.contains("\"lat_bnds\" have more dimensions");
    assert!(told.iter().any(is_told), "{told:?}");
}

#[tokio::test]
async fn times_and_their_bounds_that_cannot_be_read_are_refused() {
    let own = Own::with("v3-gzip.zarr");
    pack(&own, "time_bnds");
    let words = ["array time_bnds", "pcodec", "the time in a profile"];
    assert_refused(&own, &words).await;
    // What the file says of its coverage is not looked at instead of a time that is there.
    let own = Own::with("v3-gzip.zarr");
    for array in ["time", "time_bnds", "sst"] {
        own.edit(&format!("{array}/zarr.json"), |it| {
            it["shape"][0] = json!(1);
        });
    }
    pack(&own, "time");
    own.edit("zarr.json", |it| {
        it["attributes"]["time_coverage_start"] = json!("2021-01-01");
        it["attributes"]["time_coverage_end"] = json!("2021-01-31");
    });
    assert_refused(&own, &["array time:", "pcodec"]).await;
}

#[tokio::test]
async fn an_array_that_nothing_needs_may_be_of_any_kind() {
    let own = Own::with("v3-gzip.zarr");
    add(&own, "depth_bnds", &[6, 2], &edges());
    pack(&own, "depth_bnds");
    // What its axes say is enough, and that nothing more is known is told.
    add(&own, "crs", &[1], &[0.0]);
    pack(&own, "crs");
    own.edit("sst/zarr.json", |it| {
        it["attributes"]["grid_mapping"] = json!("crs");
    });
    let attached = own.attach().await.unwrap();
    let told = "grid_mapping \"crs\" cannot be read";
    assert!(
        attached.steps == 3 && attached.assumptions.iter().any(|own| own.contains(told)),
        "{:?}",
        attached.assumptions
    );
}
