//! Budgets with known answers, and questions that have none.

use compute::computed::{Request, RequestedInput, compute};
use compute::derive::derive_statistic;
use compute::{ComputeError, Engine, ErrorClass, budget, derive_accumulated};
use contract::analysis::{MapOptions, MapStatistic};
use contract::budget::BudgetQuery;
use contract::computed::{Computation, Matching, Regridding};
use contract::earth::Earth;
use contract::grid::Grid;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::statistics::Percentile;
use contract::time::{Period, TimeStep};
use cube::{At, Description, Repository};
use storage::manifests;

use crate::computed::FOUR_DEGREES;
use crate::fixture::{
    ONE_DEGREE, ask, folder_store, land, months, parts, product, total, wavy_year,
};

/// A flux that an f32 holds exactly: 2^-30 kg m⁻² s⁻¹.
const FLUX: f32 = 1.0 / (1u32 << 30) as f32;

fn even_year() -> Vec<(Period, Vec<f32>)> {
    months(2000)
        .into_iter()
        .map(|period| (period, vec![FLUX; ONE_DEGREE.cell_count()]))
        .collect()
}

fn kg(text: &str) -> f64 {
    text.parse().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_even_flux_integrates_to_area_times_time() {
    let (_folder, store) = folder_store();
    let id = product("even");
    let manifest = land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &even_year()).await;
    let engine = Engine::standalone(store, parts(2));

    let globe = ask(&engine, &total(&id, "global")).await;
    let area_m2 = Earth::Wgs84.cell_area_m2(-90.0, 90.0, 360.0);
    let expected_kg = f64::from(FLUX) * area_m2 * 366.0 * 86_400.0;
    assert_eq!(globe.rows.len(), 1);
    assert_eq!(globe.manifest, manifest.id());
    assert!((kg(&globe.rows[0].budget_kg) / expected_kg - 1.0).abs() < 1e-12);
    assert!((globe.rows[0].coverage_percent - 100.0).abs() < 1e-9);
    assert!((globe.rows[0].area_m2 / area_m2 - 1.0).abs() < 1e-12);

    // Half a cell, a third of a row, across the date line, and parts of two months.
    let query = BudgetQuery {
        from: Some("2000-01-31".parse().unwrap()),
        to: Some("2000-02-11".parse().unwrap()),
        step: TimeStep::Month,
        ..total(&id, "179.5,0.25,-178.75,0.75")
    };
    let answer = ask(&engine, &query).await;
    let area_m2 = Earth::Wgs84.cell_area_m2(0.25, 0.75, 1.75);
    let days = [1.0, 10.0];
    assert_eq!(answer.rows.len(), 2);
    for (row, days) in answer.rows.iter().zip(days) {
        let expected_kg = f64::from(FLUX) * area_m2 * days * 86_400.0;
        assert!(
            (kg(&row.budget_kg) / expected_kg - 1.0).abs() < 1e-11,
            "{row:?} {expected_kg}"
        );
        assert!((row.region_area_m2 / area_m2 - 1.0).abs() < 1e-12);
    }

    let sphere = ask(
        &engine,
        &BudgetQuery {
            earth: Earth::Sphere,
            ..total(&id, "global")
        },
    )
    .await;
    let ratio = sphere.rows[0].budget_tg / globe.rows[0].budget_tg;
    let expected = Earth::Sphere.cell_area_m2(-90.0, 90.0, 360.0)
        / Earth::Wgs84.cell_area_m2(-90.0, 90.0, 360.0);
    assert!((ratio / expected - 1.0).abs() < 1e-12);
}

#[tokio::test(flavor = "multi_thread")]
async fn months_and_years_and_the_total_are_the_same_mass() {
    let (_folder, store) = folder_store();
    let id = product("even");
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &even_year()).await;
    let engine = Engine::standalone(store, parts(2));
    let mut sums = vec![];
    for (step, rows) in [
        (TimeStep::Month, 12),
        (TimeStep::Year, 1),
        (TimeStep::Total, 1),
    ] {
        let answer = ask(
            &engine,
            &BudgetQuery {
                step,
                ..total(&id, "14n-50n")
            },
        )
        .await;
        assert_eq!(answer.rows.len(), rows);
        assert!(
            answer
                .rows
                .windows(2)
                .all(|pair| pair[0].end == pair[1].start),
            "rows are in the order of time"
        );
        sums.push(exact_sum(
            answer.rows.iter().map(|row| row.budget_kg.as_str()),
        ));
    }
    assert!(sums.iter().all(|&sum| sum == sums[0]), "{sums:?}");
}

/// Sum of decimal texts of nine decimals, without rounding.
fn exact_sum<'a>(texts: impl Iterator<Item = &'a str>) -> i128 {
    texts
        .map(|text| text.replace('.', "").parse::<i128>().unwrap())
        .sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_in_memory_serves_ballista_too() {
    let store = storage::Store::memory();
    let id = product("even");
    land(
        &store,
        &id,
        Quantity::CarbonFlux,
        ONE_DEGREE,
        &even_year()[..2],
    )
    .await;
    let answer = ask(&Engine::standalone(store, parts(2)), &total(&id, "global")).await;
    assert!((answer.rows[0].coverage_percent - 100.0).abs() < 1e-9);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_in_a_folder_with_an_odd_name_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let odd = folder.path().join("a b%20c#d[1]é");
    let store = storage::Store::open(odd.to_str().unwrap()).unwrap();
    let id = product("even");
    land(
        &store,
        &id,
        Quantity::CarbonFlux,
        ONE_DEGREE,
        &even_year()[..1],
    )
    .await;
    let answer = ask(&Engine::standalone(store, parts(2)), &total(&id, "global")).await;
    assert_eq!(answer.rows.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_region_larger_than_the_grid_is_covered_in_part() {
    let grid = Grid {
        rows: 10,
        cols: 20,
        north_deg: 10.0,
        west_deg: 100.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };
    let (_folder, store) = folder_store();
    let id = product("small");
    let mut values = vec![FLUX; grid.cell_count()];
    values[..100].fill(f32::NAN); // the northern half
    land(
        &store,
        &id,
        Quantity::CarbonFlux,
        grid,
        &[(Period::month(2000, 1).unwrap(), values)],
    )
    .await;
    let engine = Engine::local(store);
    let row = &ask(&engine, &total(&id, "90,0,130,10")).await.rows[0];
    let held_m2 = Earth::Wgs84.cell_area_m2(0.0, 5.0, 20.0);
    let asked_m2 = Earth::Wgs84.cell_area_m2(0.0, 10.0, 40.0);
    assert!((row.area_m2 / held_m2 - 1.0).abs() < 1e-12);
    assert!((row.region_area_m2 / asked_m2 - 1.0).abs() < 1e-12);
    // The sea off Vietnam and Malaysia, and land beside it.
    assert!(row.ocean_area_m2 < 0.9 * asked_m2 && row.ocean_with_data_m2 < 0.9 * held_m2);
    let of_sea_percent = 100.0 * row.ocean_with_data_m2 / row.ocean_area_m2;
    assert!((row.coverage_percent / of_sea_percent - 1.0).abs() < 1e-12);
}

/// A small grid with a product of fluxes and one of temperatures, January 2000.
async fn small_products(store: &storage::Store) {
    let grid = Grid {
        rows: 10,
        cols: 20,
        north_deg: 10.0,
        west_deg: 100.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };
    for (name, quantity) in [
        ("flux", Quantity::CarbonFlux),
        ("sst", Quantity::SeaSurfaceTemperature),
    ] {
        let values = vec![FLUX; grid.cell_count()];
        let steps = [(Period::month(2000, 1).unwrap(), values)];
        land(store, &product(name), quantity, grid, &steps).await;
    }
}

async fn refusal(engine: &Engine, query: BudgetQuery) -> ComputeError {
    budget(engine, &query).await.unwrap_err()
}

#[tokio::test(flavor = "multi_thread")]
async fn questions_without_an_answer_are_refused_with_the_reason() {
    let (_folder, store) = folder_store();
    small_products(&store).await;
    let engine = Engine::local(store);

    let unknown = refusal(&engine, total(&product("nothing"), "global")).await;
    assert_eq!(unknown.class(), ErrorClass::NotFound);
    assert!(unknown.to_string().contains("flux, sst"), "{unknown}");
    let no_flux = refusal(&engine, total(&product("sst"), "global")).await;
    let text = no_flux.to_string();
    assert!(text.contains("only a carbon flux has a budget"), "{text}");
    let elsewhere = refusal(&engine, total(&product("flux"), "-60,0,-50,5")).await;
    let text = elsewhere.to_string();
    assert!(text.contains("does not touch"), "{text}");
}

#[tokio::test(flavor = "multi_thread")]
async fn periods_without_a_step_are_refused_with_what_there_is() {
    let (_folder, store) = folder_store();
    small_products(&store).await;
    let engine = Engine::local(store);
    let between = |from: &str, to: &str| BudgetQuery {
        from: from.parse().ok(),
        to: to.parse().ok(),
        ..total(&product("flux"), "global")
    };
    for query in [between("", "1999"), between("2001", "")] {
        let no_step = refusal(&engine, query).await;
        let covered = "2000-01-01T00:00:00Z/2000-02-01T00:00:00Z";
        assert!(no_step.to_string().contains(covered), "{no_step}");
        assert_eq!(no_step.class(), ErrorClass::BadRequest);
    }
    let backwards = refusal(&engine, between("2001", "2000")).await;
    assert_eq!(backwards.class(), ErrorClass::BadRequest);
}

/// Cells that each have their value from another time have no sum.
#[tokio::test(flavor = "multi_thread")]
async fn extremes_of_a_flux_have_no_budget() {
    let (_folder, store) = folder_store();
    let (id, year) = (product("wavy"), wavy_year(&ONE_DEGREE));
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &year).await;
    let engine = Engine::local(store.clone());
    let made = async |statistic: MapStatistic| {
        let options = MapOptions::new(statistic);
        let made = derive_statistic(&engine, &id, &options, &|_| ()).await;
        made.unwrap().product
    };
    let whole = budget(&engine, &total(&id, "global")).await.unwrap();
    let mean = made(MapStatistic::Mean).await;
    let mean = budget(&engine, &total(&mean, "global")).await.unwrap();
    let [whole, mean] = [&whole, &mean].map(|answer| kg(&answer.rows[0].budget_kg));
    // Gaps of the months are none in the mean.
    assert!((whole - mean).abs() < 0.2 * whole.abs(), "{whole} {mean}");
    for (statistic, what) in [
        (MapStatistic::Max, "highest values"),
        (MapStatistic::Min, "lowest values"),
        (MapStatistic::Percentile(Percentile::MEDIAN), "medians"),
        (
            MapStatistic::Percentile("95".parse().unwrap()),
            "percentiles (p95)",
        ),
    ] {
        let product = made(statistic).await;
        let refused = budget(&engine, &total(&product, "global"))
            .await
            .unwrap_err();
        let refused = refused.to_string();
        let told = format!("holds the {what} of each cell of wavy");
        assert!(refused.contains(&told), "{refused}");
        let refused = derive_accumulated(&engine, &product, None, &|_| ()).await;
        assert!(refused.unwrap_err().to_string().contains(&told));
    }
}

/// Nor where it is brought to another grid or averaged, and its cube says so to whoever reads it elsewhere.
#[tokio::test(flavor = "multi_thread")]
async fn an_extreme_of_a_flux_is_one_on_another_grid_and_averaged() {
    let (_folder, store) = folder_store();
    let (id, year) = (product("wavy"), wavy_year(&ONE_DEGREE));
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &year).await;
    let engine = Engine::local(store.clone());
    let made = async |source: ProductId, statistic: MapStatistic, name: &'static str| {
        let options = MapOptions {
            name: Some(product(name)),
            ..MapOptions::new(statistic)
        };
        let made = derive_statistic(&engine, &source, &options, &|_| ()).await;
        made.unwrap().product
    };
    let highest = made(id, MapStatistic::Max, "highest").await;
    let averaged = made(highest.clone(), MapStatistic::Mean, "averaged").await;
    let request = Request {
        target: product("coarse"),
        title: None,
        quantity: None,
        how: Computation::Regrid {
            method: Regridding::Conservative,
            min_coverage: 0.0,
        },
        grid: Some(FOUR_DEGREES),
        inputs: vec![RequestedInput {
            name: "source".into(),
            product: averaged.clone(),
            matching: Matching::SamePeriod,
        }],
        from: None,
        to: None,
    };
    compute(&engine, &request, &|_| ()).await.unwrap();
    for product in [highest, averaged, product("coarse")] {
        let newest = manifests::latest(&store, &product).await.unwrap().unwrap();
        assert_eq!(newest.quantity, Quantity::CarbonFlux);
        let described = Description::of(&store, &newest).await.unwrap();
        let folder = cube::folder(&product);
        let repository = Repository::open(&store, &folder).await.unwrap();
        let cube = repository.at(&At::Newest).await.unwrap();
        for description in [&described, cube.description()] {
            assert_eq!(description.statistic, Some(MapStatistic::Max), "{product}");
        }
        let refused = budget(&engine, &total(&product, "global")).await;
        let refused = refused.unwrap_err().to_string();
        assert!(
            refused.contains("holds the highest values of each cell of wavy"),
            "{refused}"
        );
    }
}

/// Nor where arithmetic makes a flux of it; what is only compared with it is one.
#[tokio::test(flavor = "multi_thread")]
async fn what_an_expression_makes_of_an_extreme_of_a_flux_has_no_budget() {
    let (_folder, store) = folder_store();
    let (id, year) = (product("wavy"), wavy_year(&ONE_DEGREE));
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &year).await;
    let engine = Engine::local(store.clone());
    for (statistic, name) in [(MapStatistic::Max, "highest"), (MapStatistic::Mean, "mean")] {
        let options = MapOptions {
            name: Some(product(name)),
            ..MapOptions::new(statistic)
        };
        let made = derive_statistic(&engine, &id, &options, &|_| ()).await;
        made.unwrap();
    }
    let input = |name: &&str| RequestedInput {
        name: (*name).to_owned(),
        product: product(name),
        matching: Matching::SamePeriod,
    };
    let made = async |target: &'static str, expression: &str, inputs: &[&str]| {
        let request = Request {
            target: product(target),
            title: None,
            quantity: Some(Quantity::CarbonFlux),
            how: Computation::Expression {
                expression: expression.to_owned(),
            },
            grid: None,
            inputs: inputs.iter().map(input).collect(),
            from: None,
            to: None,
        };
        compute(&engine, &request, &|_| ()).await.unwrap();
        budget(&engine, &total(&product(target), "global")).await
    };
    let compared = "CASE WHEN highest > 0 THEN mean ELSE 0 END";
    let compared = made("compared", compared, &["highest", "mean"]).await;
    assert_eq!(compared.unwrap().rows.len(), 1);
    for (target, expression, inputs) in [
        ("half", "highest * 0.5", &["highest"][..]),
        ("beside", "mean - highest", &["highest", "mean"][..]),
        ("again", "half + mean", &["half", "mean"][..]),
    ] {
        let refused = made(target, expression, inputs).await.unwrap_err();
        let refused = refused.to_string();
        let told = "the result of an expression over the highest values of each cell of wavy";
        assert!(refused.contains(told), "{target}: {refused}");
    }
}
