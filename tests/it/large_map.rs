//! A map of more cells than are held as one (67.5 million, in bands of rows, in shards, drawn from windows) from its file to windows of all
//! levels, a budget and tiles. Most of it is without data and was never written, so that it lands in seconds.

use std::process::Command;

use harness::program;
use serde_json::Value;

/// A run of the script that makes the file and knows what is in it: what it printed, or what it found otherwise.
fn script(words: &[&str]) -> Result<String, String> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/reference/large_map.py");
    let run = Command::new(test_data::interop_python())
        .args(["-B", script])
        .args(words)
        .output()
        .unwrap();
    if run.status.success() {
        Ok(String::from_utf8(run.stdout).unwrap())
    } else {
        Err(String::from_utf8_lossy(&run.stderr).into_owned())
    }
}

#[test]
fn a_map_of_67_million_cells_lands_and_is_read_counted_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (data, file) = (folder.path().join("data"), path("flux.nc"));
    script(&["make", &file]).unwrap();
    let words = ["ingest", "--product", "flux", &file];
    program::succeed(&data, &words).unwrap();

    // Windows of the map and of its three levels.
    let cube = path("data/objects/cubes/flux");
    let told: Value = serde_json::from_str(&script(&["compare", &cube]).unwrap()).unwrap();
    let compared = told["compared"].as_array().unwrap();
    assert_eq!(compared.len(), 4, "{told}");
    assert!(compared.iter().all(|count| count != 0), "{told}");
    // The comparison sees data in another place.
    let error = script(&["compare", &cube, "5,1"]).unwrap_err();
    assert!(error.contains("other cells have data"), "{error}");

    // A box of 1.5 million cells, which all hold data.
    let region = "--region=-20,40,-5,50";
    let words = ["budget", "--product", "flux", region, "--json"];
    let answer = program::json(&data, &words).unwrap();
    let row = &answer["rows"][0];
    let [found, expected] = [&row["budget_tg"], &told["budget_tg"]].map(|tg| tg.as_f64().unwrap());
    assert!((found / expected - 1.0).abs() < 1e-9, "{row} {told}");
    assert_eq!(row["coverage_percent"], 100.0, "{row}");

    // Tiles across the western edge of the data, from a coarser level and from the map itself: pixels east and west of 20 degrees
    // west, and, of the first one, north of 50 degrees.
    for ([z, x, y], drawn, empty) in [
        (["4", "7", "5"], (200, 200), [(12, 200), (200, 40)]),
        (["9", "227", "184"], (220, 128), [(60, 128), (60, 200)]),
    ] {
        let tile = path("tile.png");
        let layer = [
            "render", "tile", "--layer", "flux", "--mode", "map", "--cpu",
        ];
        let place = ["--z", z, "--x", x, "--y", y, "-o", &tile];
        program::succeed(&data, &[&layer[..], &place].concat()).unwrap();
        let picture = image::open(&tile).unwrap().into_rgba8();
        let alpha = |pixel: (u32, u32)| picture.get_pixel(pixel.0, pixel.1).0[3];
        assert!(alpha(drawn) > 200, "tile {z}/{x}/{y}: {}", alpha(drawn));
        assert_eq!(empty.map(alpha), [0, 0], "tile {z}/{x}/{y}");
    }
}
