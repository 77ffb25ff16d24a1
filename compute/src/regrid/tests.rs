use super::*;
use contract::earth::Earth;
use proptest::prelude::*;

fn grid(rows: u32, cols: u32, north_deg: f64, west_deg: f64, step_deg: f64) -> Grid {
    Grid {
        rows,
        cols,
        north_deg,
        west_deg,
        dlat_deg: step_deg,
        dlon_deg: step_deg,
    }
}

/// Values with gaps that no two cells share.
fn wavy(grid: &Grid) -> Vec<f32> {
    (0..grid.cell_count())
        .map(|index| match index % 11 {
            3 => f32::NAN,
            _ => ((index as f64 * 0.37).sin() * 3e-9 - 1e-9) as f32,
        })
        .collect()
}

/// Integral over the sphere of value x area x coverage, in 64 bits.
fn integral(grid: &Grid, values: &[f64], coverage: &[f64]) -> f64 {
    let cells = values.iter().zip(coverage).enumerate();
    cells
        .filter(|(_, (value, _))| !value.is_nan())
        .map(|(index, (value, coverage))| {
            let row = index as u32 / grid.cols;
            value * coverage * grid.cell_area_m2(row, Earth::Wgs84)
        })
        .sum()
}

fn whole_integral(grid: &Grid, values: &[f32]) -> f64 {
    let values: Vec<f64> = values.iter().map(|&value| value.into()).collect();
    integral(grid, &values, &vec![1.0; values.len()])
}

#[test]
fn conservative_keeps_the_integral_of_the_globe() {
    let source = grid(180, 360, 90.0, -180.0, 1.0);
    let values = wavy(&source);
    let before = whole_integral(&source, &values);
    for target in [
        grid(36, 72, 90.0, -180.0, 5.0),
        grid(720, 1440, 90.0, -180.0, 0.25),
        // Neither edges nor steps in common, begun elsewhere.
        Grid {
            rows: 77,
            cols: 131,
            north_deg: 90.0,
            west_deg: -33.3,
            dlat_deg: 180.0 / 77.0,
            dlon_deg: 360.0 / 131.0,
        },
    ] {
        let out = Regridder::new(&source, &target, Regridding::Conservative)
            .apply(&values)
            .unwrap();
        let after = integral(&target, &out.values, &out.coverage);
        assert!((after / before - 1.0).abs() < 1e-12, "{after} {before}");
        let covered: f64 = integral(&target, &vec![1.0; target.cell_count()], &out.coverage);
        let there: Vec<f32> = values.iter().map(|value| value * 0.0 + 1.0).collect();
        let area = whole_integral(&source, &there);
        assert!((covered / area - 1.0).abs() < 1e-12, "{covered} {area}");
    }
}

#[test]
fn a_cell_of_four_is_their_mean_by_area_and_says_what_it_lacks() {
    let source = grid(2, 2, 60.0, 10.0, 1.0);
    let target = grid(1, 1, 60.0, 10.0, 2.0);
    let regridder = Regridder::new(&source, &target, Regridding::Conservative);
    let [north, south] = [0, 1].map(|row| source.cell_area_m2(row, Earth::Wgs84));
    let whole = regridder.apply(&[1.0, 1.0, 3.0, 3.0]).unwrap();
    let by_hand = (north + 3.0 * south) / (north + south);
    assert!((whole.values[0] - by_hand).abs() < 1e-14);
    assert!((whole.coverage[0] - 1.0).abs() < 1e-14);
    let part = regridder
        .apply(&[1.0, f32::NAN, f32::NAN, f32::NAN])
        .unwrap();
    assert!((part.values[0] - 1.0).abs() < 1e-15);
    assert!((part.coverage[0] - north / (2.0 * (north + south))).abs() < 1e-14);
    let none = regridder.apply(&[f32::NAN; 4]).unwrap();
    assert!(none.values[0].is_nan() && none.coverage[0] == 0.0);
    assert_eq!(regridder.apply(&[1.0; 3]), None);
}

/// A field that is linear in both axes is found again between the centres, whatever the grids.
#[test]
fn bilinear_is_exact_for_what_is_linear() {
    let source = grid(20, 30, 10.0, 160.0, 1.0);
    let linear = |grid: &Grid, row: u32, col: u32| {
        let lat = grid.cell_center(row, col).lat;
        let east = grid.col_west_deg(col) + 0.5 * grid.dlon_deg;
        2.0 * lat - 0.5 * east
    };
    let cells = |grid: &Grid| -> Vec<(u32, u32)> {
        (0..grid.rows)
            .flat_map(|row| (0..grid.cols).map(move |col| (row, col)))
            .collect()
    };
    let values: Vec<f32> = cells(&source)
        .into_iter()
        .map(|(row, col)| linear(&source, row, col) as f32)
        .collect();
    let target = grid(30, 50, 8.0, 163.3, 0.3);
    let out = Regridder::new(&source, &target, Regridding::Bilinear)
        .apply(&values)
        .unwrap();
    for ((row, col), value) in cells(&target).into_iter().zip(&out.values) {
        assert!(
            (value - linear(&target, row, col)).abs() < 1e-5,
            "{row} {col} {value}"
        );
    }
    assert!(out.coverage.iter().all(|it| (it - 1.0).abs() < 1e-12));
}

#[test]
fn round_the_earth_bilinear_goes_over_the_seam_and_outside_there_is_nothing() {
    let globe = grid(2, 4, 90.0, -180.0, 90.0);
    let seam = grid(1, 1, 46.0, 179.0, 2.0);
    let values = [0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 8.0];
    let of = |method, target: &Grid| {
        Regridder::new(&globe, target, method)
            .apply(&values)
            .unwrap()
    };
    // The seam lies half way between the last and the first column.
    assert!((of(Regridding::Bilinear, &seam).values[0] - 4.0).abs() < 1e-12);
    assert!((of(Regridding::Conservative, &seam).values[0] - 4.0).abs() < 1e-12);
    assert!((of(Regridding::Nearest, &seam).values[0] - 0.0).abs() < 1e-12);
    let near = grid(1, 1, 46.0, 178.9, 2.0);
    assert!((of(Regridding::Nearest, &near).values[0] - 8.0).abs() < 1e-12);
    let region = grid(2, 2, 10.0, 0.0, 1.0);
    let elsewhere = grid(3, 3, -40.0, 100.0, 1.0);
    for method in Regridding::ALL {
        let regridder = Regridder::new(&region, &elsewhere, method);
        assert!(!regridder.touches());
        assert!(
            regridder
                .apply(&[1.0; 4])
                .unwrap()
                .values
                .iter()
                .all(|it| it.is_nan())
        );
    }
}

/// Pairs of grids round the earth of which a centre of the target lies a rounding west of the source's first edge.
#[test]
fn a_place_between_two_cells_is_of_the_eastern_one_everywhere() {
    let globe = |cols: u32, west_deg: f64| Grid {
        rows: 2,
        cols,
        north_deg: 90.0,
        west_deg,
        dlat_deg: 90.0,
        dlon_deg: 360.0 / f64::from(cols),
    };
    // Every third centre of the target lies on an edge of the source.
    let (source, target) = (globe(1440, -179.875), globe(4320, -180.0));
    for (col, of) in axis::nearest_cols(&source, &target).iter().enumerate() {
        let thirds = (col as i64 * 2 + 1 - 3).rem_euclid(6 * 1440);
        assert_eq!(of.parts, [((thirds / 6) as u32, 1.0)], "{col}");
    }
}

#[test]
fn no_column_of_a_globe_is_lost_where_rounding_makes_the_first_edge_the_last() {
    let globe = |cols: u32, west_deg: f64| Grid {
        rows: 2,
        cols,
        north_deg: 90.0,
        west_deg,
        dlat_deg: 90.0,
        dlon_deg: 360.0 / f64::from(cols),
    };
    for (cols, west_deg, to_cols) in [
        (1440, -0.125, 4320),
        (144, -1.25, 2160),
        (720, -0.25, 2160),
        (288, -0.625, 4320),
        (192, -0.9375, 8640),
        (4320, -1.0 / 24.0, 4320),
    ] {
        let (source, target) = (globe(cols, west_deg), globe(to_cols, -180.0));
        for of_cols in [axis::nearest_cols, axis::bilinear_cols] {
            let parts = of_cols(&source, &target);
            let empty = parts.iter().position(|of| of.parts.is_empty());
            assert_eq!(empty, None, "{cols} from {west_deg} to {to_cols}");
        }
        // The seam of the source is half way between its last and its first centre.
        let values: Vec<f32> = (0..2 * cols).map(|it| (it % cols) as f32).collect();
        let bilinear = Regridder::new(&source, &target, Regridding::Bilinear);
        let out = bilinear.apply(&values).unwrap();
        let middle = f64::from(cols - 1) / 2.0;
        let at_seam = |value: &f64| (value - middle).abs() < 1e-6;
        let west = |col: u32| (target.col_west_deg(col) + 0.5 * target.dlon_deg - west_deg).abs();
        let seam = (0..to_cols).min_by(|a, b| west(*a).total_cmp(&west(*b)));
        assert!(at_seam(&out.values[seam.unwrap() as usize]), "{cols}");
        assert!(out.coverage.iter().all(|it| (it - 1.0).abs() < 1e-12));
    }
}

proptest! {
    #[test]
    fn any_grids_keep_the_integral_and_no_value_leaves_the_range(
        rows in 1u32..40, cols in 1u32..60, west in -180.0f64..180.0, to_rows in 1u32..50, to_west in -180.0f64..180.0,
    ) {
        let globe = |rows: u32, cols: u32, west_deg: f64| Grid {
            rows, cols, north_deg: 90.0, west_deg,
            dlat_deg: 180.0 / f64::from(rows), dlon_deg: 360.0 / f64::from(cols),
        };
        let (source, target) = (globe(rows, cols, west), globe(to_rows, 2 * to_rows, to_west));
        let values: Vec<f32> = wavy(&source).iter().map(|it| it + 5e-9).collect();
        let before = whole_integral(&source, &values);
        let out = Regridder::new(&source, &target, Regridding::Conservative).apply(&values).unwrap();
        let after = integral(&target, &out.values, &out.coverage);
        prop_assert!(before == 0.0 || (after / before - 1.0).abs() < 1e-12, "{} {}", after, before);
        for method in Regridding::ALL {
            let out = Regridder::new(&source, &target, method).apply(&values).unwrap();
            let inside = |it: &f64| it.is_nan() || (1e-9..=7.1e-9).contains(it);
            prop_assert!(out.values.iter().all(inside));
            prop_assert!(out.coverage.iter().all(|it| (0.0..=1.0 + 1e-9).contains(it)));
        }
    }
}
