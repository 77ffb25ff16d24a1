//! Lengths beside closed forms and published ones; the date line, poles, edges of cells.

use super::*;

fn grid(dlat_deg: f64, dlon_deg: f64) -> Grid {
    Grid {
        rows: (180.0 / dlat_deg) as u32,
        cols: (360.0 / dlon_deg) as u32,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg,
        dlon_deg,
    }
}

fn line(text: &str) -> Line {
    text.parse().unwrap()
}

/// Lengths by cell, m, of cells that have any.
fn cells(grid: &Grid, text: &str, earth: Earth) -> BTreeMap<(u32, u32), f64> {
    let windows = field_chunks(grid);
    let mut found = BTreeMap::new();
    for (chunk, lengths) in lengths_m(grid, &line(text), earth).unwrap() {
        let window = windows[chunk as usize];
        for (cell, length) in (0..).zip(lengths).filter(|(_, length)| *length > 0.0) {
            let cell: u32 = cell;
            let place = (
                window.row + cell / window.cols,
                window.col + cell % window.cols,
            );
            found.insert(place, length);
        }
    }
    found
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a / b - 1.0).abs() < relative
}

#[test]
fn lines_have_the_lengths_of_the_books() {
    // Quarter meridian of WGS84, and its equator: NIMA TR8350.2, table 3.
    let quarter = length_m(&line("20,0;20,89.99999999999;20,90"), Earth::Wgs84);
    assert!((quarter - 10_001_965.729).abs() < 0.01, "{quarter}");
    let equator = length_m(&line("0,0;120,0;240,0;0,0"), Earth::Wgs84);
    assert!(close(equator, 40_075_016.686, 1e-10), "{equator}");
    let degree = length_m(&line("7,-30;7,-31"), Earth::Sphere);
    assert!(close(degree, SPHERE_RADIUS_M * 1.0f64.to_radians(), 1e-13));
    // The example of GeographicLib's GeodSolve, a geodesic: no other way between its ends is shorter.
    let flight = length_m(&line("-73.8,40.6;-0.5,51.6"), Earth::Wgs84);
    assert!(
        flight > 5_551_759.4 && close(flight, 5_551_759.4, 1e-5),
        "{flight}"
    );
}

#[test]
fn pieces_in_cells_make_the_whole_line_on_every_figure() {
    let zigzag = "-170,-60;170,20;10,85;-170,80;-100,-89.9;55.5,3.3;55.5,4.4;60,4.4";
    for earth in [Earth::Wgs84, Earth::Sphere, Earth::LocalRadius] {
        for grid in [grid(1.0, 1.0), grid(2.5, 3.75), grid(0.25, 0.25)] {
            let sum: f64 = cells(&grid, zigzag, earth).values().sum();
            assert!(
                close(sum, length_m(&line(zigzag), earth), 1e-9),
                "{sum} {earth}"
            );
        }
    }
}

#[test]
fn along_the_equator_and_a_meridian_every_cell_has_its_share() {
    let one = grid(1.0, 1.0);
    // On the edge between two rows: that south of it. Half of the first and the last cell.
    let equator = cells(&one, "10.5,0;20.5,0", Earth::Sphere);
    assert_eq!(equator.len(), 11);
    let degree = SPHERE_RADIUS_M * 1.0f64.to_radians();
    assert!(equator.keys().all(|(row, _col)| *row == 90));
    assert!(close(equator[&(90, 190)], 0.5 * degree, 1e-9));
    assert!(close(equator[&(90, 195)], degree, 1e-9));
    // On the edge between two columns: that east of it.
    let meridian = cells(&one, "10,-20;10,20", Earth::Sphere);
    assert_eq!(meridian.len(), 40);
    assert!(
        meridian.keys().all(|(_row, col)| *col == 190),
        "{meridian:?}"
    );
}

#[test]
fn the_date_line_and_the_poles_are_crossed_the_short_way() {
    let one = grid(1.0, 1.0);
    let dated = cells(&one, "178.5,10;-178.5,10", Earth::Sphere);
    let cols: Vec<u32> = dated.keys().map(|(_row, col)| *col).collect();
    assert!(cols.contains(&359) && cols.contains(&0) && cols.contains(&1));
    assert!(cols.len() < 10, "{dated:?}");
    // Over the pole from 30 E to 150 W: 20 degrees of latitude.
    let polar = cells(&one, "30.5,80;-149.5,80", Earth::Sphere);
    let degree = SPHERE_RADIUS_M * 1.0f64.to_radians();
    assert!(close(polar.values().sum::<f64>(), 20.0 * degree, 1e-9));
    assert!(close(polar[&(5, 210)], degree, 1e-9) && close(polar[&(5, 30)], degree, 1e-9));
    // A grid that begins at 100 E holds what is written as 179 W.
    let mut regional = grid(1.0, 1.0);
    (regional.west_deg, regional.cols) = (100.0, 100);
    let passing = cells(&regional, "170,0.5;-175,0.5", Earth::Sphere);
    assert_eq!(passing.len(), 15);
    assert!(passing.contains_key(&(89, 84)), "{passing:?}");
}

#[test]
fn a_great_circle_bulges_polewards() {
    // From 60 W to 60 E at 45 N the highest latitude is atan(tan 45 / cos 60) = 63.43 degrees.
    let arc = cells(&grid(1.0, 1.0), "-60,45;60,45", Earth::Sphere);
    let northernmost = arc.keys().map(|(row, _col)| *row).min().unwrap();
    assert_eq!(northernmost, 26);
}

#[test]
fn a_line_inside_a_cell_is_whole_and_one_beyond_the_grid_is_none() {
    let one = grid(1.0, 1.0);
    let inside = cells(&one, "10.1,10.1;10.2,10.3", Earth::Wgs84);
    let whole = length_m(&line("10.1,10.1;10.2,10.3"), Earth::Wgs84);
    assert_eq!(inside.len(), 1);
    assert!(close(inside[&(79, 190)], whole, 1e-12));
    let mut regional = one;
    (regional.west_deg, regional.cols) = (100.0, 30);
    assert!(cells(&regional, "10,10;20,20", Earth::Wgs84).is_empty());
    // What is passed twice counts twice.
    let twice = cells(&one, "10.1,10.1;10.2,10.3;10.1,10.1", Earth::Wgs84);
    assert!(close(twice[&(79, 190)], 2.0 * whole, 1e-12));
}
