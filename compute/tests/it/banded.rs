//! Bands of latitude and longitude over polygons and codes of masks, and what of little coverage is left out of comparisons.

use compute::analysis;
use compute::region::mask;
use compute::stats::region_series_of;
use compute::{Engine, ErrorClass};
use contract::analysis::{Along, CorrelationQuery, Hovmoller, HovmollerQuery, SeriesQuery};
use contract::earth::Earth;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::region::{AskedRegion, MaskCode};
use contract::series::RegionSeriesQuery;
use contract::statistics::MinCoverage;
use contract::time::{Period, TimeStep};
use storage::Store;

use crate::fixture::{folder_store, land, parts, product};

/// In the open Pacific.
const GRID: Grid = Grid {
    rows: 9,
    cols: 20,
    north_deg: -9.0,
    west_deg: -140.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// Months from 2001 on, a value for each month, row and column.
async fn wind(
    store: &Store,
    name: &str,
    count: u32,
    value: impl Fn(u32, usize, usize) -> f32,
) -> Manifest {
    let month = |month: u32| {
        let period = Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap();
        let cells = 0..GRID.cell_count();
        let values = cells.map(|cell| value(month, cell / 20, cell % 20));
        (period, values.collect())
    };
    let steps: Vec<(Period, Vec<f32>)> = (0..count).map(month).collect();
    land(store, &product(name), Quantity::WindSpeed, GRID, &steps).await
}

fn bands(along: Along, region: AskedRegion) -> HovmollerQuery {
    HovmollerQuery {
        product: product("wind"),
        along,
        band_deg: None,
        region: Some(region),
        step: TimeStep::Native,
        from: None,
        to: None,
        earth: Earth::Wgs84,
        min_coverage: MinCoverage::default(),
    }
}

async fn asked(store: &Store, manifest: &Manifest, query: &HovmollerQuery) -> Hovmoller {
    let engine = Engine::local(store.clone());
    let found = analysis::hovmoller(&engine, (manifest, &manifest.id()), query).await;
    found.unwrap()
}

/// Does it say these bounds: west, south, east, north?
fn is_within(found: &Hovmoller, bounds_deg: [f64; 4]) {
    let edges = found.bounds_deg.iter().zip(bounds_deg);
    let apart = edges.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-9, "{:?} {bounds_deg:?}", found.bounds_deg);
}

fn percent(percent: f64) -> MinCoverage {
    MinCoverage::new(percent).unwrap()
}

/// What of a convex polygon lies above a limit on an axis (0 longitude, 1 latitude), or below it.
fn cut(corners: &[[f64; 2]], axis: usize, limit: f64, is_above: bool) -> Vec<[f64; 2]> {
    let is_in = |at: &[f64; 2]| (at[axis] >= limit) == is_above;
    let next = corners.iter().cycle().skip(1);
    let mut kept = vec![];
    for (from, to) in corners.iter().zip(next) {
        if is_in(from) {
            kept.push(*from);
        }
        if is_in(from) != is_in(to) {
            let share = (limit - from[axis]) / (to[axis] - from[axis]);
            kept.push([0, 1].map(|own| from[own] + share * (to[own] - from[own])));
        }
    }
    kept
}

fn text(corners: &[[f64; 2]]) -> String {
    let closed = corners.iter().chain(corners.first());
    let corners = closed.map(|[lon, lat]| format!("{lon} {lat}"));
    format!("POLYGON(({}))", corners.collect::<Vec<_>>().join(","))
}

#[tokio::test(flavor = "multi_thread")]
async fn bands_of_a_polygon_are_the_means_over_the_polygon_clipped_to_each() {
    let (_folder, store) = folder_store();
    // Row 4 never has data, and of the second month the west is missing.
    let value = |month: u32, row: usize, col: usize| {
        if row == 4 || (month == 1 && col < 9) {
            f32::NAN
        } else {
            (row * row + 3 * col) as f32 + (col % 4) as f32 * month as f32
        }
    };
    let manifest = wind(&store, "wind", 3, value).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let triangle = [[-138.3, -17.8], [-122.7, -16.9], [-130.1, -9.4]];
    for (along, band_deg, axis) in [(Along::Lat, 3.0, 1), (Along::Lon, 2.0, 0)] {
        let query = HovmollerQuery {
            band_deg: Some(band_deg),
            ..bands(along, text(&triangle).parse().unwrap())
        };
        let found = asked(&store, &manifest, &query).await;
        assert_eq!(found.region, Some(text(&triangle)));
        is_within(&found, [-139.0, -18.0, -122.0, -9.0]);
        assert_eq!(found.bands.len(), if axis == 1 { 3 } else { 9 });
        assert!(found.notes.is_empty(), "{:?}", found.notes);
        for (at, band) in found.bands.iter().enumerate() {
            let above = cut(&triangle, axis, band.low_deg, true);
            let clipped = text(&cut(&above, axis, band.high_deg, false));
            let series = RegionSeriesQuery::new(product("wind"), clipped.parse().unwrap());
            let series = region_series_of(&engine, &series, &manifest).await.unwrap();
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs().max(1.0);
            for (row, step) in found.rows.iter().zip(&series.series) {
                assert_eq!(row.start, step.start);
                let same = match (row.means[at], step.mean) {
                    (Some(a), Some(b)) => near(a, b),
                    (a, b) => a == b,
                };
                assert!(same, "{along} {band:?}: {row:?} {step:?}");
                let coverage = row.coverage_percent[at];
                assert!(
                    near(coverage, step.coverage_percent),
                    "{along} {band:?}: {row:?} {step:?}"
                );
            }
            let area = band.region_area_m2.unwrap() / series.region_area_m2;
            assert!(near(area, 1.0), "{along} {band:?}: {area}");
        }
        // Some are covered in part, so that the comparison is one of shares.
        let covered = found.rows.iter().flat_map(|row| &row.coverage_percent);
        assert!(covered.filter(|own| **own > 1.0 && **own < 99.0).count() > 2);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bands_of_a_code_of_a_mask_are_of_its_cells_alone_and_those_between_are_told_to_be_empty() {
    let (_folder, store) = folder_store();
    // Rows 2 to 4 of some columns, and row 7.
    let has_code = |row: usize, col: usize| match row {
        2..=4 => (5..12).contains(&col),
        7 => (9..11).contains(&col),
        _ => false,
    };
    let value = |month: u32, row: usize, col: usize| {
        if has_code(row, col) {
            (10 * row + col) as f32 + month as f32
        } else {
            1e6
        }
    };
    let manifest = wind(&store, "wind", 2, value).await;
    let codes = (0..GRID.cell_count()).map(|cell| {
        let is_one = has_code(cell / 20, cell % 20);
        if is_one { 30.0 } else { 1.0 }
    });
    let step = [(Period::year(2000).unwrap(), codes.collect())];
    let basin = Quantity::open("basin", "1", "Basin").unwrap();
    let basins = land(&store, &product("basins"), basin, GRID, &step).await;
    let region = mask::region(&store, &basins, &MaskCode::Number(30.0)).await;
    let region = region.unwrap();
    let found = asked(&store, &manifest, &bands(Along::Lat, region.clone())).await;
    assert_eq!(found.region.as_deref(), Some(region.name.as_str()));
    is_within(&found, [-135.0, -17.0, -128.0, -11.0]);
    // From the south: row 7, two rows of nothing, rows 4, 3 and 2.
    let by_hand = [Some(79.5), None, None, Some(48.0), Some(38.0), Some(28.0)];
    for (month, row) in found.rows.iter().enumerate() {
        assert_eq!(row.means.len(), by_hand.len());
        for (found, by_hand) in row.means.iter().zip(by_hand) {
            let by_hand = by_hand.map(|own| own + month as f64);
            let is_it = match (found, by_hand) {
                (Some(a), Some(b)) => (a - b).abs() < 1e-6,
                (a, b) => a.is_none() && b.is_none(),
            };
            assert!(is_it, "{row:?}");
        }
    }
    assert_eq!(
        found.notes,
        ["2 of 6 bands hold nothing of the region: they are empty"]
    );
    let areas: Vec<f64> = found
        .bands
        .iter()
        .map(|b| b.region_area_m2.unwrap())
        .collect();
    assert!(
        areas[1] <= 0.0 && areas[2] <= 0.0 && areas[0] > 0.0,
        "{areas:?}"
    );
    let cell_m2 = GRID.cell_area_m2(7, Earth::Wgs84);
    assert!((areas[0] / cell_m2 - 2.0).abs() < 1e-9, "{areas:?}");
    // By longitude: column 9 is in all four rows, column 5 in three.
    let found = asked(&store, &manifest, &bands(Along::Lon, region)).await;
    let mean = |col: usize, rows: &[usize]| {
        let area = |row: usize| GRID.cell_area_m2(row as u32, Earth::Wgs84);
        let sum = rows.iter().map(|row| area(*row) * (10 * row + col) as f64);
        sum.sum::<f64>() / rows.iter().map(|row| area(*row)).sum::<f64>()
    };
    assert_eq!(found.bands.len(), 7);
    for (band, by_hand) in [(0, mean(5, &[2, 3, 4])), (4, mean(9, &[2, 3, 4, 7]))] {
        let found = found.rows[0].means[band].unwrap();
        assert!((found / by_hand - 1.0).abs() < 1e-9, "{found} {by_hand}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_of_a_polygon_lies_beside_the_grid_is_told_and_what_lies_there_alone_is_refused() {
    let (_folder, store) = folder_store();
    let manifest = wind(&store, "wind", 1, |_, row, _| row as f32).await;
    let beyond = "POLYGON((-125 -17,-110 -17,-110 -12,-125 -12,-125 -17))";
    let query = bands(Along::Lat, beyond.parse().unwrap());
    let found = asked(&store, &manifest, &query).await;
    is_within(&found, [-125.0, -17.0, -120.0, -12.0]);
    assert!((found.rows[0].coverage_percent[0] - 100.0).abs() < 1e-6);
    assert_eq!(found.notes.len(), 1, "{:?}", found.notes);
    assert!(
        found.notes[0].contains("lie on the grid"),
        "{:?}",
        found.notes
    );
    let elsewhere = bands(Along::Lat, "POLYGON((0 0,9 0,0 9,0 0))".parse().unwrap());
    let engine = Engine::local(store);
    let refused = analysis::hovmoller(&engine, (&manifest, &manifest.id()), &elsewhere).await;
    let refused = refused.unwrap_err();
    assert_eq!(refused.class(), ErrorClass::BadRequest);
    assert!(refused.to_string().contains("does not touch"), "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn bands_that_are_covered_too_little_are_left_out_and_told_of() {
    let (_folder, store) = folder_store();
    // Half of the second month, and of row 8 a cell alone that ever holds data.
    let value = |month: u32, row: usize, col: usize| {
        if (month == 1 && col < 10) || (row == 8 && col != 15) {
            f32::NAN
        } else {
            row as f32
        }
    };
    let manifest = wind(&store, "wind", 3, value).await;
    let whole = "-140,-18,-120,-9";
    let drawn = "POLYGON((-140 -18,-120 -18,-120 -9,-140 -9,-140 -18))";
    // Of a box coverage is of cells that ever hold data, of a polygon of its sea.
    for (region, out) in [(whole, 8), (drawn, 8 + 3)] {
        let query = HovmollerQuery {
            min_coverage: percent(60.0),
            ..bands(Along::Lat, region.parse().unwrap())
        };
        let found = asked(&store, &manifest, &query).await;
        assert_eq!(found.left_out_count, out, "{region}");
        assert!((found.min_coverage_percent - 60.0).abs() < 1e-12);
        let note = format!("{out} of 27 means have a coverage of less than 60 % and are left out");
        assert_eq!(found.notes, [note]);
        assert!(found.rows[1].means[1..].iter().all(Option::is_none));
        assert!((found.rows[1].coverage_percent[1] - 50.0).abs() < 1.0);
        assert!(found.rows[0].means[1..].iter().all(Option::is_some));
        assert_eq!(found.rows[0].means[0].is_some(), region == whole);
        // The profile has no spread where it has no mean.
        let total = HovmollerQuery {
            step: TimeStep::Total,
            ..query.clone()
        };
        let row = &asked(&store, &manifest, &total).await.rows[0];
        assert_eq!(row.stds[0].is_some(), row.means[0].is_some());
        assert_eq!(row.means[0].is_some(), region == whole);
        let all = HovmollerQuery {
            min_coverage: percent(0.0),
            ..query
        };
        let found = asked(&store, &manifest, &all).await;
        assert_eq!((found.left_out_count, found.notes.len()), (0, 0));
        assert!(
            found
                .rows
                .iter()
                .all(|row| row.means.iter().all(Option::is_some))
        );
    }
}

fn region(name: &str) -> SeriesQuery {
    let own = "-140,-18,-120,-9".parse().unwrap();
    SeriesQuery::Region(RegionSeriesQuery::new(product(name), own))
}

/// Goes to and fro without a season.
fn noise(month: u32) -> f32 {
    (month.wrapping_mul(2_654_435_761) >> 20) as f32 / 409.6
}

#[tokio::test(flavor = "multi_thread")]
async fn steps_that_cover_too_little_are_left_out_of_correlations_and_differences() {
    let (_folder, store) = folder_store();
    // Of every third month a quarter of the cells, and far too high.
    let gappy = |month: u32, _row: usize, col: usize| match (month % 3, col % 4) {
        (2, 1..) => f32::NAN,
        (2, _) => 1000.0 - 40.0 * noise(month),
        _ => noise(month),
    };
    let first = wind(&store, "first", 120, |month, _, _| noise(month)).await;
    let second = wind(&store, "second", 120, gappy).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let (a, b) = (first.id(), second.id());
    let mut query = CorrelationQuery::new(region("first"), product("second"), 0).unwrap();
    let all = analysis::correlation(&engine, (&first, &a), (&second, &b), &query);
    let all = all.await.unwrap();
    assert_eq!((all.left_out_counts, all.rows[0].count), ([0, 0], 120));
    assert!(all.rows[0].correlation.unwrap() < 0.9, "{:?}", all.rows);
    query.min_coverage = percent(50.0);
    let full = analysis::correlation(&engine, (&first, &a), (&second, &b), &query);
    let full = full.await.unwrap();
    assert_eq!((full.left_out_counts, full.rows[0].count), ([0, 40], 80));
    assert!((full.min_coverage_percent - 50.0).abs() < 1e-12);
    assert!(full.rows[0].correlation.unwrap() > 0.999, "{:?}", full.rows);
    let note = "40 of 120 steps hold data over less than 50 % of the region's sea and are left out";
    assert_eq!(full.notes[0], format!("second: {note}"));

    let (of, minus) = (region("second"), region("first"));
    let sides = async |least: MinCoverage| {
        let of = ((&second, &b), &of);
        let minus = ((&first, &a), &minus);
        analysis::difference(&engine, of, minus, least)
            .await
            .unwrap()
    };
    let all = sides(MinCoverage::default()).await;
    assert!(all.difference.unwrap() > 50.0 && all.of.left_out_count == 0);
    let full = sides(percent(50.0)).await;
    assert!(full.difference.unwrap().abs() < 5.0, "{full:?}");
    let counts = [&full.of, &full.minus].map(|side| (side.count, side.left_out_count));
    assert_eq!(counts, [(80, 40), (120, 0)]);
    assert!((full.min_coverage_percent - 50.0).abs() < 1e-12);
    assert_eq!(full.notes[0], format!("of: {note}"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_correlation_with_a_series_that_does_not_vary_says_which_one_it_is() {
    let (_folder, store) = folder_store();
    let wavy = wind(&store, "wavy", 24, |month, _, _| noise(month)).await;
    let calm = wind(&store, "calm", 24, |_, _, _| 0.1).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let (a, b) = (wavy.id(), calm.id());
    let query = CorrelationQuery::new(region("wavy"), product("calm"), 1).unwrap();
    let found = analysis::correlation(&engine, (&wavy, &a), (&calm, &b), &query);
    let found = found.await.unwrap();
    let why = "all 24 values of the second series are equal: a correlation is not defined";
    assert_eq!(found.rows[1].undefined.as_deref(), Some(why));
    assert_eq!(
        (found.rows[1].correlation, found.strongest_lag_steps),
        (None, None)
    );
    assert_eq!(
        found.notes,
        [format!(
            "3 of 3 lags have no correlation, lag 0 for this: {why} (the first is wavy, the second calm)"
        )]
    );
    let query = CorrelationQuery::new(region("calm"), product("wavy"), 0).unwrap();
    let found = analysis::correlation(&engine, (&calm, &b), (&wavy, &a), &query);
    let found = found.await.unwrap().rows;
    let why = found[0].undefined.clone().unwrap();
    assert!(why.contains("24 values of the first series"), "{why}");
}
