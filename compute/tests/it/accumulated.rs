//! Accumulated carbon: its fields against hand sums and the printed budget, its manifest and its event.

use std::sync::Mutex;

use compute::derive::{DeriveProgress, derive_statistic, derived};
use compute::reduce::statistics;
use compute::stats::region_series;
use compute::{Engine, budget, derive_accumulated, point_series};
use contract::analysis::{MapOptions, MapStatistic};
use contract::budget::BudgetQuery;
use contract::earth::Earth;
use contract::event::Body;
use contract::geometry::{AskedGeometry, Sampling};
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::region::AskedRegion;
use contract::series::RegionSeriesQuery;
use contract::statistics::StatisticsQuery;
use contract::time::{Period, TimeMs, TimeStep};
use storage::Store;
use storage::contributed::{self, Contributed};

use crate::fixture::{
    ONE_DEGREE, ask, folder_store, land, months, parts, product, total, wavy_year,
};
use crate::quarter_degree::counted;

async fn derive(engine: &Engine, name: &str, start: Option<TimeMs>) -> Manifest {
    derive_accumulated(engine, &product(name), start, &|_progress| ())
        .await
        .unwrap()
}

async fn field(store: &Store, manifest: &Manifest, step: usize) -> Vec<f32> {
    storage::fields::read(store, &manifest.steps[step].field, &manifest.grid)
        .await
        .unwrap()
}

/// Whoever derived it may have been killed before the cube followed.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_derived_is_a_cube_too_and_one_that_is_behind_is_brought_up() {
    let (_folder, store) = folder_store();
    let (id, year) = (product("wavy"), wavy_year(&ONE_DEGREE));
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &year).await;
    let engine = Engine::local(store.clone());
    let derived = derive(&engine, "wavy", None).await;
    for is_again in [false, true] {
        if is_again {
            for key in store.list("cubes").await.unwrap() {
                store.remove(&key).await.unwrap();
            }
            assert_eq!(derive(&engine, "wavy", None).await, derived);
        }
        let repository = cube::Repository::open(&store, "cubes/wavy-accumulated").await;
        let cube = repository.unwrap().at(&cube::At::Newest).await.unwrap();
        assert_eq!(cube.description().version, Some(derived.id()));
        assert_eq!(cube.steps().len(), 12);
        let (there, here) = (
            cube.field(11).await.unwrap(),
            field(&store, &derived, 11).await,
        );
        let same = |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
        let cells = ONE_DEGREE.cell_count();
        assert_eq!((there.len(), here.len()), (cells, cells));
        assert!(there.iter().zip(&here).all(same));
    }
}

/// Some statistics of accumulated carbon have its quantity, and are no sums: nothing is said of how complete they are, and they have no
/// budget.
#[tokio::test(flavor = "multi_thread")]
async fn statistics_of_accumulated_carbon_are_no_accumulated_carbon() {
    let (_folder, store) = folder_store();
    let (id, year) = (product("wavy"), wavy_year(&ONE_DEGREE));
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &year).await;
    let engine = Engine::local(store.clone());
    let sums = derive(&engine, "wavy", None).await;
    let place = ONE_DEGREE.cell_center(80, 40);
    let counted = point_series(&engine, &sums.product, place).await.unwrap();
    assert!(counted.series.iter().all(|row| row.contributed.is_some()));
    for (name, statistic, crop) in [
        ("most", MapStatistic::Max, false),
        ("normal", MapStatistic::Climatology, true),
    ] {
        let options = MapOptions {
            region: Some("-150,0,-120,30".parse().unwrap()),
            crop,
            name: Some(product(name)),
            ..MapOptions::new(statistic)
        };
        let made = derive_statistic(&engine, &sums.product, &options, &|_| ()).await;
        assert_eq!(made.unwrap().quantity, Quantity::AccumulatedCarbon);
        let found = point_series(&engine, &product(name), place).await.unwrap();
        assert!(
            found
                .series
                .iter()
                .all(|row| row.contributed.is_none() && row.value.is_some())
        );
        let query = total(&product(name), "global");
        let refused = budget(&engine, &query).await.unwrap_err().to_string();
        assert!(refused.contains("only a carbon flux"), "{refused}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_last_field_holds_the_printed_budget() {
    let (_folder, store) = folder_store();
    let id = product("wavy");
    land(
        &store,
        &id,
        Quantity::CarbonFlux,
        ONE_DEGREE,
        &wavy_year(&ONE_DEGREE),
    )
    .await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let seen = Mutex::new(vec![]);
    let progress = |now: DeriveProgress| seen.lock().unwrap().push(now.done_steps);
    let derived = derive_accumulated(&engine, &id, None, &progress)
        .await
        .unwrap();
    assert_eq!(*seen.lock().unwrap(), (1..=12).collect::<Vec<_>>());

    let last = field(&store, &derived, 11).await;
    let mass_kg: f64 = last
        .iter()
        .enumerate()
        .filter(|(_, value)| !value.is_nan())
        .map(|(i, &value)| {
            f64::from(value) * ONE_DEGREE.cell_area_m2((i / 360) as u32, Earth::Wgs84)
        })
        .sum();
    let printed_tg = ask(&engine, &total(&id, "global")).await.rows[0].budget_tg;
    assert!(
        (mass_kg / 1e9 / printed_tg - 1.0).abs() < 1e-6,
        "{mass_kg} {printed_tg}"
    );

    assert_eq!(derived.quantity, Quantity::AccumulatedCarbon);
    assert_eq!(derived.product.as_str(), "wavy-accumulated");
    assert_eq!(
        derived
            .steps
            .iter()
            .map(|step| step.period)
            .collect::<Vec<_>>(),
        months(2000)
    );
}

/// A cell with data, one with a gap in February, one without any data.
const TINY: Grid = Grid {
    rows: 1,
    cols: 3,
    north_deg: 1.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

fn tiny_year() -> Vec<(Period, Vec<f32>)> {
    let month = |(i, period): (usize, Period)| {
        let flux = 1e-9 * (i as f32 - 1.2);
        (
            period,
            vec![flux, if i == 1 { f32::NAN } else { flux }, f32::NAN],
        )
    };
    months(2001)
        .into_iter()
        .take(4)
        .enumerate()
        .map(month)
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gap_adds_nothing_and_land_stays_empty() {
    let (_folder, store) = folder_store();
    land(
        &store,
        &product("tiny"),
        Quantity::CarbonFlux,
        TINY,
        &tiny_year(),
    )
    .await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let derived = derive(&engine, "tiny", None).await;
    let days = [31.0, 28.0, 31.0, 30.0];
    let (mut whole, mut gapped) = (0.0, 0.0);
    for (i, days) in days.into_iter().enumerate() {
        let grown = 1e-9 * (i as f64 - 1.2) * days * 86_400.0;
        whole += grown;
        gapped += if i == 1 { 0.0 } else { grown };
        let values = field(&store, &derived, i).await;
        assert!(
            (f64::from(values[0]) / whole - 1.0).abs() < 1e-6,
            "{i} {values:?}"
        );
        assert!(
            (f64::from(values[1]) / gapped - 1.0).abs() < 1e-6,
            "{i} {values:?}"
        );
        assert!(values[2].is_nan());
        assert_eq!(derived.steps[i].valid_cells, 2);
    }
    let series = compute::point_series(&Engine::local(store), &derived.product, place(0.5))
        .await
        .unwrap();
    let last = series.series[3].value.unwrap();
    assert!((last / (1000.0 * whole) - 1.0).abs() < 1e-6, "{last}");
}

async fn counts(store: &Store, manifest: &Manifest, step: usize) -> Contributed {
    let key = &manifest.steps[step].contributed.as_ref().unwrap().counts;
    contributed::read(store, key, &manifest.grid).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sum_says_which_steps_and_how_much_time_it_holds() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("tiny"), Quantity::CarbonFlux);
    land(&store, &id, flux, TINY, &tiny_year()).await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let derived = derive(&engine, "tiny", None).await;
    let day_ms = 86_400_000;
    let (mut whole, mut gapped) = ((0, 0), (0, 0));
    for (step, days) in [31, 28, 31, 30].into_iter().enumerate() {
        whole = (whole.0 + 1, whole.1 + days * day_ms);
        if step != 1 {
            gapped = (gapped.0 + 1, gapped.1 + days * day_ms);
        }
        let counts = counts(&store, &derived, step).await;
        assert_eq!(counts.of_steps as usize, step + 1);
        assert_eq!(counts.steps, [whole.0, gapped.0, 0]);
        assert_eq!(counts.milliseconds, [whole.1, gapped.1, 0]);
        assert_eq!(counts.period.end.ms() - counts.period.start.ms(), whole.1);
        let complete = derived.steps[step]
            .contributed
            .as_ref()
            .unwrap()
            .complete_cells;
        assert_eq!(complete, if step == 0 { 2 } else { 1 }, "{step}");
    }
    // Counted from a chosen start on: a month cut at it counts as a step with the time that is left of it.
    let start = "2001-01-11".parse().ok();
    let later = derive(&engine, "tiny", start).await;
    let counts = counts(&store, &later, 1).await;
    assert_eq!((counts.steps, counts.of_steps), (vec![2, 1, 0], 2));
    assert_eq!(counts.milliseconds, [49 * day_ms, 21 * day_ms, 0]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_month_that_nobody_landed_leaves_no_sum_complete() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("tiny"), Quantity::CarbonFlux);
    let mut steps = tiny_year();
    steps.remove(2);
    land(&store, &id, flux, TINY, &steps).await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let derived = derive(&engine, "tiny", None).await;
    let complete = derived
        .steps
        .iter()
        .map(|step| step.contributed.as_ref().unwrap().complete_cells);
    assert_eq!(complete.collect::<Vec<_>>(), [2, 1, 0]);
    let last = counts(&store, &derived, 2).await;
    assert_eq!((last.steps[0], last.of_steps), (3, 3));
    assert!((last.lacking()[0] - 31.0 / 120.0).abs() < 1e-6);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_budget_of_sums_is_that_of_their_flux_and_says_which_are_complete() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("tiny"), Quantity::CarbonFlux);
    land(&store, &id, flux, TINY, &tiny_year()).await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let derived = derive(&engine, "tiny", "2001-01-11".parse().ok()).await;
    let question = |product: &ProductId, step| BudgetQuery {
        from: "2001-01-11".parse().ok(),
        to: "2001-03-16".parse().ok(),
        step,
        ..total(product, "global")
    };
    let cell_m2 = TINY.cell_area_m2(0, Earth::Wgs84);
    for step in [TimeStep::Month, TimeStep::Total] {
        let of_flux = ask(&engine, &question(&id, step)).await;
        let of_sums = ask(&engine, &question(&derived.product, step)).await;
        assert_eq!(of_sums.manifest, derived.id());
        assert_eq!(of_sums.rows.len(), of_flux.rows.len());
        for (index, (sums, flux)) in of_sums.rows.iter().zip(&of_flux.rows).enumerate() {
            assert_eq!(sums.budget_kg, flux.budget_kg);
            assert!(flux.completeness.is_none());
            let own = sums.completeness.unwrap();
            // The second cell lacks February; of all three months it has two.
            let (complete, incomplete) = match (step, index) {
                (TimeStep::Month, 1) => (1.0, 0.0),
                (TimeStep::Month, _) => (2.0, 0.0),
                _ => (1.0, 1.0),
            };
            let cells = [own.complete_m2, own.incomplete_m2].map(|m2| m2 / cell_m2);
            assert!(
                (cells[0] - complete).abs() < 1e-9,
                "{step:?} {index} {cells:?}"
            );
            assert!(
                (cells[1] - incomplete).abs() < 1e-9,
                "{step:?} {index} {cells:?}"
            );
        }
    }
    // Before accumulation started there is nothing to sum.
    let early = BudgetQuery {
        from: None,
        ..question(&derived.product, TimeStep::Total)
    };
    let start: TimeMs = "2001-01-11".parse().unwrap();
    assert_eq!(ask(&engine, &early).await.rows[0].start, start);
}

/// Notes of statistics and of the series over a region until an instant.
async fn notes(engine: &Engine, name: &ProductId, region: &str, to: &str) -> Vec<String> {
    let region: AskedRegion = region.parse().unwrap();
    let to = to.parse().ok();
    let asked = StatisticsQuery {
        to,
        ..StatisticsQuery::new(name.clone(), region.clone().into())
    };
    let found = statistics(engine, &asked).await.unwrap().notes;
    let asked = RegionSeriesQuery {
        to,
        ..RegionSeriesQuery::new(name.clone(), region)
    };
    let series = region_series(engine, &asked).await.unwrap();
    assert_eq!(found, series.notes);
    found
}

#[tokio::test(flavor = "multi_thread")]
async fn statistics_of_sums_say_how_much_of_them_is_not_complete() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("tiny"), Quantity::CarbonFlux);
    land(&store, &id, flux, TINY, &tiny_year()).await;
    let engine = Engine::local(store.clone());
    let derived = derive(&engine, "tiny", None).await;
    let sums = &derived.product;
    // The second of three cells lacks February, the third has no data at all.
    let whole = notes(&engine, sums, "0,0,3,1", "2001-05-01").await;
    let told = "sums since 2001-01-01T00:00:00Z until 2001-05-01T00:00:00Z: those of 50.00 % of what has any lack some of that time, which adds nothing to \
                them; all together hold 88.33 % of it";
    assert_eq!(whole, [told]);
    let none = Vec::<String>::new();
    // January is complete, and so is the first cell.
    assert_eq!(notes(&engine, sums, "0,0,3,1", "2001-02-01").await, none);
    assert_eq!(notes(&engine, sums, "0,0,1,1", "2001-05-01").await, none);
    assert_eq!(notes(&engine, &id, "0,0,3,1", "2001-05-01").await, none);
    // Of one cell, and along a line.
    let point = AskedGeometry::point(place(1.5), Sampling::Cell);
    let line = AskedGeometry::line("0.1,0.5;1.9,0.5").unwrap();
    for (asked, share) in [(point, "100.00 %"), (line, "50.00 %")] {
        let query = StatisticsQuery::new(sums.clone(), asked);
        let found = statistics(&engine, &query).await.unwrap().notes;
        assert!(found[0].contains(share), "{found:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn days_of_a_budget_of_sums_read_what_its_months_read() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("tiny"), Quantity::CarbonFlux);
    land(&store, &id, flux, TINY, &tiny_year()).await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let derived = derive(&engine, "tiny", None).await;
    let mut requests = vec![];
    for (step, rows) in [(TimeStep::Month, 4), (TimeStep::Day, 120)] {
        let (store, counting) = counted(&store, "contributed/");
        let engine = Engine::standalone(store, parts(2));
        let question = BudgetQuery {
            step,
            ..total(&derived.product, "global")
        };
        let answer = ask(&engine, &question).await;
        assert_eq!(answer.rows.len(), rows);
        assert!(answer.rows.iter().all(|row| row.completeness.is_some()));
        requests.push(counting.requests());
    }
    assert!(
        requests[0] > 0 && requests[0] == requests[1],
        "{requests:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_that_did_not_count_has_a_budget_of_unknown_completeness() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("tiny"), Quantity::CarbonFlux);
    land(&store, &id, flux, TINY, &tiny_year()).await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let mut old = derive(&engine, "tiny", None).await;
    old.number += 1;
    for step in &mut old.steps {
        step.contributed = None;
    }
    storage::manifests::commit(&store, &old).await.unwrap();
    let answer = ask(&engine, &total(&old.product, "global")).await;
    assert_eq!(answer.manifest, old.id());
    assert_eq!(answer.rows[0].completeness, None);
    let told = notes(&engine, &old.product, "0,0,3,1", "2001-05-01").await;
    assert!(told[0].contains("was not counted"), "{told:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_point_says_what_its_sums_hold_as_the_stored_counts_do() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("tiny"), Quantity::CarbonFlux);
    land(&store, &id, flux, TINY, &tiny_year()).await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let local = Engine::local(store.clone());
    for start in [None, "2001-02-11".parse().ok()] {
        let derived = derive(&engine, "tiny", start).await;
        for cell in 0..3 {
            let at = place(cell as f64 + 0.5);
            let answer = compute::point_series(&local, &derived.product, at)
                .await
                .unwrap();
            for (step, point) in answer.series.iter().enumerate() {
                let (own, stored) = (
                    point.contributed.unwrap(),
                    counts(&store, &derived, step).await,
                );
                assert_eq!(
                    (own.steps, own.of_steps),
                    (stored.steps[cell], stored.of_steps)
                );
                let lacking = 100.0 * f64::from(stored.lacking()[cell]);
                assert!((own.time_percent + lacking - 100.0).abs() < 1e-4, "{own:?}");
            }
        }
    }
    let of_flux = compute::point_series(&local, &id, place(0.5))
        .await
        .unwrap();
    assert!(
        of_flux
            .series
            .iter()
            .all(|point| point.contributed.is_none())
    );
}

fn place(lon: f64) -> contract::grid::LonLatDeg {
    contract::grid::LonLatDeg::new(lon, 0.5).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_start_inside_a_step_counts_the_rest_of_it() {
    let (_folder, store) = folder_store();
    land(
        &store,
        &product("tiny"),
        Quantity::CarbonFlux,
        TINY,
        &tiny_year(),
    )
    .await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let start: TimeMs = "2001-02-11".parse().unwrap();
    let derived = derive(&engine, "tiny", Some(start)).await;
    assert_eq!(derived.steps.len(), 3);
    assert_eq!(
        derived.steps[0].period,
        Period::new(start, "2001-03-01".parse().unwrap()).unwrap()
    );
    let values = field(&store, &derived, 0).await;
    let expected = -0.2e-9 * 18.0 * 86_400.0;
    assert!(
        (f64::from(values[0]) / expected - 1.0).abs() < 1e-6,
        "{values:?}"
    );
    assert!(
        values[1].abs() < f32::MIN_POSITIVE,
        "a gap since the start is no growth yet"
    );
    let too_late = "2002-01-01".parse().ok();
    let refused = derive_accumulated(&engine, &product("tiny"), too_late, &|_progress| ()).await;
    assert!(refused.unwrap_err().to_string().contains("no step"));
}

#[tokio::test(flavor = "multi_thread")]
async fn deriving_again_changes_nothing_until_the_source_does() {
    let (_folder, store) = folder_store();
    let source = land(
        &store,
        &product("tiny"),
        Quantity::CarbonFlux,
        TINY,
        &tiny_year(),
    )
    .await;
    let engine = Engine::standalone(store.clone(), parts(2));
    let first = derive(&engine, "tiny", None).await;
    let again = derive(&engine, "tiny", None).await;
    assert_eq!(first, again);
    let body = Body::ProductDerived {
        manifest: first.id(),
        derived_from: source.id(),
    };
    assert_eq!(derived(&first), Some(body));
    assert_eq!(derived(&source), None);

    let mut revised = tiny_year();
    revised[0].1[0] = 5e-9;
    land(
        &store,
        &product("tiny"),
        Quantity::CarbonFlux,
        TINY,
        &revised,
    )
    .await;
    let third = derive(&engine, "tiny", None).await;
    assert_eq!(third.number, 2);
    assert_ne!(third.steps[0].field, first.steps[0].field);

    let later = derive(&engine, "tiny", "2001-02-01".parse().ok()).await;
    assert_eq!((later.number, later.steps.len()), (3, 3));
}

#[tokio::test(flavor = "multi_thread")]
async fn fields_have_the_same_bytes_at_any_parallelism() {
    let year = wavy_year(&ONE_DEGREE);
    let mut keys = vec![];
    for partitions in [1, 5] {
        let (_folder, store) = folder_store();
        land(
            &store,
            &product("wavy"),
            Quantity::CarbonFlux,
            ONE_DEGREE,
            &year,
        )
        .await;
        let engine = Engine::standalone(store, parts(partitions));
        let derived = derive(&engine, "wavy", None).await;
        keys.push(derived.id());
    }
    assert_eq!(keys[0], keys[1]);
}
