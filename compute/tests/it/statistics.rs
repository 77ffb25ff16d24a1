//! Statistics over geometries beside sums that share no code with them, and the same bits however they are computed.

use std::collections::BTreeMap;

use compute::Engine;
use compute::reduce::statistics;
use compute::region::weights;
use contract::chunk::field_chunks;
use contract::earth::Earth;
use contract::geometry::{AskedGeometry, Sampling};
use contract::grid::{Grid, LonLatDeg};
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::statistics::{StatisticsAnswer, StatisticsQuery};
use contract::time::{Period, TimeStep};
use storage::Store;

use crate::fixture::{folder_store, land, parts, product, wavy_year};

/// Cells of 2.5 degrees: neither chunks nor blocks fit it.
const GRID: Grid = Grid {
    rows: 72,
    cols: 144,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 2.5,
    dlon_deg: 2.5,
};
pub(crate) const POLYGON: &str =
    "POLYGON((-60 -33.3,80 -41,120.5 20,33 61,-60 -33.3),(0 0,20 1,20 20,0 0))";

async fn landed() -> (tempfile::TempDir, Store, Manifest, Vec<(Period, Vec<f32>)>) {
    let (folder, store) = folder_store();
    let steps = wavy_year(&GRID);
    let manifest = land(&store, &product("wavy"), Quantity::CarbonFlux, GRID, &steps).await;
    (folder, store, manifest, steps)
}

pub(crate) fn area(region: &str) -> AskedGeometry {
    region
        .parse::<contract::region::AskedRegion>()
        .unwrap()
        .into()
}

pub(crate) fn asked(geometry: AskedGeometry, statistics: &str, step: TimeStep) -> StatisticsQuery {
    StatisticsQuery {
        statistics: statistics.parse().unwrap(),
        step,
        ..StatisticsQuery::new(product("wavy"), geometry)
    }
}

/// Values, stored unit, with their weights, of some steps.
fn weighed(
    steps: &[(Period, Vec<f32>)],
    weights: &[(u32, Vec<f64>)],
    grid: &Grid,
) -> Vec<(f32, f64)> {
    let windows = field_chunks(grid);
    let mut all = vec![];
    for (period, values) in steps {
        for (chunk, areas) in weights {
            for (cell, area) in windows[*chunk as usize].cell_indices(grid).zip(areas) {
                if *area > 0.0 && !values[cell].is_nan() {
                    all.push((values[cell], area * period.seconds()));
                }
            }
        }
    }
    all
}

/// Mean, standard deviation, and a percentile as the smallest value with so much weight at or below it.
fn plain(all: &[(f32, f64)], percent: f64) -> [f64; 3] {
    let weight: f64 = all.iter().map(|(_, w)| w).sum();
    let mean = all.iter().map(|(v, w)| f64::from(*v) * w).sum::<f64>() / weight;
    let variance = all
        .iter()
        .map(|(v, w)| (f64::from(*v) - mean).powi(2) * w)
        .sum::<f64>()
        / weight;
    let mut sorted = all.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut below = 0.0;
    let found = sorted.iter().find(|(_, w)| {
        below += w;
        below >= weight * percent / 100.0
    });
    [mean, variance.sqrt(), f64::from(found.unwrap().0)]
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs().max(1e-3)
}

fn value(answer: &StatisticsAnswer, row: usize, name: &str) -> f64 {
    answer.rows[row].values[name].unwrap_or_else(|| panic!("{name}: {:?}", answer.rows[row]))
}

#[tokio::test(flavor = "multi_thread")]
async fn statistics_of_a_polygon_are_those_of_plain_sums() {
    let (_folder, store, _manifest, steps) = landed().await;
    let engine = Engine::in_process(store, parts(2));
    let weights = weights::compute(&GRID, &POLYGON.parse().unwrap(), Earth::Wgs84).unwrap();
    let display = Quantity::CarbonFlux.display();
    let seasons: [&[usize]; 5] = [&[0, 1], &[2, 3, 4], &[5, 6, 7], &[8, 9, 10], &[11]];
    for (step, bins) in [
        (TimeStep::Native, (0..12).map(|i| vec![i]).collect()),
        (TimeStep::Season, seasons.map(<[usize]>::to_vec).to_vec()),
        (TimeStep::Total, vec![(0..12).collect::<Vec<_>>()]),
    ] {
        let query = asked(
            area(POLYGON),
            "mean,std,p90,median,min,max,count,sum,coverage",
            step,
        );
        let answer = statistics(&engine, &query).await.unwrap();
        assert_eq!(answer.rows.len(), bins.len(), "{step}");
        for (row, bin) in bins.iter().enumerate() {
            let own: Vec<_> = bin.iter().map(|i| steps[*i].clone()).collect();
            let all = weighed(&own, &weights, &GRID);
            let [mean, std, p90] = plain(&all, 90.0).map(|own| own * display.factor);
            assert!(close(value(&answer, row, "mean"), mean), "{step} {row}");
            assert!(close(value(&answer, row, "std"), std), "{step} {row}");
            assert!(close(value(&answer, row, "p90"), p90), "{step} {row}");
            let median = plain(&all, 50.0)[2] * display.factor;
            assert!(close(value(&answer, row, "median"), median), "{step} {row}");
            assert_eq!(value(&answer, row, "count") as usize, all.len());
            let values = || {
                all.iter()
                    .map(|(value, _)| f64::from(*value) * display.factor)
            };
            let min = values().fold(f64::INFINITY, f64::min);
            assert!(close(value(&answer, row, "min"), min));
            let seconds: f64 = own.iter().map(|(period, _)| period.seconds()).sum();
            let integral: f64 =
                all.iter().map(|(v, w)| f64::from(*v) * w).sum::<f64>() / seconds * display.factor;
            assert!((value(&answer, row, "sum") / integral - 1.0).abs() < 1e-9);
            // The first step that holds the largest value.
            let largest = |at: &usize| {
                let own = weighed(&steps[*at..=*at], &weights, &GRID);
                own.iter()
                    .map(|(v, _)| *v)
                    .fold(f32::NEG_INFINITY, f32::max)
            };
            let max = bin.iter().map(largest).fold(f32::NEG_INFINITY, f32::max);
            let first = bin
                .iter()
                .find(|at| largest(at).to_bits() == max.to_bits())
                .unwrap();
            assert_eq!(answer.rows[row].found_at["max"], steps[*first].0.mid());
            let coverage = value(&answer, row, "coverage");
            assert_eq!(
                coverage.to_bits(),
                answer.rows[row].coverage_percent.to_bits()
            );
            assert!((40.0..100.0).contains(&coverage), "{coverage}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn means_and_coverage_are_those_of_the_series_that_was_always_given() {
    let (_folder, store, _manifest, _steps) = landed().await;
    let engine = Engine::in_process(store, parts(2));
    // The last of them is ten metres wide.
    for region in [
        "global",
        POLYGON,
        "170.5,-33.3,-120.1,12.7",
        "-148.7001,-16.2001,-148.7,-16.2",
    ] {
        let query = asked(area(region), "mean", TimeStep::Native);
        let answer = statistics(&engine, &query).await.unwrap();
        let series =
            contract::series::RegionSeriesQuery::new(product("wavy"), region.parse().unwrap());
        let series = compute::stats::region_series(&engine, &series)
            .await
            .unwrap();
        assert_eq!(answer.size.to_bits(), series.region_area_m2.to_bits());
        for (row, own) in answer.rows.iter().zip(&series.series) {
            assert!(close(row.values["mean"].unwrap(), own.mean.unwrap()));
            assert!((row.coverage_percent - own.coverage_percent).abs() < 1e-6);
        }
    }
}

/// Of what nothing is built in for, values may be of any size: on cells of 280 km sums in steps of 1e-9 held neither.
#[tokio::test(flavor = "multi_thread")]
async fn series_of_open_quantities_are_their_means_however_small_or_large_these_are() {
    let (_folder, store) = folder_store();
    let quantity = Quantity::open("deposition", "kg m-2 s-1", "Deposition").unwrap();
    let of_one = wavy_year(&GRID);
    let engine = Engine::in_process(store.clone(), parts(2));
    let weights = weights::compute(&GRID, &POLYGON.parse().unwrap(), Earth::Wgs84).unwrap();
    for (name, factor) in [("small", 1e-22), ("usual", 1.0), ("large", 1e22)] {
        let scaled = |value: &f32| (f64::from(*value) / 1e-9 * factor) as f32;
        let steps: Vec<(Period, Vec<f32>)> = of_one
            .iter()
            .map(|(period, values)| (*period, values.iter().map(scaled).collect()))
            .collect();
        land(&store, &product(name), quantity, GRID, &steps).await;
        let asked_region = POLYGON.parse().unwrap();
        let series = contract::series::RegionSeriesQuery::new(product(name), asked_region);
        let series = compute::stats::region_series(&engine, &series).await;
        let series = series.unwrap();
        let query = StatisticsQuery {
            product: product(name),
            ..asked(area(POLYGON), "mean", TimeStep::Native)
        };
        let answer = statistics(&engine, &query).await.unwrap();
        assert_eq!(answer.size.to_bits(), series.region_area_m2.to_bits());
        assert_eq!(series.series.len(), 12);
        let all = answer.rows.iter().zip(&series.series).zip(&steps);
        for ((row, own), step) in all {
            let mean = own.mean.unwrap();
            assert_eq!(row.values["mean"].map(f64::to_bits), Some(mean.to_bits()));
            let held = weighed(std::slice::from_ref(step), &weights, &GRID);
            assert!((mean / plain(&held, 50.0)[0] - 1.0).abs() < 1e-6, "{own:?}");
            let area_m2 = held.iter().map(|(_, weight)| weight).sum::<f64>() / step.0.seconds();
            assert!((own.area_m2 / area_m2 - 1.0).abs() < 1e-9, "{own:?}");
            assert!((row.coverage_percent - own.coverage_percent).abs() < 1e-6);
        }
    }
}

/// Steps of an open quantity, each a hundredth of the one before: in one scale the last ones would be nothing beside the first.
#[tokio::test(flavor = "multi_thread")]
async fn steps_far_smaller_than_others_have_their_own_means_and_the_same_bits_in_any_parts() {
    let (_folder, store) = folder_store();
    let quantity = Quantity::open("deposition", "kg m-2 s-1", "Deposition").unwrap();
    let mut steps = wavy_year(&GRID);
    for (at, (_period, values)) in steps.iter_mut().enumerate() {
        let factor = 0.01f64.powi(at as i32) / 1e-9;
        let scaled = |value: &mut f32| *value = (f64::from(*value) * factor) as f32;
        values.iter_mut().for_each(scaled);
    }
    land(&store, &product("wavy"), quantity, GRID, &steps).await;
    let weights = weights::compute(&GRID, &POLYGON.parse().unwrap(), Earth::Wgs84).unwrap();
    let query = asked(area(POLYGON), "mean,std,max", TimeStep::Month);
    let local = Engine::local(store.clone());
    let answer = statistics(&local, &query).await.unwrap();
    let region = POLYGON.parse().unwrap();
    let series = contract::series::RegionSeriesQuery::new(product("wavy"), region);
    let series = compute::stats::region_series(&local, &series).await;
    let series = series.unwrap().series;
    assert_eq!((answer.rows.len(), series.len()), (12, 12));
    for ((row, own), step) in answer.rows.iter().zip(&series).zip(&steps) {
        let held = weighed(std::slice::from_ref(step), &weights, &GRID);
        let weight: f64 = held.iter().map(|(_, weight)| weight).sum();
        let mean_of = |of: &dyn Fn(f64) -> f64| {
            let each = held.iter();
            let each = each.map(|(value, weight)| of(f64::from(*value)) * weight);
            each.sum::<f64>() / weight
        };
        let mean = mean_of(&|value| value);
        let std = mean_of(&|value| (value - mean).powi(2)).sqrt();
        for (name, right) in [("mean", mean), ("std", std)] {
            let found = row.values[name].unwrap();
            assert!((found / right - 1.0).abs() < 1e-6, "{name} {row:?} {right}");
        }
        // Each is rounded in a scale of its own choice.
        assert!((own.mean.unwrap() / row.values["mean"].unwrap() - 1.0).abs() < 1e-9);
    }
    // A mean of all steps is that of the large ones.
    let all = StatisticsQuery {
        step: TimeStep::Total,
        ..query.clone()
    };
    let of_all = statistics(&local, &all).await.unwrap();
    let right = plain(&weighed(&steps, &weights, &GRID), 50.0)[0];
    assert!((of_all.rows[0].values["mean"].unwrap() / right - 1.0).abs() < 1e-6);
    let ballista = [1, 2, 7].map(|count| Engine::standalone(store.clone(), parts(count)));
    let in_process = [2, 7].map(|count| Engine::in_process(store.clone(), parts(count)));
    for engine in in_process.into_iter().chain(ballista) {
        assert!(statistics(&engine, &query).await.unwrap() == answer);
    }
}

/// Carbon that has just begun to accumulate: in the scale of what it may come to, ten thousandths of it were lost.
#[tokio::test(flavor = "multi_thread")]
async fn first_sums_of_accumulated_carbon_have_their_means_however_small_they_are() {
    let (_folder, store) = folder_store();
    let mut steps = wavy_year(&GRID);
    for (at, (_period, values)) in steps.iter_mut().enumerate() {
        let factor = 10f64.powi(at as i32 - 9) / 1e-9;
        let scaled = |value: &mut f32| *value = (f64::from(*value) * factor) as f32;
        values.iter_mut().for_each(scaled);
    }
    let quantity = Quantity::AccumulatedCarbon;
    land(&store, &product("wavy"), quantity, GRID, &steps).await;
    let weights = weights::compute(&GRID, &POLYGON.parse().unwrap(), Earth::Wgs84).unwrap();
    let display = quantity.display();
    let engine = Engine::in_process(store.clone(), parts(2));
    let query = asked(area(POLYGON), "mean", TimeStep::Native);
    let answer = statistics(&engine, &query).await.unwrap();
    assert_eq!(answer.rows.len(), 12);
    for (at, step) in steps.iter().enumerate() {
        let held = weighed(std::slice::from_ref(step), &weights, &GRID);
        let right = plain(&held, 50.0)[0] * display.factor;
        let found = value(&answer, at, "mean");
        assert!((found / right - 1.0).abs() < 1e-6, "{at}: {found} {right}");
    }
    // In one cell nothing levels what is rounded.
    let place = LonLatDeg::new(171.3, -40.2).unwrap();
    let (row, col) = GRID.cell_at(place).unwrap();
    let cell = (row * GRID.cols + col) as usize;
    let query = asked(
        AskedGeometry::point(place, Sampling::Cell),
        "mean,std",
        TimeStep::Native,
    );
    let answer = statistics(&engine, &query).await.unwrap();
    let held = steps.iter().enumerate();
    let held: Vec<_> = held.filter(|(_, step)| !step.1[cell].is_nan()).collect();
    assert!(held.len() > 6 && held[0].0 < 3, "{held:?}");
    for (at, (_period, values)) in held {
        let right = f64::from(values[cell]) * display.factor;
        let found = value(&answer, at, "mean");
        assert!((found / right - 1.0).abs() < 1e-6, "{at}: {found} {right}");
        assert_eq!(answer.rows[at].values["std"], Some(0.0));
    }
    for count in [1, 7] {
        let other = Engine::standalone(store.clone(), parts(count));
        assert!(statistics(&other, &query).await.unwrap() == answer);
    }
}

/// Answers to some questions.
async fn answers(engine: &Engine) -> Vec<StatisticsAnswer> {
    let place = LonLatDeg::new(171.3, -40.2).unwrap();
    let line = "170.5,-33.3;-120.1,12.7;-100,85;80,80";
    let mut all = vec![];
    for (geometry, step) in [
        (area("global"), TimeStep::Month),
        (area(POLYGON), TimeStep::Total),
        (area(POLYGON), TimeStep::Week),
        (AskedGeometry::line(line).unwrap(), TimeStep::Season),
        (
            AskedGeometry::point(place, Sampling::Bilinear),
            TimeStep::Native,
        ),
    ] {
        let query = asked(geometry, "mean,std,min,max,sum,p10,p97.5,count", step);
        all.push(statistics(engine, &query).await.unwrap());
    }
    all
}

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_parts_gives_the_same_bits_with_ballista_and_without() {
    let (_folder, store, _manifest, _steps) = landed().await;
    let right = answers(&Engine::local(store.clone())).await;
    assert_eq!(right[0].rows.len(), 12);
    let ballista = [1, 2, 7].map(|count| Engine::standalone(store.clone(), parts(count)));
    let in_process = [2, 7].map(|count| Engine::in_process(store.clone(), parts(count)));
    for engine in in_process.into_iter().chain(ballista) {
        assert!(answers(&engine).await == right);
    }
    // The comparison sees the last bit of one value.
    let mut planted = right.clone();
    let values: &mut BTreeMap<_, _> = &mut planted[2].rows[7].values;
    let mean = values.get_mut("mean").unwrap().as_mut().unwrap();
    *mean = mean.next_up();
    assert!(planted != right);
}

#[tokio::test(flavor = "multi_thread")]
async fn values_of_fields_and_along_time_are_the_same() {
    let (_folder, store) = folder_store();
    // One complete run of the time-major copy, and steps that are in none.
    let months = (0..140u32).map(|month| Period::month(1990 + month as i32 / 12, month % 12 + 1));
    let year = wavy_year(&GRID);
    let steps: Vec<(Period, Vec<f32>)> = months
        .zip(year.iter().cycle())
        .map(|(period, (_, values))| (period.unwrap(), values.clone()))
        .collect();
    let id = product("wavy");
    let manifest = land(&store, &id, Quantity::CarbonFlux, GRID, &steps).await;
    let geometries = [
        area(POLYGON),
        AskedGeometry::line("170,-33;-120,12").unwrap(),
    ];
    let of = async |geometry: &AskedGeometry| {
        let engine = Engine::in_process(store.clone(), parts(2));
        let values = engine.values(&manifest, &manifest.id()).await.unwrap();
        let query = asked(geometry.clone(), "mean,std,p90,min", TimeStep::Season);
        let answer =
            compute::reduce::statistics_of(&engine, &query, &manifest, manifest.id()).await;
        (answer.unwrap().rows, values.time_major().len())
    };
    let mut fields = vec![];
    for geometry in &geometries {
        fields.push(of(geometry).await);
        assert_eq!(fields[fields.len() - 1].1, 0);
    }
    cube::follow(&store, &manifest).await.unwrap();
    assert_eq!(cube::compact(&store, "cubes/wavy").await.unwrap(), 1);
    for (geometry, (rows, _)) in geometries.iter().zip(&fields) {
        let (along_time, runs) = of(geometry).await;
        assert_eq!(runs, 1);
        assert!(along_time.len() > 40);
        assert!(along_time == *rows);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_point_is_its_cell_and_four_cells_are_weighed() {
    let (_folder, store, _manifest, steps) = landed().await;
    let engine = Engine::local(store);
    let place = LonLatDeg::new(11.0, 21.0).unwrap();
    let of = async |sampling| {
        let asked = asked(
            AskedGeometry::point(place, sampling),
            "mean,count",
            TimeStep::Native,
        );
        statistics(&engine, &asked).await.unwrap().rows
    };
    let (row, col) = GRID.cell_at(place).unwrap();
    let at = |step: usize, row: u32, col: u32| steps[step].1[(row * GRID.cols + col) as usize];
    let factor = Quantity::CarbonFlux.display().factor;
    for (step, own) in of(Sampling::Cell).await.iter().enumerate() {
        let value = at(step, row, col);
        match own.values["mean"] {
            Some(mean) => assert!(close(mean, f64::from(value) * factor)),
            None => assert!(value.is_nan() && own.coverage_percent < 1e-12),
        }
    }
    // 21 N lies 0.1 of a row below the centre of its row, 11 E 0.1 of a column west of its.
    let four = [
        (row, col, 0.81),
        (row + 1, col, 0.09),
        (row, col - 1, 0.09),
        (row + 1, col - 1, 0.01),
    ];
    for (step, own) in of(Sampling::Bilinear).await.iter().enumerate() {
        let there = four
            .iter()
            .filter(|(row, col, _)| !at(step, *row, *col).is_nan());
        let weight: f64 = there.clone().map(|(_, _, weight)| weight).sum();
        let sum: f64 = there
            .map(|(row, col, weight)| f64::from(at(step, *row, *col)) * weight)
            .sum();
        if weight > 0.0 {
            assert!(
                close(own.values["mean"].unwrap(), sum / weight * factor),
                "{step}"
            );
        }
        assert!(
            (own.coverage_percent - 100.0 * weight).abs() < 1e-6,
            "{step}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_row_says_what_is_missing_and_too_little_is_withheld() {
    let (_folder, store, _manifest, _steps) = landed().await;
    let engine = Engine::in_process(store, parts(2));
    let ask = async |from: &str, to: &str, least: &str| {
        let query = StatisticsQuery {
            from: from.parse().ok(),
            to: to.parse().ok(),
            min_coverage: least.parse().unwrap(),
            ..asked(area(POLYGON), "mean,min,count,coverage", TimeStep::Month)
        };
        statistics(&engine, &query).await.unwrap().rows
    };
    // The data end with the year: of February and March 2001 there is nothing, of January's row neither.
    let rows = ask("2000-11-16", "2001-02-10", "0").await;
    assert_eq!(rows.len(), 4);
    assert_eq!(rows[0].start, "2000-11-16".parse().unwrap());
    assert!(rows[0].values["mean"].is_some());
    for row in &rows[2..] {
        assert_eq!((row.step_count, row.values["mean"]), (0, None));
        assert_eq!(
            (row.values["count"], row.values["coverage"]),
            (Some(0.0), Some(0.0))
        );
        assert!(!row.is_withheld);
    }
    let all = ask("2000-01", "2001-01", "0").await;
    let most = all
        .iter()
        .map(|row| row.coverage_percent)
        .fold(0.0, f64::max);
    let withheld = ask("2000-01", "2001-01", &most.to_string()).await;
    assert!(withheld.iter().filter(|row| row.is_withheld).count() >= 8);
    for (row, own) in all.iter().zip(&withheld) {
        assert_eq!(own.is_withheld, row.coverage_percent < most);
        assert_eq!(own.values["mean"].is_none(), own.is_withheld);
        assert_eq!(own.found_at.is_empty(), own.is_withheld);
        assert_eq!(own.values["count"], row.values["count"]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_step_that_lies_across_two_rows_counts_in_both_by_its_time() {
    let (_folder, store) = folder_store();
    let period =
        |from: &str, to: &str| Period::new(from.parse().unwrap(), to.parse().unwrap()).unwrap();
    let constant = |value: f32| vec![value; GRID.cell_count()];
    let steps = [
        (period("2000-01-28", "2000-02-05"), constant(1e-9)),
        (period("2000-02-05", "2000-02-13"), constant(4e-9)),
    ];
    land(&store, &product("wavy"), Quantity::CarbonFlux, GRID, &steps).await;
    let query = asked(area("-40,-20,-10,10"), "mean,min,max,std", TimeStep::Month);
    let answer = statistics(&Engine::local(store), &query).await.unwrap();
    let factor = Quantity::CarbonFlux.display().factor;
    let of = |row: usize, name: &str| value(&answer, row, name) / factor / 1e-9;
    assert!((of(0, "mean") - 1.0).abs() < 1e-6);
    // Four days of 1 and eight of 4.
    assert!((of(1, "mean") - 3.0).abs() < 1e-6, "{}", of(1, "mean"));
    assert!((of(1, "std") - 2f64.sqrt()).abs() < 1e-6);
    assert!((of(1, "min") - 1.0).abs() < 1e-6 && (of(1, "max") - 4.0).abs() < 1e-6);
}

/// Squares of all that a flux can be have steps in which values that are equal, or nearly so, are not: 0.001 g C m⁻² yr⁻¹ of nothing.
#[tokio::test(flavor = "multi_thread")]
async fn equal_values_have_no_deviation_and_those_that_differ_by_little_have_theirs() {
    let (_folder, store) = folder_store();
    let month = |month: u32| Period::month(2001, month).unwrap();
    let steps: Vec<(Period, Vec<f32>)> = (1..=12)
        .map(|at| {
            let around = 1.3e-9 * (at as f32).sqrt();
            let apart = if at > 8 { 1e-14 * (at as f32) } else { 0.0 };
            let value = |cell: usize| around + apart * (cell % 5) as f32;
            (month(at), (0..GRID.cell_count()).map(value).collect())
        })
        .collect();
    land(&store, &product("wavy"), Quantity::CarbonFlux, GRID, &steps).await;
    let query = asked(area("-40,-20,-10,10"), "std,mean", TimeStep::Native);
    let answer = statistics(&Engine::local(store.clone()), &query).await;
    let answer = answer.unwrap();
    let in_parts = Engine::in_process(store.clone(), parts(3));
    let other = statistics(&in_parts, &query).await.unwrap();
    let region = "-40,-20,-10,10".parse().unwrap();
    let weights = weights::compute(&GRID, &region, Earth::Wgs84).unwrap();
    let factor = Quantity::CarbonFlux.display().factor;
    for (row, step) in steps.iter().enumerate() {
        let std = value(&answer, row, "std");
        assert_eq!(std.to_bits(), value(&other, row, "std").to_bits());
        if row < 8 {
            assert_eq!(std.to_bits(), 0.0f64.to_bits(), "{row}: {std}");
            continue;
        }
        let held = weighed(std::slice::from_ref(step), &weights, &GRID);
        let right = plain(&held, 50.0)[1] * factor;
        assert!((std / right - 1.0).abs() < 1e-5, "{row}: {std} {right}");
    }
    // One value has none.
    let place = LonLatDeg::new(-20.0, 5.0).unwrap();
    let cell = AskedGeometry::point(place, Sampling::Cell);
    let one = asked(cell, "std", TimeStep::Native);
    let one = statistics(&Engine::local(store), &one).await.unwrap();
    let none = |row| value(&one, row, "std").to_bits() == 0.0f64.to_bits();
    assert!((0..12).all(none), "{one:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_answered_is_refused_with_the_reason() {
    let (_folder, store, _manifest, _steps) = landed().await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let refused =
        async |query: StatisticsQuery| statistics(&engine, &query).await.unwrap_err().to_string();
    let native = TimeStep::Native;
    let outside = StatisticsQuery {
        from: "2010".parse().ok(),
        ..asked(area("global"), "mean", native)
    };
    assert!(refused(outside).await.contains("covers 2000-01-01"));
    let crossing = "POLYGON((0 0,10 0,0 0))";
    assert!(
        refused(asked(area(crossing), "mean", native))
            .await
            .contains("fewer than three")
    );
    let unknown = StatisticsQuery {
        product: product("nothing"),
        ..asked(area("global"), "mean", native)
    };
    assert!(refused(unknown).await.contains("unknown"));
    let years = StatisticsQuery {
        from: "0001".parse().ok(),
        to: "9999".parse().ok(),
        ..asked(area("global"), "mean", TimeStep::Day)
    };
    assert!(refused(years).await.contains("longer ones"));
    // What crosses itself, or lies within one cell, has its right answer.
    for odd in [
        "POLYGON((-40 -20,-10 10,-10 -20,-40 10,-40 -20))",
        "POLYGON((-30.1 -10.1,-30.0999 -10.1,-30.0999 -10.0999,-30.1 -10.1))",
    ] {
        let answer = statistics(&engine, &asked(area(odd), "mean,count", native))
            .await
            .unwrap();
        let weights = weights::compute(&GRID, &odd.parse().unwrap(), Earth::Wgs84).unwrap();
        for (row, step) in answer.rows.iter().zip(&wavy_year(&GRID)) {
            let all = weighed(std::slice::from_ref(step), &weights, &GRID);
            match row.values["mean"] {
                None => assert!(all.is_empty()),
                Some(mean) => {
                    let expected = plain(&all, 50.0)[0] * Quantity::CarbonFlux.display().factor;
                    assert!((mean / expected - 1.0).abs() < 1e-9);
                }
            }
        }
    }
}
