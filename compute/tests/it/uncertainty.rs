//! How uncertain a budget is: limits in closed form, errors of products, an independent computation over real grids, and errors that
//! fit no flux.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use compute::{Engine, ErrorClass, budget};
use contract::budget::{BudgetErrors, BudgetQuery, ErrorWords};
use contract::earth::Earth;
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::{CARBON_KG_PER_MOL, Quantity, SECONDS_PER_YEAR};
use contract::region::Cells;
use contract::time::{Period, TimeStep};
use serde::Deserialize;
use storage::Store;

use crate::fixture::{
    ONE_DEGREE, ask, folder_store, land, months, parts, product, takahashi_year, total, wavy_year,
};

/// 2⁻³⁰ kg m⁻² s⁻¹: an f32 holds it exactly.
const FLUX: f32 = 1.0 / (1u32 << 30) as f32;
const KG_PER_TG: f64 = 1e9;
/// 12 x 24 cells, rows 3 to 8 of which lie in [`BAND`].
const GRID: Grid = Grid {
    rows: 12,
    cols: 24,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 15.0,
    dlon_deg: 15.0,
};
const BAND: &str = "-180,-45,180,45";

fn errors(error: &str, length_km: f64, days: f64) -> BudgetErrors {
    let words = ErrorWords {
        error: Some(error),
        correlation_length_km: Some(length_km),
        correlation_days: Some(days),
        ..ErrorWords::default()
    };
    words.asked().unwrap().unwrap()
}

fn asked(name: &str, region: &str, errors: BudgetErrors) -> BudgetQuery {
    BudgetQuery {
        errors: Some(errors),
        ..total(&product(name), region)
    }
}

/// A quarter of even flux.
async fn even(store: &Store) -> Manifest {
    let steps: Vec<_> = months(2000)[..3]
        .iter()
        .map(|period| (*period, vec![FLUX; GRID.cell_count()]))
        .collect();
    land(store, &product("even"), Quantity::CarbonFlux, GRID, &steps).await
}

fn near(found: f64, wanted: f64, slack: f64) {
    assert!(
        (found / wanted - 1.0).abs() < slack,
        "{found} is not {wanted}"
    );
}

/// Area of the cells of [`BAND`], m².
fn areas_m2() -> Vec<f64> {
    let rows = (3..9).map(|row| GRID.cell_area_m2(row, Earth::Wgs84));
    rows.flat_map(|area_m2| vec![area_m2; 24]).collect()
}

fn seconds() -> Vec<f64> {
    months(2000)[..3]
        .iter()
        .map(|period| period.seconds())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn both_limits_have_their_closed_form() {
    let (_folder, store) = folder_store();
    even(&store).await;
    let engine = Engine::local(store);
    let flux = f64::from(FLUX);
    // What each cell adds in each month, kg.
    let of = |share: f64| -> Vec<f64> {
        let cells = areas_m2();
        let months = seconds();
        let cell = |area: &f64| months.iter().map(|s| share * area * s).collect::<Vec<_>>();
        cells.iter().flat_map(cell).collect()
    };
    let absolute = 0.3 * CARBON_KG_PER_MOL / SECONDS_PER_YEAR;
    for (error, share) in [("20%", 0.2 * flux), ("0.3 mol m-2 year-1", absolute)] {
        let parts = of(share);
        let alone_tg = parts.iter().map(|kg| kg * kg).sum::<f64>().sqrt() / KG_PER_TG;
        let together_tg = parts.iter().sum::<f64>() / KG_PER_TG;
        for (length_km, days) in [(0.0, 0.0), (2000.0, 30.0), (1e6, 1e6)] {
            let query = asked("even", BAND, errors(error, length_km, days));
            let answer = ask(&engine, &query).await;
            let own = answer.rows[0].uncertainty.unwrap();
            near(own.uncorrelated_tg, alone_tg, 1e-12);
            near(own.fully_correlated_tg, together_tg, 1e-12);
            near(own.error_coverage_percent, 100.0, 1e-12);
            match length_km {
                0.0 => near(own.sigma_tg, alone_tg, 1e-12),
                2000.0 => assert!(own.sigma_tg > alone_tg && own.sigma_tg < together_tg),
                // rho is at least exp(-0.02).
                _ => near(own.sigma_tg, together_tg, 0.01),
            }
        }
    }
    // A share of an even flux that all share is that share of the budget.
    let answer = ask(&engine, &asked("even", BAND, errors("20%", 500.0, 0.0))).await;
    let own = answer.rows[0].uncertainty.unwrap();
    near(
        own.fully_correlated_tg,
        0.2 * answer.rows[0].budget_tg,
        1e-12,
    );
    let basis = answer.uncertainty.unwrap();
    assert!(basis.scheme.contains("6 x 24 cells"), "{}", basis.scheme);
    assert!(
        basis
            .assumptions
            .iter()
            .any(|one| one.contains("each step is its own"))
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn rows_of_months_add_by_squares_where_steps_are_on_their_own() {
    let (_folder, store) = folder_store();
    even(&store).await;
    let engine = Engine::local(store);
    let of = |step, days| BudgetQuery {
        step,
        ..asked("even", "0,0,100,60", errors("15%", 800.0, days))
    };
    let by_month = ask(&engine, &of(TimeStep::Month, 0.0)).await.rows;
    let squares: f64 = by_month
        .iter()
        .map(|row| row.uncertainty.unwrap().sigma_tg.powi(2))
        .sum();
    let whole = ask(&engine, &of(TimeStep::Total, 0.0)).await.rows[0].uncertainty;
    near(whole.unwrap().sigma_tg, squares.sqrt(), 1e-12);
    // Months that go together add up to more, at most to their sum.
    let sum: f64 = by_month
        .iter()
        .map(|row| row.uncertainty.unwrap().sigma_tg)
        .sum();
    let joined = ask(&engine, &of(TimeStep::Total, 90.0)).await.rows[0].uncertainty;
    let joined = joined.unwrap().sigma_tg;
    assert!(
        joined > 1.2 * squares.sqrt() && joined < sum,
        "{joined} {sum}"
    );
    let always = ask(&engine, &of(TimeStep::Total, 1e6)).await.rows[0].uncertainty;
    near(always.unwrap().sigma_tg, sum, 1e-4);
}

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_parts_and_only_the_sea_of_cells() {
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
    let query = BudgetQuery {
        step: TimeStep::Month,
        ..asked("wavy", "100,-20,210,33.3", errors("25%", 600.0, 60.0))
    };
    let one = ask(&Engine::in_process(store.clone(), parts(1)), &query).await;
    let many = ask(&Engine::in_process(store.clone(), parts(5)), &query).await;
    assert_eq!(one, many);
    let sea = BudgetQuery {
        cells: Cells::OceanShare,
        ..query
    };
    let sea = ask(&Engine::local(store), &sea).await;
    let sigma =
        |answer: &contract::budget::BudgetAnswer| answer.rows[0].uncertainty.unwrap().sigma_tg;
    assert!(sigma(&sea) < sigma(&one) && sigma(&sea) > 0.5 * sigma(&one));
}

/// Errors as a product: of each month 2⁻³³ in some cells.
async fn error_product(store: &Store, name: &str, grid: Grid, steps: &[Period]) -> Arc<Manifest> {
    let value = |cell: usize| if cell % 24 < 6 { f32::NAN } else { FLUX / 8.0 };
    let values: Vec<f32> = (0..grid.cell_count()).map(value).collect();
    let steps: Vec<_> = steps
        .iter()
        .map(|period| (*period, values.clone()))
        .collect();
    let quantity = Quantity::open("flux_standard_error", "mol m-2 s-1", "Standard error").unwrap();
    Arc::new(land(store, &product(name), quantity, grid, &steps).await)
}

fn of_product(manifest: &Arc<Manifest>) -> BudgetErrors {
    BudgetErrors {
        of_product: Some(Arc::clone(manifest)),
        ..errors(manifest.product.as_str(), 0.0, 0.0)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_of_a_product_count_where_it_has_them_and_that_is_said() {
    let (_folder, store) = folder_store();
    even(&store).await;
    let by_month = error_product(&store, "errors", GRID, &months(2000)[..3]).await;
    let map = error_product(&store, "error-map", GRID, &[Period::year(1990).unwrap()]).await;
    let engine = Engine::local(store);
    let share = f64::from(FLUX) / 8.0 * CARBON_KG_PER_MOL;
    let columns = areas_m2()
        .into_iter()
        .enumerate()
        .filter(|(cell, _)| cell % 24 >= 6);
    let months = seconds();
    let squares: f64 = columns
        .flat_map(|(_, area)| months.iter().map(move |s| (share * area * s).powi(2)))
        .sum();
    for manifest in [by_month, map] {
        let answer = ask(&engine, &asked("even", BAND, of_product(&manifest))).await;
        let own = answer.rows[0].uncertainty.unwrap();
        near(own.sigma_tg, squares.sqrt() / KG_PER_TG, 1e-12);
        near(own.error_coverage_percent, 75.0, 1e-9);
        let basis = answer.uncertainty.unwrap();
        assert_eq!(basis.manifest, Some(manifest.id()));
        let said = basis.assumptions.join("; ");
        assert!(said.contains("25.0 % of the area and time"), "{said}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_that_fit_no_flux_are_refused_with_the_reason() {
    let (_folder, store) = folder_store();
    even(&store).await;
    let other = Grid {
        cols: 12,
        dlon_deg: 30.0,
        ..GRID
    };
    let elsewhere = error_product(&store, "elsewhere", other, &months(2000)[..3]).await;
    let short = error_product(&store, "short", GRID, &months(2000)[..2]).await;
    let map = |name, quantity, value| {
        let steps = [(Period::year(2000).unwrap(), vec![value; GRID.cell_count()])];
        let store = store.clone();
        async move { Arc::new(land(&store, &product(name), quantity, GRID, &steps).await) }
    };
    let warm = map("warm", Quantity::SeaSurfaceTemperature, 280.0).await;
    let below = map("below", Quantity::CarbonFlux, -1e-9).await;
    let engine = Engine::local(store);
    for (errors, wanted) in [
        (of_product(&elsewhere), "derive regrid"),
        (of_product(&short), "2000-03-01"),
        (of_product(&warm), "its unit \"K\""),
        (of_product(&below), "288 cells"),
        (errors("0.3 furlong", 1.0, 0.0), "no unit of a flux"),
        (errors("0.3 mol", 1.0, 0.0), "no unit of a flux"),
    ] {
        let query = asked("even", BAND, errors);
        let refused = budget(&engine, &query).await.unwrap_err();
        assert_eq!(refused.class(), ErrorClass::BadRequest, "{refused}");
        assert!(refused.to_string().contains(wanted), "{refused}");
    }
}

/// What `tests/reference/budget_uncertainty.py` prints.
#[derive(Deserialize)]
struct Reference {
    question: String,
    budget_tg: f64,
    sigma_tg: f64,
}

#[tokio::test(flavor = "multi_thread")]
async fn an_independent_sum_over_pairs_of_the_real_grids_says_the_same() {
    let script =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/reference/budget_uncertainty.py");
    let printed = Command::new(test_data::python())
        .arg("-B")
        .arg(script)
        .arg(test_data::fluxengine("takahashi09"))
        .output()
        .unwrap();
    let trouble = String::from_utf8_lossy(&printed.stderr);
    assert!(printed.status.success(), "{trouble}");
    let expected: Vec<Reference> = serde_json::from_slice(&printed.stdout).unwrap();
    let (_folder, store) = folder_store();
    let id = product("takahashi09-flux");
    land(
        &store,
        &id,
        Quantity::CarbonFlux,
        ONE_DEGREE,
        &takahashi_year(),
    )
    .await;
    let engine = Engine::in_process(store, parts(2));
    let absolute = "0.5 mol m-2 year-1";
    let questions = [
        ("relative", errors("20%", 700.0, 0.0)),
        ("relative, months together", errors("20%", 700.0, 45.0)),
        ("absolute", errors(absolute, 1500.0, 0.0)),
        ("absolute, months together", errors(absolute, 400.0, 120.0)),
        ("each cell by itself", errors("20%", 0.0, 0.0)),
    ];
    assert_eq!(expected.len(), questions.len());
    for (expected, (question, errors)) in expected.iter().zip(questions) {
        assert_eq!(expected.question, question);
        let answer = ask(&engine, &asked("takahashi09-flux", "14n-50n", errors)).await;
        near(answer.rows[0].budget_tg, expected.budget_tg, 1e-6);
        near(
            answer.rows[0].uncertainty.unwrap().sigma_tg,
            expected.sigma_tg,
            1e-6,
        );
    }
}
