//! Weights against the region's own area, against boxes, against each other and against numbers from elsewhere.

use contract::region::{NamedRegion, Polygon};
use proptest::prelude::*;

use super::*;
use crate::region::extent::region_area_m2;

const ONE_DEGREE: Grid = Grid {
    rows: 180,
    cols: 360,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};
/// A grid whose lines are not representable numbers, across the date line.
const PACIFIC: Grid = Grid {
    rows: 150,
    cols: 400,
    north_deg: 20.05,
    west_deg: 160.03,
    dlat_deg: 0.3,
    dlon_deg: 0.1,
};

fn polygon(outer: &[[f64; 2]], holes: Vec<Vec<[f64; 2]>>) -> Region {
    Region::Polygons(vec![Polygon {
        outer: outer.to_vec(),
        holes,
    }])
}

/// Weights as one field, `[row, col]`.
fn field(grid: &Grid, region: &Region) -> Vec<f64> {
    let windows = field_chunks(grid);
    let mut field = vec![0.0; grid.cell_count()];
    for (chunk, areas) in compute(grid, region, Earth::Wgs84).unwrap() {
        for (index, area) in windows[chunk as usize].cell_indices(grid).zip(areas) {
            field[index] = area;
        }
    }
    field
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs())
}

fn worst_difference_in_cells(grid: &Grid, a: &[f64], b: &[f64]) -> f64 {
    let share = |(i, (x, y)): (usize, (&f64, &f64))| {
        (x - y).abs() / grid.cell_area_m2((i / grid.cols as usize) as u32, Earth::Wgs84)
    };
    a.iter().zip(b).enumerate().map(share).fold(0.0, f64::max)
}

/// A polygon with a dent and a hole; areas of its share of some cells of the 1-degree grid in m².
///
/// Independent truth: shapely 2.2 clipped the polygon to each cell in longitude and latitude, cut the edges into pieces
/// of 0.0005 degrees, pyproj 3.7 (PROJ's equal-area cylindrical projection on WGS84) mapped them, shapely took the area.
const CELLS_M2: [(usize, usize, f64); 11] = [
    (32, 179, 6_379_404_646.028_094),
    (34, 177, 1_341_836_260.253_334),
    (35, 181, 2_570_626_769.785_141),
    (35, 183, 0.0),
    (36, 184, 6_841_311_404.275_759),
    (38, 182, 7_532_087_598.093_801),
    (40, 176, 827_021_224.555_480_6),
    (41, 183, 5_912_090_885.687_757),
    (41, 185, 8_217_732_076.120_936),
    (43, 180, 3_038_046_771.071_756),
    (45, 184, 440_865_387.002_973_6),
];
/// Area of the polygon across the date line, found in the same way (about 180 E).
const DATE_LINE_M2: f64 = 2_730_740_707_011.703;

fn dented() -> Region {
    let hole = vec![[1.1, 49.4], [3.6, 48.3], [2.9, 51.2]];
    polygon(
        &[
            [-3.3, 48.2],
            [6.7, 44.1],
            [9.9, 57.3],
            [2.2, 52.6],
            [-1.4, 60.7],
        ],
        vec![hole],
    )
}

#[test]
fn cells_of_a_dented_polygon_have_the_areas_that_another_program_finds() {
    let field = field(&ONE_DEGREE, &dented());
    for (row, col, area_m2) in CELLS_M2 {
        let ours = field[row * 360 + col];
        assert!(
            close(ours, area_m2, 1e-9),
            "{row} {col}: {ours} against {area_m2}"
        );
    }
    let sum: f64 = field.iter().sum();
    assert!(close(sum, 804_720_548_391.53, 1e-9), "{sum}");
}

#[test]
fn a_polygon_across_the_date_line_has_the_area_that_another_program_finds() {
    let corners = [[171.5, -21.3], [188.2, -17.7], [183.1, 3.9], [176.4, -4.2]];
    for grid in [ONE_DEGREE, PACIFIC] {
        let sum: f64 = field(&grid, &polygon(&corners, vec![])).iter().sum();
        assert!(close(sum, DATE_LINE_M2, 1e-9), "{sum}");
    }
    // Cut in two at the date line, as RFC 7946 (section 3.1.9) asks, it is the same.
    let at_180 = |from: [f64; 2], to: [f64; 2]| {
        from[1] + (to[1] - from[1]) * (180.0 - from[0]) / (to[0] - from[0])
    };
    let [a, b, c, d] = corners;
    let (low, high) = (at_180(a, b), at_180(d, c));
    let west = vec![a, [180.0, low], [180.0, high], d];
    let east = vec![
        [-180.0, low],
        [b[0] - 360.0, b[1]],
        [c[0] - 360.0, c[1]],
        [-180.0, high],
    ];
    let halves = Region::Polygons(
        [west, east]
            .map(|outer| Polygon {
                outer,
                holes: vec![],
            })
            .to_vec(),
    );
    let difference = worst_difference_in_cells(
        &ONE_DEGREE,
        &field(&ONE_DEGREE, &halves),
        &field(&ONE_DEGREE, &polygon(&corners, vec![])),
    );
    assert!(difference < 1e-7, "{difference}");
}

#[test]
fn a_box_is_cut_exactly_at_its_edges() {
    let region: Region = "-0.25,10.5,1.5,11.25".parse().unwrap();
    let field = field(&ONE_DEGREE, &region);
    let cell = |row: usize, col: usize| field[row * 360 + col];
    assert!(close(
        cell(78, 179),
        Earth::Wgs84.cell_area_m2(11.0, 11.25, 0.25),
        1e-13
    ));
    assert!(close(
        cell(79, 180),
        Earth::Wgs84.cell_area_m2(10.5, 11.0, 1.0),
        1e-13
    ));
    assert!(close(
        cell(79, 181),
        Earth::Wgs84.cell_area_m2(10.5, 11.0, 0.5),
        1e-13
    ));
    assert_eq!(field.iter().filter(|&&area| area > 0.0).count(), 6);
}

#[test]
fn the_globe_is_every_cell_whole() {
    let field = field(&ONE_DEGREE, &Region::Global);
    for row in 0..180u32 {
        let whole = ONE_DEGREE.cell_area_m2(row, Earth::Wgs84);
        assert!(
            field[row as usize * 360..][..360]
                .iter()
                .all(|area| area.to_bits() == whole.to_bits())
        );
    }
}

#[test]
fn a_polygon_led_over_the_south_pole_is_the_box_south_of_its_latitude() {
    let ring = [
        [-180.0, -62.5],
        [180.0, -62.5],
        [180.0, -90.0],
        [-180.0, -90.0],
    ];
    let round = field(&ONE_DEGREE, &polygon(&ring, vec![]));
    let boxed = field(&ONE_DEGREE, &"-180,-90,180,-62.5".parse().unwrap());
    let difference = worst_difference_in_cells(&ONE_DEGREE, &round, &boxed);
    assert!(difference < 1e-10, "{difference}");
}

#[test]
fn rings_that_repeat_within_one_cell_count_once() {
    let square = Polygon {
        outer: vec![[0.1, 0.1], [0.4, 0.1], [0.4, 0.4], [0.1, 0.4]],
        holes: vec![],
    };
    let once: f64 = field(&ONE_DEGREE, &Region::Polygons(vec![square.clone()]))
        .iter()
        .sum();
    let twice: f64 = field(&ONE_DEGREE, &Region::Polygons(vec![square.clone(), square]))
        .iter()
        .sum();
    assert!(close(once, twice, 1e-8), "{once} {twice}");
}

#[test]
fn the_sea_of_a_region_has_a_key_of_its_own() {
    let ocean = key_of(&ONE_DEGREE, &Region::Global, Earth::Wgs84, &Surface::Ocean);
    assert_ne!(ocean, key(&ONE_DEGREE, &Region::Global, Earth::Wgs84));
}

#[test]
fn the_sea_of_a_cell_is_all_of_it_in_the_open_and_none_inland() {
    let ocean = |region: &str| -> Vec<f64> {
        let windows = field_chunks(&ONE_DEGREE);
        let mut field = vec![0.0; ONE_DEGREE.cell_count()];
        let region = region.parse().unwrap();
        for (chunk, areas) in
            compute_of(&ONE_DEGREE, &region, Earth::Wgs84, &Surface::Ocean, None).unwrap()
        {
            for (index, area) in windows[chunk as usize].cell_indices(&ONE_DEGREE).zip(areas) {
                field[index] = area;
            }
        }
        field
    };
    let globe = ocean("global");
    let at =
        |lon: f64, lat: f64| (89.5 - lat).round() as usize * 360 + (lon + 179.5).round() as usize;
    let whole = |lat: f64| ONE_DEGREE.cell_area_m2((89.5 - lat).round() as u32, Earth::Wgs84);
    assert_eq!(globe[at(-35.5, 25.5)].to_bits(), whole(25.5).to_bits());
    assert_eq!(globe[at(-179.5, -45.5)].to_bits(), whole(-45.5).to_bits());
    assert_eq!(globe[at(10.5, 22.5)].to_bits(), 0f64.to_bits());
    // The cell of Cape Agulhas, 34.83 S 20.00 E.
    let share = globe[at(20.5, -34.5)] / whole(-34.5);
    assert!((0.2..0.8).contains(&share), "{share}");
    // A box is its part of the globe.
    for (index, (boxed, globe)) in ocean("10,-40,30,-30").iter().zip(&globe).enumerate() {
        let (row, col) = (index / 360, index % 360);
        let expected = if (120..130).contains(&row) && (190..210).contains(&col) {
            *globe
        } else {
            0.0
        };
        assert!(
            (boxed - expected).abs() < 1e3,
            "{row} {col}: {boxed} {expected}"
        );
    }
}

#[test]
fn the_equatorial_pacific_lies_between_its_bounds_and_has_its_own_area() {
    let region = NamedRegion::find("equatorial-pacific").unwrap().region();
    let sum: f64 = field(&ONE_DEGREE, &region).iter().sum();
    let own = region_area_m2(&region, Earth::Wgs84).unwrap();
    assert!(close(sum, own, 1e-12), "{sum} {own}");
    assert!((4e13..6e13).contains(&own), "{own}");
}

#[tokio::test]
async fn stored_weights_are_computed_once() {
    let store = Store::memory();
    let region = dented();
    let key = stored(&store, &ONE_DEGREE, &region, Earth::Wgs84)
        .await
        .unwrap()
        .unwrap();
    assert_eq!(
        stored(&store, &ONE_DEGREE, &region, Earth::Wgs84)
            .await
            .unwrap(),
        Some(key.clone())
    );
    let back = storage::weights::read(&store, &key).await.unwrap();
    assert_eq!(back, compute(&ONE_DEGREE, &region, Earth::Wgs84).unwrap());
    let sphere = stored(&store, &ONE_DEGREE, &region, Earth::Sphere)
        .await
        .unwrap();
    assert_ne!(sphere, Some(key));
    let outside = stored(&store, &PACIFIC, &region, Earth::Wgs84)
        .await
        .unwrap();
    assert_eq!(outside, None);
}

/// A star-shaped ring round a centre: it never crosses itself.
fn star() -> impl Strategy<Value = Vec<[f64; 2]>> {
    let radii = proptest::collection::vec(2.0f64..25.0, 3..24);
    (-180.0f64..180.0, -60.0f64..60.0, radii, 0.0f64..1.0).prop_map(|(lon, lat, radii, turn)| {
        let count = radii.len() as f64;
        let corner = |(i, radius): (usize, f64)| {
            let angle = (i as f64 + turn) / count * std::f64::consts::TAU;
            [lon + radius * angle.cos(), lat + radius * angle.sin()]
        };
        radii.into_iter().enumerate().map(corner).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn weights_sum_to_the_regions_own_area(corners in star()) {
        let region = polygon(&corners, vec![]);
        let sum: f64 = field(&ONE_DEGREE, &region).iter().sum();
        let own = region_area_m2(&region, Earth::Wgs84).unwrap();
        prop_assert!(close(sum, own, 1e-10), "{} {}", sum, own);
    }

    #[test]
    fn a_region_and_its_complement_make_the_globe(corners in star()) {
        let lons = |f: fn(f64, f64) -> f64, start| corners.iter().map(|c| c[0]).fold(start, f);
        let (west, east) = (lons(f64::min, f64::INFINITY), lons(f64::max, f64::NEG_INFINITY));
        prop_assume!(east < west + 340.0);
        let (west, east) = (west - 20.0, west + 340.0);
        let world = [[west, -90.0], [east, -90.0], [east, 90.0], [west, 90.0]];
        let inside = field(&ONE_DEGREE, &polygon(&corners, vec![]));
        let outside = field(&ONE_DEGREE, &polygon(&world, vec![corners.clone()]));
        let both: Vec<f64> = inside.iter().zip(&outside).map(|(a, b)| a + b).collect();
        let difference = worst_difference_in_cells(&ONE_DEGREE, &both, &field(&ONE_DEGREE, &Region::Global));
        prop_assert!(difference < 1e-9, "{}", difference);
    }

    #[test]
    fn a_polygon_that_is_a_box_has_the_weights_of_the_box(
        west in -180.0f64..180.0, width in 0.5f64..360.0, south in -90.0f64..80.0, height in 0.5f64..60.0,
    ) {
        let (east, north) = (west + width, (south + height).min(90.0));
        let corners = [[west, south], [east, south], [east, north], [west, north]];
        for grid in [ONE_DEGREE, PACIFIC] {
            let drawn = field(&grid, &polygon(&corners, vec![]));
            let boxed = field(&grid, &Region::Box { west, south, east, north });
            let difference = worst_difference_in_cells(&grid, &drawn, &boxed);
            prop_assert!(difference < 1e-9, "{}", difference);
        }
    }
}

#[tokio::test]
async fn shares_of_a_product_give_the_same_weights_in_bands_of_any_size() {
    let store = Store::memory();
    let share = |cell: usize| (cell * 7919 % 101) as f32 / 100.0;
    let values: Vec<f32> = (0..PACIFIC.cell_count()).map(share).collect();
    let january = contract::time::Period::month(2001, 1).unwrap();
    let product = "mask".parse().unwrap();
    let written = fields::write(&store, &product, &PACIFIC, &values, january);
    let field = written.await.unwrap();
    let region = polygon(&[[170.0, -20.0], [190.0, -22.0], [181.0, 15.0]], vec![]);
    for of in ["land", "sea"] {
        let shares = serde_json::json!({ "frame": field, "of": of });
        let surface = Surface::Shares(serde_json::from_value(shares).unwrap());
        let (shares, awaited) = (Some(&values[..]), &Awaited::always());
        let whole = shared_of(&PACIFIC, &region, Earth::Wgs84, &surface, shares, awaited).unwrap();
        assert!(whole.len() > 4, "{}", whole.len());
        for band_cells in [1, 1 << 30] {
            let workshop = Workshop {
                band_cells,
                ..Workshop::of(&store)
            };
            let found = weighed(workshop, &PACIFIC, &region, Earth::Wgs84, &surface).await;
            assert_eq!(found.unwrap(), whole, "{of} {band_cells}");
        }
    }
}

#[test]
fn weights_that_nobody_waits_for_are_not_computed_to_their_end() {
    let triangle = polygon(&[[170.0, -20.0], [190.0, -22.0], [181.0, 15.0]], vec![]);
    let never = Awaited::never();
    let is_left = |ended: Result<(), ComputeError>| matches!(ended, Err(ComputeError::NotAwaited));
    for region in [
        triangle.clone(),
        Region::Global,
        "150,-20,200,20".parse().unwrap(),
    ] {
        for surface in [Surface::All, Surface::Ocean] {
            let of = |awaited: &Awaited| {
                let found = shared_of(&PACIFIC, &region, Earth::Wgs84, &surface, None, awaited);
                found.map(drop)
            };
            assert!(is_left(of(&never)), "{region:?} {surface:?}");
            of(&Awaited::always()).unwrap();
        }
    }
    // Each of the loops asks, and not the first of them alone.
    assert!(is_left(rings_while(&triangle, &never).map(drop)));
    let rings = rings_while(&triangle, &Awaited::always()).unwrap();
    let band = |awaited: &Awaited| Band::new(&rings, &PACIFIC, 0, Earth::Wgs84, awaited).map(drop);
    assert!(is_left(band(&never)));
    band(&Awaited::always()).unwrap();
    let chunks = |awaited: &Awaited| ring_chunks(&PACIFIC, &rings, Earth::Wgs84, awaited).map(drop);
    assert!(is_left(chunks(&never)));
    chunks(&Awaited::always()).unwrap();
}

#[test]
fn weights_of_polygons_with_corners_along_straight_edges_have_names_of_their_own() {
    let of = |text: &str| polygon_method(&text.parse().unwrap());
    assert_eq!(
        of("POLYGON((-90 20,90 20,90 80,-90 80,-90 20))"),
        POLYGON_METHOD
    );
    assert_eq!(of("POLYGON((0 0,10 1,20 0,10 9,0 0))"), POLYGON_METHOD);
    assert_eq!(of("global"), POLYGON_METHOD);
    for straight in [
        "POLYGON((-90 20,0 20,90 20,90 80,-90 80,-90 20))",
        "POLYGON((0 0,10 0,20 0,10 9,5 4.5,0 0))",
    ] {
        assert_eq!(of(straight), STRAIGHTENED_METHOD, "{straight}");
    }
}
