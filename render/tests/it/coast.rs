//! The coast lines in the program: what Natural Earth drew, and where real coasts are. `BLESS=1` packs them anew from
//! `ne_110m_coastline.json` and `ne_50m_coastline.json` in the folder `geo_natural_earth_geojson` of the test data:
//! `FLUXGLOBE_TEST_DATA=FOLDER BLESS=1 cargo test -p render-worker --test it coast`.

use contract::job::Mode;
use contract::tile::{mercator_x, mercator_y};
use render::coast::{self, Mask, Place};
use render::plan::Plan;
use serde_json::Value;

use crate::scenes::{FIVE_DEGREES, globe, job, ocean, tile};

/// Largest the lines may be in the program.
const MOST_BYTES: usize = 400_000;

#[expect(clippy::disallowed_methods, reason = "a test's own switches")]
fn switch(variable: &str) -> Option<String> {
    std::env::var(variable)
        .ok()
        .filter(|value| !value.is_empty())
}

/// The lines of a file, corners that are rounded to the same place left out.
fn lines_of(text: &str) -> Vec<Vec<Place>> {
    let file: Value = serde_json::from_str(text).unwrap();
    let mut lines = vec![];
    for feature in file["features"].as_array().unwrap() {
        let geometry = &feature["geometry"];
        let coordinates = geometry["coordinates"].as_array().unwrap();
        match geometry["type"].as_str().unwrap() {
            "LineString" => lines.push(line_of(coordinates)),
            "MultiLineString" => {
                lines.extend(
                    coordinates
                        .iter()
                        .map(|line| line_of(line.as_array().unwrap())),
                );
            }
            other => panic!("{other} is no line"),
        }
    }
    lines
}

fn line_of(coordinates: &[Value]) -> Vec<Place> {
    let degrees = |place: &Value| [0, 1].map(|i| place[i].as_f64().unwrap());
    let mut line: Vec<Place> = coordinates
        .iter()
        .map(|c| Place::near(degrees(c)))
        .collect();
    line.dedup();
    line
}

#[test]
fn the_packed_lines_are_those_of_natural_earth() {
    assert!(coast::packed().len() <= MOST_BYTES);
    let Some(folder) = test_data::set("geo_natural_earth_geojson") else {
        return;
    };
    let scales = ["ne_110m_coastline.json", "ne_50m_coastline.json"]
        .map(|name| lines_of(&std::fs::read_to_string(folder.join(name)).unwrap()));
    let bytes = coast::pack(&scales);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/coast/lines.bin");
    if switch("BLESS").is_some() {
        std::fs::write(path, &bytes).unwrap();
        println!("wrote {path}, {} bytes", bytes.len());
    }
    let is_same = std::fs::read(path).unwrap() == bytes;
    assert!(is_same, "{path} holds other lines; BLESS=1 packs them anew");
}

/// Capes by their surveyed places, and open sea.
const CAPES: [[f64; 2]; 4] = [
    [20.00, -34.83],  // Agulhas
    [-67.29, -55.98], // Horn
    [-9.50, 38.78],   // Roca
    [25.68, 71.17],   // Nordkapp (Nordkinn lies east)
];
const OPEN_SEA: [[f64; 2]; 3] = [[-140.0, -45.0], [-35.0, 25.0], [80.0, -25.0]];

fn corners(px_per_deg: f64) -> impl Iterator<Item = [f64; 2]> {
    let lines = coast::lines(px_per_deg).iter().flatten();
    lines.map(|corner| {
        let lon_deg = corner.normal.x.atan2(corner.normal.y).to_degrees();
        [lon_deg, corner.normal.z.asin().to_degrees()]
    })
}

#[test]
fn lines_run_along_the_capes_and_leave_the_open_sea_alone() {
    for (px_per_deg, within_deg) in [(1.0, 1.5), (10.0, 0.4)] {
        let nearest = |place: [f64; 2]| {
            corners(px_per_deg)
                .map(|[lon, lat]| ((lon - place[0]) * lat.to_radians().cos()).hypot(lat - place[1]))
                .fold(f64::INFINITY, f64::min)
        };
        for cape in CAPES {
            assert!(nearest(cape) < within_deg, "{cape:?}: {}", nearest(cape));
        }
        for sea in OPEN_SEA {
            assert!(nearest(sea) > 5.0, "{sea:?}: {}", nearest(sea));
        }
    }
    let (coarse, fine) = (corners(1.0).count(), corners(10.0).count());
    assert!(fine > 5 * coarse && coarse > 1000, "{coarse} {fine}");
}

#[test]
fn a_cape_is_where_it_belongs_on_a_tile() {
    let scene = ocean(FIVE_DEGREES);
    let mut job = job(Mode::Volume, tile(5, 17, 19, 256));
    job.style.context.coastlines = true;
    let plan = Plan::for_device(&job, &scene, u64::MAX).unwrap();
    let covered = |lon: f64, lat: f64| {
        let px = |share: f64, index: f64| (share * 256.0 * 32.0 - index * 256.0) as i32;
        let (x, y) = (px(mercator_x(lon), 17.0), px(mercator_y(lat), 19.0));
        let around = (-6..=6).flat_map(|down| (-6..=6).map(move |across| [x + across, y + down]));
        around
            .filter(|place| place.iter().all(|px| (0..256).contains(px)))
            .map(|place| Mask::at(&plan.coast, 256, place.map(|px| px as u32)))
            .max()
            .unwrap()
    };
    assert!(covered(20.0, -34.83) > 200);
    assert_eq!(covered(14.0, -38.0), 0);
}

#[test]
fn lines_beyond_the_horizon_are_hidden() {
    let scene = ocean(FIVE_DEGREES);
    // Above the middle of the Pacific, from a height that shows half of the earth: some lines are before the horizon,
    // none beyond it.
    let mut job = job(Mode::Volume, globe(-140.0, 0.0, 1.5e7, 400));
    job.style.context.coastlines = true;
    let plan = Plan::for_device(&job, &scene, u64::MAX).unwrap();
    let places = || (0..400).flat_map(|y| (0..400).map(move |x| [x, y]));
    let covered: Vec<_> = places()
        .filter(|[x, y]| plan.coast[(y * 400 + x) as usize] >> 16 & 255 > 0)
        .collect();
    // The disc's radius: focal length times the tangent of the angle to the horizon.
    let distance: f64 = 1.0 + 1.5e7 / 6.371e6;
    let radius_px = 200.0 / 22.5f64.to_radians().tan() / (distance * distance - 1.0).sqrt();
    let from_middle = |[x, y]: [u32; 2]| (f64::from(x) - 199.5).hypot(f64::from(y) - 199.5);
    assert!(covered.len() > 500, "{}", covered.len());
    for place in &covered {
        assert!(from_middle(*place) < radius_px + 1.5, "{place:?}");
    }
    // The middle of the disc is open sea: Africa, behind it, must not show through.
    let in_the_middle = covered
        .iter()
        .filter(|place| from_middle(**place) < 0.25 * radius_px);
    let count = in_the_middle.count();
    assert!(count < 60, "{count} pixels of lines in the open sea");
}
