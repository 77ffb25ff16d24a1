//! Statistics of every cell as products.

use compute::analysis::trend::trend as trend_of_series;
use compute::computed::{Request, RequestedInput, compute};
use compute::derive::{derive_statistic, derive_statistics};
use compute::reduce::statistics as statistics_of_newest;
use compute::{ComputeError, Engine, ErrorClass};
use contract::analysis::{CalendarBins, MapOptions, MapStatistic};
use contract::computed::{Computation, Matching, Regridding};
use contract::geometry::{AskedGeometry, Sampling};
use contract::grid::{Grid, LonLatDeg};
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::statistics::{StatisticsQuery, StatisticsRow};
use contract::time::{Period, TimeStep};
use storage::{Store, domain, fields};

use crate::fixture::{folder_store, land, parts, product};
use crate::statistics::{area, asked};

/// Blocks that are cut at both edges.
const GRID: Grid = Grid {
    rows: 19,
    cols: 37,
    north_deg: 40.0,
    west_deg: -30.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// Three years of months, kg m⁻² s⁻¹ times 10⁹ in two segments: a season that grows with the row, land in column 3, gaps in column 5.
fn steps() -> Vec<(Period, Vec<f32>)> {
    let value = |month: u32, cell: usize| {
        let (row, col) = (cell / 37, cell % 37);
        match col {
            3 => f32::NAN,
            5 if month % 12 == 6 && month > 12 => f32::NAN,
            6 if month > 0 => f32::NAN,
            _ => (row as f32) * (month % 12) as f32 + (month / 12) as f32,
        }
    };
    (0..36)
        .map(|month| {
            let period = Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap();
            (
                period,
                (0..GRID.cell_count())
                    .map(|cell| value(month, cell))
                    .collect(),
            )
        })
        .collect()
}

async fn landed(store: &Store) -> Manifest {
    land(store, &product("wind"), Quantity::WindSpeed, GRID, &steps()).await
}

async fn derived(engine: &Engine, options: &MapOptions) -> Result<Manifest, ComputeError> {
    derive_statistic(engine, &product("wind"), options, &|_| ()).await
}

async fn read(store: &Store, manifest: &Manifest, step: usize) -> Vec<f32> {
    fields::read(store, &manifest.steps[step].field, &GRID)
        .await
        .unwrap()
}

fn bits(values: &[f32]) -> impl Iterator<Item = u32> {
    values.iter().map(|value| value.to_bits())
}

fn at(row: usize, col: usize) -> usize {
    row * 37 + col
}

#[tokio::test(flavor = "multi_thread")]
async fn a_climatology_is_a_product_of_twelve_months() {
    let (_folder, store) = folder_store();
    let source = landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let options = MapOptions::new(MapStatistic::Climatology);
    let made = derived(&engine, &options).await.unwrap();
    assert_eq!(
        (made.product.as_str(), made.steps.len()),
        ("wind-climatology", 12)
    );
    assert_eq!((made.quantity, made.number), (Quantity::WindSpeed, 1));
    assert_eq!(made.derived_from, Some(source.id()));
    assert_eq!(
        made.title,
        "Test wind, monthly climatology 2001/2003, where 50 % or more hold data"
    );
    assert_eq!(made.steps[6].period, Period::month(2002, 7).unwrap());
    assert_eq!(made.steps[6].origin, "July of 2001/2003");
    let july = read(&store, &made, 6).await;
    // By hand: 6 times the row, and 0, 1, 2 of the years.
    assert_eq!(july[at(4, 0)].to_bits(), 25.0f32.to_bits());
    // Of three Julys one is there: less than half. Of Januaries only the first.
    assert!(july[at(4, 5)].is_nan() && july[at(4, 3)].is_nan());
    assert!(read(&store, &made, 0).await[at(4, 6)].is_nan());
    let cells = domain::read(&store, &made.domain).await.unwrap();
    assert!(!cells[at(0, 3)] && !cells[at(0, 6)] && cells[at(0, 5)]);
    // The same bits in any number of parts, and nothing new of the same.
    for count in [1, 5] {
        let engine = Engine::in_process(store.clone(), parts(count));
        let name = Some(product(&format!("again-{count}")));
        let again = derived(
            &engine,
            &MapOptions {
                name,
                ..options.clone()
            },
        )
        .await
        .unwrap();
        for month in 0..12 {
            let (a, b) = (
                read(&store, &made, month).await,
                read(&store, &again, month).await,
            );
            assert!(bits(&a).eq(bits(&b)));
        }
        assert_eq!(derived(&engine, &options).await.unwrap(), made);
    }
    // One July more, and it is made anew.
    let mut more = steps();
    more[30].1[at(4, 0)] += 3.0;
    land(&store, &product("wind"), Quantity::WindSpeed, GRID, &more).await;
    let anew = derived(&engine, &options).await.unwrap();
    assert_eq!(anew.number, 2);
    assert_eq!(
        read(&store, &anew, 6).await[at(4, 0)].to_bits(),
        26.0f32.to_bits()
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn anomalies_are_steps_less_their_month() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let options = MapOptions {
        from: "2003".parse().ok(),
        base: "2001/2002".parse().ok(),
        ..MapOptions::new(MapStatistic::Anomaly)
    };
    let made = derived(&engine, &options).await.unwrap();
    assert_eq!(
        (made.steps.len(), made.steps[0].period),
        (12, Period::month(2003, 1).unwrap())
    );
    for month in 0..12 {
        let values = read(&store, &made, month).await;
        assert!(
            (values[at(7, 9)] - 1.5).abs() < 1e-6,
            "{}",
            values[at(7, 9)]
        );
    }
    // A point of it is read like that of any other product.
    let place = contract::grid::LonLatDeg::new(-20.5, 32.5).unwrap();
    let point = compute::point_series(&engine, &made.product, place)
        .await
        .unwrap();
    assert_eq!(point.series.len(), 12);
    assert!((point.series[11].value.unwrap() - 1.5).abs() < 1e-6);
}

#[tokio::test(flavor = "multi_thread")]
async fn means_spreads_and_waves_are_those_of_each_cell() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let of = async |statistic| {
        let made = derived(&engine, &MapOptions::new(statistic)).await.unwrap();
        assert_eq!(made.steps.len(), 1);
        (made.steps[0].period, read(&store, &made, 0).await)
    };
    let (period, mean) = of(MapStatistic::Mean).await;
    assert_eq!(
        period.to_string(),
        "2001-01-01T00:00:00Z/2004-01-01T00:00:00Z"
    );
    let days = [
        31.0, 28.0, 31.0, 30.0, 31.0, 30.0, 31.0, 31.0, 30.0, 31.0, 30.0, 31.0,
    ];
    let months: f64 = (0..12).map(|m| days[m] * m as f64).sum::<f64>() / 365.0;
    assert!((f64::from(mean[at(4, 0)]) - (4.0 * months + 1.0)).abs() < 1e-5);
    let (_, spread) = of(MapStatistic::Spread).await;
    // Row 0 has no season: 0, 1, 2, twelve times each.
    assert!((f64::from(spread[at(0, 0)]) - (24.0f64 / 35.0).sqrt()).abs() < 1e-6);
    let (_, wave) = of(MapStatistic::Amplitude).await;
    // Row 0 has stairs of a year: about a line a saw's teeth, whose first wave has 1 / pi of their height.
    assert!(
        (wave[at(0, 0)] - std::f32::consts::FRAC_1_PI).abs() < 0.03,
        "{}",
        wave[at(0, 0)]
    );
    assert!(wave[at(2, 0)] > 3.0 && (wave[at(4, 0)] / wave[at(2, 0)] - 2.0).abs() < 0.3);
    let seasons = MapOptions {
        bins: CalendarBins::Season,
        ..MapOptions::new(MapStatistic::Climatology)
    };
    let made = derived(&engine, &seasons).await.unwrap();
    assert_eq!(
        (made.steps.len(), made.steps[0].period.start.to_string()),
        (4, "2001-12-01T00:00:00Z".to_owned())
    );
}

/// Six years of a season that rises by the column's share of a kelvin a year, but for noise of every third month.
#[tokio::test(flavor = "multi_thread")]
async fn trends_and_their_chances_are_maps_of_their_own_quantities() {
    let (_folder, store) = folder_store();
    let value = |month: u32, cell: usize| {
        let noise = if month.is_multiple_of(3) { 0.05 } else { 0.0 };
        let rise = (cell % 37) as f32 / 36.0 * (month as f32 / 12.0);
        290.0 + (month % 12) as f32 + rise + noise
    };
    let steps: Vec<(Period, Vec<f32>)> = (0..72)
        .map(|month| {
            let period = Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap();
            let cells = (0..GRID.cell_count()).map(|cell| value(month, cell));
            (period, cells.collect())
        })
        .collect();
    let sst = Quantity::SeaSurfaceTemperature;
    land(&store, &product("wind"), sst, GRID, &steps).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let trend = derived(&engine, &MapOptions::new(MapStatistic::Trend))
        .await
        .unwrap();
    assert_eq!(
        (trend.product.as_str(), trend.quantity.unit()),
        ("wind-trend", "K year-1")
    );
    assert_eq!(trend.quantity.title(), "Sea-surface temperature, trend");
    let values = read(&store, &trend, 0).await;
    for col in [0, 18, 36] {
        // Means of months are taken off, so that a rise within the year is too: five sixths of it are left or more.
        let share = values[at(3, col)] / (col as f32 / 36.0).max(1e-9);
        assert!(col == 0 || (0.8..=1.01).contains(&share), "{col}: {share}");
    }
    // What never changes but with the season has nothing to test.
    assert!(values[at(3, 0)].is_nan());
    let chance = derived(&engine, &MapOptions::new(MapStatistic::TrendPValue))
        .await
        .unwrap();
    assert_eq!(
        (chance.product.as_str(), chance.quantity.unit()),
        ("wind-trend-p-value", "1")
    );
    let values = read(&store, &chance, 0).await;
    assert!(values.iter().all(|p| p.is_nan() || (0.0..=1.0).contains(p)));
    assert!(values[at(3, 36)] < 0.05, "{}", values[at(3, 36)]);
    let of_line = MapOptions::new(MapStatistic::LeastSquaresTrend);
    let line = read(&store, &derived(&engine, &of_line).await.unwrap(), 0).await[at(3, 36)];
    let of_line = MapOptions::new(MapStatistic::LeastSquaresTrendPValue);
    let of_line = read(&store, &derived(&engine, &of_line).await.unwrap(), 0).await[at(3, 36)];
    let cell: Vec<f64> = steps
        .iter()
        .map(|(_, values)| f64::from(values[at(3, 36)]))
        .collect();
    let periods: Vec<Period> = steps.iter().map(|(period, _)| *period).collect();
    let right = trend_of_series(&periods, &cell, TimeStep::Month, "").unwrap();
    let right = right.least_squares;
    assert!(
        (f64::from(line) - right.slope_per_decade / 10.0).abs() < 1e-6,
        "{line}"
    );
    assert!(
        (f64::from(of_line) - right.p_value.unwrap()).abs() < 1e-6,
        "{of_line}"
    );
}

#[tokio::test(flavor = "multi_thread")]
#[expect(clippy::too_many_lines, reason = "a list of cases")]
async fn what_is_no_statistic_is_refused_with_the_reason() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let sst = vec![(Period::year(2001).unwrap(), vec![290.0; GRID.cell_count()])];
    land(
        &store,
        &product("sst"),
        Quantity::SeaSurfaceTemperature,
        GRID,
        &sst,
    )
    .await;
    let engine = Engine::in_process(store.clone(), parts(1));
    let of = async |name: &str, options: MapOptions| {
        let made = derive_statistic(&engine, &product(name), &options, &|_| ()).await;
        made.unwrap_err()
    };
    let new = MapOptions::new;
    for (name, options, reason) in [
        (
            "sst",
            new(MapStatistic::Climatology),
            "steps of 365 days have no month",
        ),
        ("sst", new(MapStatistic::Mean), "of this name"),
        (
            "wind",
            new(MapStatistic::Trend),
            "ten values and five years",
        ),
        (
            "wind",
            MapOptions {
                base: "1991/2000".parse().ok(),
                ..new(MapStatistic::Climatology)
            },
            "covers 2001",
        ),
        (
            "wind",
            MapOptions {
                bins: CalendarBins::Day,
                ..new(MapStatistic::Climatology)
            },
            "months and seasons",
        ),
        (
            "wind",
            MapOptions {
                from: "2010".parse().ok(),
                ..new(MapStatistic::Mean)
            },
            "no step",
        ),
        (
            "wind",
            MapOptions {
                name: Some(product("wind")),
                ..new(MapStatistic::Mean)
            },
            "name of its own",
        ),
    ] {
        if reason == "of this name" {
            land(
                &store,
                &product("sst-mean"),
                Quantity::SeaSurfaceTemperature,
                GRID,
                &sst,
            )
            .await;
        }
        let refused = of(name, options).await;
        assert!(refused.to_string().contains(reason), "{refused}");
        assert_eq!(refused.class(), ErrorClass::BadRequest);
    }
}

/// Statistics of a place by the other way, through sums of one cell.
async fn of_place(engine: &Engine, [lon, lat]: [f64; 2], statistics: &str) -> StatisticsRow {
    let place = LonLatDeg::new(lon, lat).unwrap();
    let query = StatisticsQuery {
        product: product("wind"),
        ..asked(
            AskedGeometry::point(place, Sampling::Cell),
            statistics,
            TimeStep::Total,
        )
    };
    let answer = statistics_of_newest(engine, &query).await.unwrap();
    answer.rows.into_iter().next().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn extremes_percentiles_and_counts_of_cells_are_those_of_places() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let names = ["min", "max", "median", "p12.5", "p90", "count", "coverage"];
    let mut options: Vec<MapOptions> = names
        .iter()
        .map(|name| MapOptions {
            least_percent: 2,
            ..MapOptions::new(name.parse().unwrap())
        })
        .collect();
    options.extend([MapStatistic::MinTime, MapStatistic::MaxTime].map(MapOptions::new));
    let made = derive_statistics(&engine, &product("wind"), &options, &|_| ()).await;
    let made = made.unwrap();
    assert_eq!(made[3].product.as_str(), "wind-p12-5");
    assert_eq!(
        (made[1].quantity, made[5].quantity.unit()),
        (Quantity::WindSpeed, "1")
    );
    let mut maps = vec![];
    for one in &made {
        maps.push(read(&store, one, 0).await);
    }
    // One with all steps, two with gaps, of which one has one step of 36; the last has each extreme twelve times.
    for (row, col) in [(4, 0), (11, 5), (7, 6), (0, 0)] {
        let place = [f64::from(col) - 29.5, 39.5 - f64::from(row)];
        let right = of_place(&engine, place, &names.join(",")).await;
        let cell = at(row as usize, col as usize);
        for (name, map) in names.iter().zip(&maps) {
            let (own, right) = (f64::from(map[cell]), right.values[*name].unwrap());
            assert!(
                (own - right).abs() < 1e-5,
                "{name} of {row} {col}: {own} {right}"
            );
        }
        if col == 6 {
            assert!(
                maps[7][cell].is_nan() && maps[8][cell].is_nan(),
                "less than half"
            );
            continue;
        }
        for (name, map) in [("min", &maps[7]), ("max", &maps[8])] {
            let days = right.found_at[name].ms() as f64 / 86_400_000.0;
            assert!((f64::from(map[cell]) - days).abs() < 2e-3, "{name}: {days}");
        }
    }
    // Land has no values, of counts too.
    assert!(maps.iter().all(|map| map[at(4, 3)].is_nan()));
}

/// Cuts cells at every edge: 20 to 23 W, 29 to 32 N.
const OBLONG: &str = "POLYGON((-22.7 29.5,-20.2 29.5,-20.2 31.4,-22.7 31.4,-22.7 29.5))";

fn of(statistic: MapStatistic, region: Option<&str>, name: &str) -> MapOptions {
    MapOptions {
        region: region.map(|text| text.parse().unwrap()),
        name: Some(product(name)),
        ..MapOptions::new(statistic)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn steps_that_never_landed_are_time_without_data() {
    let (_folder, store) = folder_store();
    let winters = steps()
        .into_iter()
        .enumerate()
        .filter(|(m, _)| m % 12 < 4)
        .map(|(_, step)| step);
    let winters: Vec<(Period, Vec<f32>)> = winters.collect();
    let name = product("wind");
    land(&store, &name, Quantity::WindSpeed, GRID, &winters).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let made = derived(&engine, &MapOptions::new(MapStatistic::Coverage)).await;
    let coverage = read(&store, &made.unwrap(), 0).await[at(4, 0)];
    let held_s: f64 = winters.iter().map(|(period, _)| period.seconds()).sum();
    let all = Period::new(winters[0].0.start, winters[11].0.end).unwrap();
    let expected = 100.0 * held_s / all.seconds();
    assert!(
        (f64::from(coverage) - expected).abs() < 1e-4 && expected < 50.0,
        "{coverage} {expected}"
    );
    let none = "no cell holds data in as much of the time as is asked for";
    let mean = MapOptions::new(MapStatistic::Mean);
    let refused = derived(&engine, &mean).await.unwrap_err().to_string();
    assert!(refused.contains(none), "{refused}");
    let least_percent = 40;
    let some = MapOptions {
        least_percent,
        ..mean
    };
    assert!(derived(&engine, &some).await.is_ok());
    // Of a climatology each month is asked for by itself: of those that there are, and of those of a base period.
    let normals = MapOptions::new(MapStatistic::Climatology);
    let made = derived(&engine, &normals).await.unwrap();
    assert!(!read(&store, &made, 0).await[at(4, 0)].is_nan());
    assert!(read(&store, &made, 5).await[at(4, 0)].is_nan());
    for (base, is_enough) in [("2001/2006", true), ("2001/2007", false)] {
        let of_base = MapOptions {
            base: Some(base.parse().unwrap()),
            ..normals.clone()
        };
        let made = derived(&engine, &of_base).await;
        assert_eq!(made.is_ok(), is_enough, "{base}: {made:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn another_statistic_does_not_take_the_place_of_one() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let spread = of(MapStatistic::Spread, None, "here");
    assert_eq!(derived(&engine, &spread).await.unwrap().number, 1);
    let other = of(MapStatistic::Mean, None, "here");
    let refused = derived(&engine, &other).await.unwrap_err().to_string();
    for part in ["it is the", "would become the", "give another name"] {
        assert!(refused.contains(part), "{refused}");
    }
    // The same statistic of other cells is a version of it.
    let part = of(MapStatistic::Spread, Some(OBLONG), "here");
    assert_eq!(derived(&engine, &part).await.unwrap().number, 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_region_has_the_values_of_the_whole_in_its_cells_and_none_elsewhere() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let region = Some(OBLONG);
    let all = [
        of(MapStatistic::Climatology, None, "a"),
        of(MapStatistic::Anomaly, None, "b"),
        of(MapStatistic::Spread, None, "c"),
    ];
    let mut whole = vec![];
    for one in &all {
        // One by one here, together there: what they share changes nothing.
        whole.push(derived(&engine, one).await.unwrap());
    }
    let some = [
        of(MapStatistic::Climatology, region, "d"),
        of(MapStatistic::Anomaly, region, "e"),
        of(MapStatistic::Spread, region, "f"),
    ];
    let made = derive_statistics(&engine, &product("wind"), &some, &|_| ()).await;
    let made = made.unwrap();
    assert!(
        made[1].title.contains("by month in POLYGON"),
        "{}",
        made[1].title
    );
    for (whole, own) in whole.iter().zip(&made) {
        assert_eq!(whole.steps.len(), own.steps.len());
        for step in 0..own.steps.len() {
            let (all, some) = (
                read(&store, whole, step).await,
                read(&store, own, step).await,
            );
            for row in 0..19 {
                for col in 0..37 {
                    let is_inside = (8..=10).contains(&row) && (7..=9).contains(&col);
                    let (all, own) = (all[at(row, col)], some[at(row, col)]);
                    assert!(if is_inside {
                        own.to_bits() == all.to_bits()
                    } else {
                        own.is_nan()
                    });
                }
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn statistics_that_are_there_are_not_made_again_and_regions_that_do_not_fit_are_refused() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let some = [
        of(MapStatistic::Mean, Some(OBLONG), "d"),
        of(MapStatistic::Spread, Some(OBLONG), "f"),
    ];
    let made = derive_statistics(&engine, &product("wind"), &some, &|_| ()).await;
    let made = made.unwrap();
    let again = derive_statistics(&engine, &product("wind"), &some, &|_| ()).await;
    assert_eq!(again.unwrap(), made);
    let other = of(MapStatistic::Spread, Some("-25,20,-10,35"), "f");
    assert_eq!(derived(&engine, &other).await.unwrap().number, 2);
    let whole = of(MapStatistic::Spread, None, "c");
    let nameless = MapOptions {
        name: None,
        ..some[1].clone()
    };
    let elsewhere = of(MapStatistic::Mean, Some("50,50,60,60"), "g");
    for (wrong, reason) in [
        (vec![whole.clone(), some[1].clone()], "one region"),
        (vec![whole.clone(), whole], "one product"),
        (vec![elsewhere], "outside the grid"),
        (vec![nameless], "--name"),
    ] {
        let refused = derive_statistics(&engine, &product("wind"), &wrong, &|_| ()).await;
        let refused = refused.unwrap_err();
        assert!(refused.to_string().contains(reason), "{refused}");
        assert_eq!(refused.class(), ErrorClass::BadRequest);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn memory_changes_no_bit_and_what_it_cannot_hold_is_refused() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let of = |name: &str| of(MapStatistic::Climatology, None, name);
    let roomy = derived(&engine, &of("roomy")).await.unwrap();
    // Blocks are read two by two.
    let small = engine.clone().with_memory_bytes(160 << 10);
    let small = derived(&small, &of("small")).await.unwrap();
    for month in 0..12 {
        let (a, b) = (
            read(&store, &roomy, month).await,
            read(&store, &small, month).await,
        );
        assert!(bits(&a).eq(bits(&b)));
    }
    let tiny = engine.clone().with_memory_bytes(64 << 10);
    let refused = derived(&tiny, &of("tiny")).await.unwrap_err();
    assert!(refused.to_string().contains("--memory-mib"), "{refused}");
}

/// Of more rows than two bands have, and no whole number of chunks or blocks.
const HIGH: Grid = Grid {
    rows: 277,
    cols: 125,
    north_deg: 69.25,
    west_deg: -30.0,
    dlat_deg: 0.5,
    dlon_deg: 0.5,
};

#[tokio::test(flavor = "multi_thread")]
async fn maps_that_have_no_room_are_made_in_bands_of_rows_and_are_the_same_objects() {
    let (_folder, store) = folder_store();
    let value = |month: usize, cell: usize| match (cell * 7919 + month) % 11 {
        3 => f32::NAN,
        own => (own + cell % 1009) as f32 * 0.01 + (month % 12) as f32,
    };
    let step = |month: usize| {
        let period = Period::month(2001 + (month / 12) as i32, month as u32 % 12 + 1).unwrap();
        let cells = 0..HIGH.cell_count();
        (period, cells.map(|cell| value(month, cell)).collect())
    };
    let steps: Vec<(Period, Vec<f32>)> = (0..24).map(step).collect();
    land(&store, &product("wind"), Quantity::WindSpeed, HIGH, &steps).await;
    let roomy = Engine::in_process(store.clone(), parts(2));
    // Of 13 maps 120 rows at a time have room, and not 240.
    let small = roomy.clone().with_memory_bytes(3 << 20);
    for (number, (region, crop)) in [
        (None, false),
        (Some("-20,-60,15,55"), false),
        (Some("-20,-60,15,55"), true),
    ]
    .into_iter()
    .enumerate()
    {
        let options = |name: &str| {
            let of = |statistic| MapOptions {
                crop,
                ..of(statistic, region, &format!("{name}-{number}-{statistic}"))
            };
            [MapStatistic::Climatology, MapStatistic::Mean].map(of)
        };
        let wind = product("wind");
        let [made, other] = [(&roomy, "roomy"), (&small, "small")].map(|(engine, name)| {
            let (wind, options) = (wind.clone(), options(name));
            async move {
                derive_statistics(engine, &wind, &options, &|_| ())
                    .await
                    .unwrap()
            }
        });
        for (made, other) in made.await.iter().zip(&other.await) {
            assert!(made.grid.rows > 120, "it is made at once");
            assert_eq!((made.grid, made.quantity), (other.grid, other.quantity));
            let digest = |key: &contract::key::ObjectKey| {
                key.as_str().rsplit('/').next().unwrap().to_owned()
            };
            assert_eq!(digest(&made.domain), digest(&other.domain));
            assert_eq!(made.steps.len(), other.steps.len());
            for (step, other) in made.steps.iter().zip(&other.steps) {
                assert_eq!(digest(&step.field), digest(&other.field));
                assert_eq!(step.valid_cells, other.valid_cells);
                assert_eq!(step.period, other.period);
            }
        }
    }
    // Anomalies are less the maps of all cells.
    let tiny = roomy.with_memory_bytes(1 << 20);
    for statistic in [MapStatistic::Anomaly, MapStatistic::Climatology] {
        let refused = derived(&tiny, &of(statistic, None, "tiny"))
            .await
            .unwrap_err();
        assert!(refused.to_string().contains("--memory-mib"), "{refused}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn anomalies_have_the_same_bits_from_blocks_and_from_fields() {
    let (_folder, store) = folder_store();
    let source = landed(&store).await;
    let roomy = Engine::in_process(store.clone(), parts(2));
    // No run of steps has room in it.
    let small = roomy.clone().with_memory_bytes(160 << 10);
    let options = |name: &str, region: Option<&str>| MapOptions {
        from: "2002-03".parse().ok(),
        ..of(MapStatistic::Anomaly, region, name)
    };
    for (number, region) in [None, Some("-20,25,-5,38")].into_iter().enumerate() {
        let names = ["roomy", "small"].map(|name| format!("{name}-{number}"));
        let made = derived(&roomy, &options(&names[0], region)).await.unwrap();
        let other = derived(&small, &options(&names[1], region)).await.unwrap();
        assert_eq!((made.steps.len(), other.steps.len()), (22, 22));
        for step in 0..22 {
            assert_eq!(made.steps[step].period, source.steps[14 + step].period);
            assert_eq!(made.steps[step].valid_cells, other.steps[step].valid_cells);
            let (a, b) = (
                read(&store, &made, step).await,
                read(&store, &other, step).await,
            );
            assert!(bits(&a).eq(bits(&b)));
            // By hand: -1, 0, 1 of the years.
            let year = (14 + step) / 12;
            let inside = a[at(7, 15)];
            assert!((inside - (year as f32 - 1.0)).abs() < 1e-6, "{inside}");
            assert_eq!(a[at(7, 30)].is_nan(), region.is_some());
            let held = a.iter().filter(|value| !value.is_nan()).count();
            assert_eq!(made.steps[step].valid_cells, held as u64);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn statistics_of_different_periods_share_nothing_but_the_reading() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let of = |statistic, from: &str, name: &str| MapOptions {
        from: from.parse().ok(),
        ..of(statistic, None, name)
    };
    let both = [
        of(MapStatistic::Amplitude, "2001", "a"),
        of(MapStatistic::Amplitude, "2002-06", "b"),
        of(MapStatistic::Phase, "2001-09", "c"),
    ];
    let made = derive_statistics(&engine, &product("wind"), &both, &|_| ()).await;
    let made = made.unwrap();
    assert_eq!(made.len(), both.len());
    for (made, (options, name)) in made.iter().zip(both.iter().zip(["x", "y", "z"])) {
        let alone = MapOptions {
            name: Some(product(name)),
            ..options.clone()
        };
        let alone = derived(&engine, &alone).await.unwrap();
        assert_eq!(made.steps[0].period, alone.steps[0].period);
        let (own, right) = (read(&store, made, 0).await, read(&store, &alone, 0).await);
        assert!(bits(&own).eq(bits(&right)), "{name}");
    }
}

/// Two years of which a cell has both, one, or none; and two Januaries of those years.
#[tokio::test(flavor = "multi_thread")]
async fn just_as_much_as_is_asked_for_is_enough_and_anomalies_have_the_domain_of_all_steps() {
    let (_folder, store) = folder_store();
    let engine = Engine::in_process(store.clone(), parts(2));
    let values = |year: usize| -> Vec<f32> {
        let value = |cell: usize| match cell % 3 {
            0 => 5.0 + year as f32,
            1 if year == 0 => 9.0,
            _ => f32::NAN,
        };
        (0..GRID.cell_count()).map(value).collect()
    };
    let years = [0, 1].map(|year| (Period::year(2001 + year as i32).unwrap(), values(year)));
    let months = [0, 1].map(|year| (Period::month(2001 + year as i32, 1).unwrap(), values(year)));
    for (name, steps, statistic) in [
        ("years", years, MapStatistic::Mean),
        ("months", months, MapStatistic::Climatology),
    ] {
        land(&store, &product(name), Quantity::WindSpeed, GRID, &steps).await;
        for (least_percent, is_enough) in [(50, true), (51, false)] {
            let options = MapOptions {
                least_percent,
                name: Some(product(&format!("{name}-{least_percent}"))),
                ..MapOptions::new(statistic)
            };
            let made = derive_statistic(&engine, &product(name), &options, &|_| ()).await;
            let map = read(&store, &made.unwrap(), 0).await;
            assert_eq!(map[0].to_bits(), 5.5f32.to_bits(), "{name}");
            assert_eq!(map[1].is_nan(), !is_enough, "{name} {least_percent}");
            assert!(map[2].is_nan());
        }
    }
    let anomalies = MapOptions::new(MapStatistic::Anomaly);
    let made = derive_statistic(&engine, &product("months"), &anomalies, &|_| ()).await;
    let made = made.unwrap();
    let last = read(&store, &made, 1).await;
    assert!(last[1].is_nan() && !read(&store, &made, 0).await[1].is_nan());
    let cells = domain::read(&store, &made.domain).await.unwrap();
    assert_eq!(cells[..3], [true, true, false]);
}

#[tokio::test(flavor = "multi_thread")]
async fn chances_are_those_of_the_test_that_is_asked_for() {
    let (_folder, store) = folder_store();
    let value = |month: u32, cell: usize| {
        let noise = (month * 7919 + 31 * cell as u32) % 101;
        290.0 + month as f32 * 0.002 + noise as f32 * 0.01
    };
    let steps: Vec<(Period, Vec<f32>)> = (0..72)
        .map(|month| {
            let period = Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap();
            let cells = (0..GRID.cell_count()).map(|cell| value(month, cell));
            (period, cells.collect())
        })
        .collect();
    let sst = Quantity::SeaSurfaceTemperature;
    land(&store, &product("wind"), sst, GRID, &steps).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let options = [
        MapStatistic::TrendPValue,
        MapStatistic::LeastSquaresTrendPValue,
        MapStatistic::Trend,
        MapStatistic::LeastSquaresTrend,
    ];
    let options = options.map(MapOptions::new);
    let made = derive_statistics(&engine, &product("wind"), &options, &|_| ()).await;
    let mut maps = vec![];
    for one in &made.unwrap() {
        maps.push(read(&store, one, 0).await);
    }
    let periods: Vec<Period> = steps.iter().map(|(period, _)| *period).collect();
    let (mut compared, mut telling) = (0, 0);
    for cell in (0..GRID.cell_count()).step_by(7) {
        let values = steps.iter().map(|(_, values)| f64::from(values[cell]));
        let values: Vec<f64> = values.collect();
        let right = trend_of_series(&periods, &values, TimeStep::Month, "").unwrap();
        let line = &right.least_squares;
        let Some(of_line) = line.p_value else {
            assert!(maps[1][cell].is_nan());
            continue;
        };
        let right = [
            right.mann_kendall.p_value,
            of_line,
            right.theil_sen.slope_per_decade / 10.0,
            line.slope_per_decade / 10.0,
        ];
        for (map, right) in maps.iter().zip(right) {
            let own = f64::from(map[cell]);
            assert!((own - right).abs() < 1e-6, "{cell}: {own} {right}");
        }
        compared += 1;
        telling += u32::from((right[0] - right[1]).abs() > 1e-3);
    }
    assert!(compared > 50 && telling > 10, "{compared} {telling}");
}

/// A product on a grid of cells twice as wide.
async fn regridded(
    engine: &Engine,
    source: &str,
    method: Regridding,
) -> Result<Manifest, ComputeError> {
    let wide = Grid {
        rows: 10,
        cols: 19,
        dlat_deg: 2.0,
        dlon_deg: 2.0,
        ..GRID
    };
    let request = Request {
        target: product(&format!("{source}-{method}")),
        title: None,
        quantity: None,
        how: Computation::Regrid {
            method,
            min_coverage: 0.5,
        },
        grid: Some(wide),
        inputs: vec![RequestedInput {
            name: "source".to_owned(),
            product: product(source),
            matching: Matching::SamePeriod,
        }],
        from: None,
        to: None,
    };
    let outcome = compute(engine, &request, &|_| ()).await;
    outcome.map(|outcome| outcome.manifest)
}

/// The mean of 1 January and 31 December is no day of July, of whichever cells.
#[tokio::test(flavor = "multi_thread")]
async fn days_of_the_year_are_not_averaged() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let phase = derived(&engine, &MapOptions::new(MapStatistic::Phase)).await;
    let phase = phase.unwrap().product;
    let wide = regridded(&engine, phase.as_str(), Regridding::Nearest).await;
    let wide = wide.unwrap().product;
    for source in [&phase, &wide] {
        for method in [Regridding::Bilinear, Regridding::Conservative] {
            let error = regridded(&engine, source.as_str(), method).await;
            let error = error.unwrap_err().to_string();
            assert!(error.contains("go round"), "{error}");
        }
        days_are_not_averaged(&engine, source).await;
    }
}

async fn days_are_not_averaged(engine: &Engine, phase: &ProductId) {
    let of = |geometry: AskedGeometry, statistics: &str| StatisticsQuery {
        product: phase.clone(),
        ..asked(geometry, statistics, TimeStep::Native)
    };
    let place = LonLatDeg::new(-20.5, 30.5).unwrap();
    let over = || area("-25,25,-10,35");
    for (query, is_told) in [
        (of(over(), "mean"), false),
        (of(over(), "count,max"), false),
        (
            of(AskedGeometry::point(place, Sampling::Bilinear), "mean"),
            false,
        ),
        (
            of(AskedGeometry::point(place, Sampling::Cell), "mean"),
            true,
        ),
        (of(over(), "count,coverage"), true),
    ] {
        let found = statistics_of_newest(engine, &query).await;
        match found {
            Ok(_) => assert!(is_told, "{query:?}"),
            Err(error) => {
                assert!(!is_told, "{error}");
                assert!(error.to_string().contains("go round"), "{error}");
            }
        }
    }
}
