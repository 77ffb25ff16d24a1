//! Anomalies of means as products: beside means and normals that are reckoned here in another way, from blocks and from fields.

use std::collections::BTreeMap;
use std::sync::Arc;

use compute::derive::{derive_statistic, derive_statistics};
use compute::{ComputeError, Engine};
use contract::analysis::{BasePeriod, CalendarBins, MapOptions, MapStatistic};
use contract::chunk::Window;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs, TimeStep};
use storage::{Store, fields};

use crate::fixture::{folder_store, land, parts, product};

/// Blocks that are cut at both edges.
const GRID: Grid = Grid {
    rows: 11,
    cols: 13,
    north_deg: 40.0,
    west_deg: -30.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};
const DAY_MS: i64 = 86_400_000;
/// From 20 November 2000 on: more than six runs of steps.
const DAYS: usize = 800;

fn day(number: usize) -> Period {
    let first: TimeMs = "2000-11-20".parse().unwrap();
    let at = |number: i64| TimeMs::new(first.ms() + number * DAY_MS).unwrap();
    Period::new(at(number as i64), at(number as i64 + 1)).unwrap()
}

/// Wind of a day in a cell, m/s: land, gaps of single days, and two cells that lack half a month and a little less.
fn value(number: usize, cell: usize) -> f32 {
    let period = day(number);
    let (year, month) = period.start.year_month();
    let first = Period::month(year, month).unwrap().start;
    let of_month = (period.start.ms() - first.ms()) / DAY_MS;
    match cell % 13 {
        3 => f32::NAN,
        5 if (number * 7 + cell).is_multiple_of(3) => f32::NAN,
        6 if month == 4 && of_month < 16 => f32::NAN,
        7 if month == 4 && of_month < 14 => f32::NAN,
        col => 5.0 + col as f32 * 0.1 + month as f32 * 0.7 + (number * number % 97) as f32 * 0.031,
    }
}

/// Days without those of one whole March.
async fn landed(store: &Store) -> Vec<usize> {
    let is_there = |number: &usize| {
        let start = day(*number).start;
        start.year_month() != (2002, 3)
    };
    let days: Vec<usize> = (0..DAYS).filter(is_there).collect();
    let of_day = |number: &usize| {
        let cells = (0..GRID.cell_count()).map(|cell| value(*number, cell));
        (day(*number), cells.collect())
    };
    let steps: Vec<(Period, Vec<f32>)> = days.iter().map(of_day).collect();
    land(store, &product("wind"), Quantity::WindSpeed, GRID, &steps).await;
    days
}

fn of(step: TimeStep, name: &str) -> MapOptions {
    MapOptions {
        anomaly_step: Some(step),
        name: Some(product(name)),
        ..MapOptions::new(MapStatistic::Anomaly)
    }
}

async fn derived(engine: &Engine, options: &MapOptions) -> Result<Manifest, ComputeError> {
    derive_statistic(engine, &product("wind"), options, &|_| ()).await
}

async fn read(store: &Store, manifest: &Manifest, step: usize) -> Vec<f32> {
    let field = &manifest.steps[step].field;
    fields::read(store, field, &GRID).await.unwrap()
}

/// Anomalies of a cell by the start of their means: days are whole in each of these bins.
fn reckoned(
    days: &[usize],
    cell: usize,
    (bin, year_part): (impl Fn(Period) -> Period, impl Fn(Period) -> u32),
    is_in_base: impl Fn(Period) -> bool,
) -> BTreeMap<TimeMs, f64> {
    let mut members: BTreeMap<Period, Vec<f64>> = BTreeMap::new();
    let mut held_days: BTreeMap<Period, i64> = BTreeMap::new();
    for number in days {
        let own = members.entry(bin(day(*number))).or_default();
        let value = Some(f64::from(value(*number, cell))).filter(|it| !it.is_nan());
        own.extend(value);
        let month = TimeStep::Month
            .calendar(day(*number).start)
            .unwrap()
            .unwrap();
        *held_days.entry(month).or_default() += i64::from(value.is_some());
    }
    let days_of = |bin: &Period| (bin.end.ms() - bin.start.ms()) / DAY_MS;
    let is_held = |month: &Period| 2 * held_days.get(month).unwrap_or(&0) >= days_of(month);
    members.retain(|bin, own| {
        let months = TimeStep::Month.whole_bins(*bin);
        2 * own.len() as i64 >= days_of(bin) && (days_of(bin) <= 31 || months.iter().all(is_held))
    });
    let means = members
        .iter()
        .map(|(bin, own)| (*bin, own.iter().sum::<f64>() / own.len() as f64));
    let means: Vec<(Period, f64)> = means.collect();
    let anomaly = |(bin, mean): &(Period, f64)| {
        let alike = means
            .iter()
            .filter(|(other, _)| is_in_base(*other) && year_part(*other) == year_part(*bin));
        let alike: Vec<f64> = alike.map(|(_, mean)| *mean).collect();
        let normal = alike.iter().sum::<f64>() / alike.len() as f64;
        (bin.start, mean - normal)
    };
    means
        .iter()
        .map(anomaly)
        .filter(|(_, it)| !it.is_nan())
        .collect()
}

/// Is what was derived what is reckoned, in every cell?
async fn compare(
    store: &Store,
    made: &Manifest,
    reckon: impl Fn(usize) -> BTreeMap<TimeMs, f64>,
) -> usize {
    let mut compared = 0;
    let mut maps = vec![];
    for step in 0..made.steps.len() {
        maps.push(read(store, made, step).await);
    }
    for cell in 0..GRID.cell_count() {
        let mut right = reckon(cell);
        for (step, map) in made.steps.iter().zip(&maps) {
            let start = step.period.start;
            match right.remove(&start) {
                Some(right) => {
                    let own = f64::from(map[cell]);
                    assert!((own - right).abs() < 1e-5, "{cell} {start}: {own}, {right}");
                    compared += 1;
                }
                None => assert!(map[cell].is_nan(), "{cell} {start}"),
            }
        }
        assert!(right.is_empty(), "{cell}: {right:?}");
    }
    compared
}

fn month_of(period: Period) -> u32 {
    period.mid().year_month().1
}

fn month(day: Period) -> Period {
    let (year, month) = day.start.year_month();
    Period::month(year, month).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn anomalies_of_months_are_means_of_their_days_less_those_of_their_month() {
    let (_folder, store) = folder_store();
    let days = landed(&store).await;
    let roomy = Engine::in_process(store.clone(), parts(2));
    let made = derived(&roomy, &of(TimeStep::Month, "monthly"))
        .await
        .unwrap();
    // Of November 2000 less than half is covered, of March 2002 nothing.
    let first = made.steps[0].period;
    assert_eq!(
        (made.steps.len(), first),
        (25, Period::month(2000, 12).unwrap())
    );
    assert_eq!(made.steps[24].period, Period::month(2003, 1).unwrap());
    assert_eq!(
        made.title,
        "Test wind, anomaly of means of months from 2000/2003 by month, where 50 % or more hold data"
    );
    assert_eq!(made.steps[0].origin, "mean of 31 steps less 2000/2003");
    assert_eq!(made.quantity.word(), "wind_speed_anomaly");
    assert_eq!(made.quantity.title(), "Wind speed at 10 m, anomaly");
    let all = |_bin: Period| true;
    let reckon = |cell| reckoned(&days, cell, (month, month_of), all);
    assert!(compare(&store, &made, reckon).await > 3000);
    // One cell lacks an April, the one beside it does not.
    let april = read(&store, &made, 4).await;
    assert!(april[6].is_nan() && !april[7].is_nan());
    // The same bits of fields, where no run of steps has room, and nothing new of the same.
    let small = roomy.clone().with_memory_bytes(160 << 10);
    let other = derived(&small, &of(TimeStep::Month, "small"))
        .await
        .unwrap();
    for step in 0..25 {
        let (own, other) = (&made.steps[step], &other.steps[step]);
        let names = [own, other].map(|it| it.field.as_str().rsplit('/').next().unwrap().to_owned());
        assert_eq!(names[0], names[1], "{step}");
        assert_eq!(own.valid_cells, other.valid_cells);
    }
    let again = derived(&small, &of(TimeStep::Month, "monthly"))
        .await
        .unwrap();
    assert_eq!(again, made);
    // Asked for otherwise it is another version; so it is with one day more.
    let native = MapOptions {
        anomaly_step: None,
        ..of(TimeStep::Month, "monthly")
    };
    assert_eq!(
        derived(&roomy, &native).await.unwrap().steps.len(),
        days.len()
    );
    let weekly = derived(&roomy, &of(TimeStep::Week, "monthly"))
        .await
        .unwrap();
    assert_eq!(
        (weekly.number, weekly.steps[0].period.seconds()),
        (3, 7.0 * 86_400.0)
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn means_are_whole_where_less_is_asked_for_and_normals_are_of_the_base() {
    let (_folder, store) = folder_store();
    let days = landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let base: BasePeriod = "2001/2001".parse().unwrap();
    let options = MapOptions {
        base: Some(base),
        from: "2002-01-15".parse().ok(),
        to: "2002-05-02".parse().ok(),
        ..of(TimeStep::Month, "some")
    };
    let made = derived(&engine, &options).await.unwrap();
    let starts: Vec<_> = made
        .steps
        .iter()
        .map(|step| step.period.start.year_month())
        .collect();
    assert_eq!(starts, [(2002, 1), (2002, 2), (2002, 4), (2002, 5)]);
    let window = base.period();
    let in_base = |bin: Period| (window.start..window.end).contains(&bin.mid());
    let reckon = |cell| {
        let mut all = reckoned(&days, cell, (month, month_of), in_base);
        all.retain(|start, _| starts.contains(&start.year_month()));
        all
    };
    assert!(compare(&store, &made, reckon).await > 400);
    // Seasons are of seasons whatever is said of bins, years of years.
    let season = |day: Period| TimeStep::Season.calendar(day.start).unwrap().unwrap();
    let made = derived(&engine, &of(TimeStep::Season, "seasons"))
        .await
        .unwrap();
    assert!(
        made.title.contains("of seasons from 2000/2003 by season"),
        "{}",
        made.title
    );
    let part = |bin: Period| CalendarBins::Season.of(bin) as u32;
    let reckon = |cell| reckoned(&days, cell, (season, part), |_| true);
    assert!(compare(&store, &made, reckon).await > 500);
    let year = |day: Period| TimeStep::Year.calendar(day.start).unwrap().unwrap();
    let made = derived(&engine, &of(TimeStep::Year, "years"))
        .await
        .unwrap();
    // The other year lacks a March.
    assert_eq!(made.steps.len(), 1);
    let reckon = |cell| reckoned(&days, cell, (year, |_| 0), |_| true);
    assert!(compare(&store, &made, reckon).await > 100);
}

#[tokio::test(flavor = "multi_thread")]
async fn means_that_nothing_is_an_anomaly_of_are_refused_with_the_reason() {
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    derived(&engine, &of(TimeStep::Month, "some"))
        .await
        .unwrap();
    for (options, reason) in [
        (of(TimeStep::Total, "none"), "days, weeks, months"),
        (
            MapOptions {
                base: "1990/1991".parse().ok(),
                ..of(TimeStep::Month, "none")
            },
            "has no step in it",
        ),
        (
            MapOptions {
                to: "2000-11-25".parse().ok(),
                ..of(TimeStep::Month, "none")
            },
            "has steps over half of its time",
        ),
    ] {
        let refused = derived(&engine, &options).await.unwrap_err().to_string();
        assert!(refused.contains(reason), "{refused}");
    }
    let too_long = MapOptions {
        name: Some(product("none")),
        ..of(TimeStep::Day, "none")
    };
    let refused = derive_statistic(&engine, &product("some"), &too_long, &|_| ()).await;
    let refused = refused.unwrap_err().to_string();
    assert!(
        refused.contains("30 days") || refused.contains("31 days"),
        "{refused}"
    );
}

/// Every step of every day, as the cube has them and as the fields do: held since the normals were made, and, where there is no room
/// for those of days, made of the product again.
#[tokio::test(flavor = "multi_thread")]
async fn a_cube_of_anomalies_is_that_of_its_fields_and_time_major_at_once() {
    let (_folder, store) = folder_store();
    let days = landed(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let options = |which: &str| {
        [
            MapOptions {
                name: Some(product(&format!("days-{which}"))),
                ..MapOptions::new(MapStatistic::Anomaly)
            },
            of(TimeStep::Week, &format!("weeks-{which}")),
        ]
    };
    let small = engine.clone().with_memory_bytes(2 << 20);
    let mut made = vec![];
    for (engine, which) in [(&engine, "held"), (&small, "made")] {
        let options = options(which);
        let own = derive_statistics(engine, &product("wind"), &options, &|_| ()).await;
        made.extend(own.unwrap());
    }
    assert_eq!(made[0].steps.len(), days.len());
    for (held, again) in made[..2].iter().zip(&made[2..]) {
        let values = |manifest: &Manifest| -> Vec<_> {
            let fields = manifest.steps.iter().map(|step| step.field.vouches());
            fields.collect()
        };
        assert_eq!(values(held), values(again));
    }
    let whole = Window {
        row: 0,
        col: 0,
        rows: GRID.rows,
        cols: GRID.cols,
    };
    for manifest in made {
        let steps = manifest.steps.len();
        let values = cube::Values::of(&store, &Arc::new(manifest.clone()))
            .await
            .unwrap();
        assert_eq!(values.in_fields_count(), 0, "the cube has followed");
        let blocks: Vec<[u32; 2]> = (0..2)
            .flat_map(|row| (0..2).map(move |col| [row, col]))
            .collect();
        let along_time = values.blocks(&blocks, 0..steps).await.unwrap();
        for step in 0..steps {
            let right = read(&store, &manifest, step).await;
            let right: Vec<u32> = right.iter().map(|value| value.to_bits()).collect();
            let map = values.windows(step, &[whole]).await.unwrap();
            let own: Vec<u32> = map[0].iter().map(|value| value.to_bits()).collect();
            assert_eq!(own, right, "{step}");
            for block in &along_time {
                let places = block.window.cell_indices(&GRID);
                for (place, series) in places.zip(block.values.chunks_exact(steps)) {
                    assert_eq!(series[step].to_bits(), right[place], "{step} {place}");
                }
            }
        }
    }
}

/// Of fields, of runs of steps with some after them that no run holds, and of damaged ones; held, and made again where there is no room.
#[tokio::test(flavor = "multi_thread")]
async fn anomalies_are_the_same_along_time_as_of_fields_and_damaged_runs_are_named() {
    const FOLDER: &str = "cubes/wind";
    let (_folder, store) = folder_store();
    landed(&store).await;
    let engine = || Engine::in_process(store.clone(), parts(2)).with_memory_bytes(2 << 20);
    let options = |which: &str| {
        let days = MapOptions {
            name: Some(product(&format!("days-{which}"))),
            ..MapOptions::new(MapStatistic::Anomaly)
        };
        [days, of(TimeStep::Week, &format!("weeks-{which}"))]
    };
    let wind = product("wind");
    let derive =
        async |which: &str| derive_statistics(&engine(), &wind, &options(which), &|_| ()).await;
    let without = derive("without").await.unwrap();
    let manifest = storage::manifests::latest(&store, &wind)
        .await
        .unwrap()
        .unwrap();
    cube::follow(&store, &manifest).await.unwrap();
    assert_eq!(cube::compact(&store, FOLDER).await.unwrap(), 6);
    let along_time = derive("along-time").await.unwrap();
    for (own, other) in along_time.iter().zip(&without) {
        let fields = |of: &Manifest| -> Vec<_> {
            let fields = of.steps.iter().map(|step| step.field.vouches());
            fields.collect()
        };
        assert_eq!(fields(own), fields(other));
    }
    let mut chunks = vec![];
    for key in store.list(&format!("{FOLDER}/chunks")).await.unwrap() {
        chunks.push((store.get(&key).await.unwrap().to_vec(), key));
    }
    // Runs are the largest.
    chunks.sort_by_key(|(content, _)| content.len());
    for (mut content, key) in chunks.split_off(chunks.len() - 6) {
        for byte in &mut content {
            *byte ^= 1;
        }
        store.put_over(&key, content.into()).await.unwrap();
    }
    let error = derive("damaged").await.unwrap_err().to_string();
    assert!(
        error.contains("of along_time/") && error.contains("cannot be read"),
        "{error}"
    );
}
