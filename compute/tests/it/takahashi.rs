//! The real Takahashi (2009) grids against the published budgets.

use std::path::Path;
use std::process::Command;

use compute::published::INTEGRALS;
use compute::{Engine, compare, derive_accumulated};
use contract::budget::BudgetQuery;
use contract::check::Verdict;
use contract::earth::Earth;
use contract::quantity::Quantity;
use contract::time::TimeStep;

use crate::fixture::{ONE_DEGREE, ask, folder_store, land, parts, product, takahashi_year, total};

#[tokio::test(flavor = "multi_thread")]
async fn the_real_grids_have_the_published_budgets() {
    let year = takahashi_year();
    let (_folder, store) = folder_store();
    let id = product("takahashi09-flux");
    land(&store, &id, Quantity::CarbonFlux, ONE_DEGREE, &year).await;
    let engine = Engine::standalone(store.clone(), parts(3));

    let rows = compare(&engine, &id).await.unwrap();
    for row in &rows {
        eprintln!(
            "{:40} {:15} {} {:.7} {:+.1e} {} {:?}",
            row.what, row.period, row.independent, row.ours, row.difference, row.unit, row.paper
        );
    }
    assert_eq!(rows.len(), 18);
    let off: Vec<_> = rows.iter().filter(|row| !row.agrees).collect();
    assert!(off.is_empty(), "{off:#?}");
    let verdicts: Vec<_> = rows
        .iter()
        .filter_map(|row| Some(row.paper.as_ref()?.verdict))
        .collect();
    let [within, open] = [Verdict::Within, Verdict::NoUncertaintyStated];
    assert_eq!(verdicts, [within, within, open, open, open, open]);

    let globe = &ask(&engine, &total(&id, "global")).await.rows[0];
    assert!(
        (globe.area_m2 / 334.1e12 - 1.0).abs() < 1e-3,
        "{}",
        globe.area_m2
    );

    let derived = derive_accumulated(&engine, &id, None, &|_progress| ())
        .await
        .unwrap();
    let last = storage::fields::read(&store, &derived.steps[11].field, &ONE_DEGREE)
        .await
        .unwrap();
    let mass_kg: f64 = last
        .iter()
        .enumerate()
        .filter(|(_, value)| !value.is_nan())
        .map(|(i, &value)| {
            f64::from(value) * ONE_DEGREE.cell_area_m2((i / 360) as u32, Earth::Wgs84)
        })
        .sum();
    assert!(
        (mass_kg / 1e9 / globe.budget_tg - 1.0).abs() < 1e-6,
        "{mass_kg} {}",
        globe.budget_tg
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn read_as_centres_the_real_grids_would_fail_the_check() {
    let year = takahashi_year();
    let (_folder, store) = folder_store();
    let id = product("takahashi09-flux");
    // The planted fault: labels taken for centres shift every row by half a cell.
    let shifted = contract::grid::Grid {
        north_deg: 89.5,
        rows: 179,
        ..ONE_DEGREE
    };
    let cut: Vec<_> = year
        .into_iter()
        .map(|(period, values)| (period, values[..179 * 360].to_vec()))
        .collect();
    land(&store, &id, Quantity::CarbonFlux, shifted, &cut).await;
    let engine = Engine::standalone(store, parts(2));
    let rows = compare(&engine, &id).await.unwrap();
    assert!(rows.iter().any(|row| !row.agrees));
    let band = ask(
        &engine,
        &BudgetQuery {
            step: TimeStep::Year,
            ..total(&id, "50s-62s")
        },
    )
    .await;
    assert!(
        (band.rows[0].budget_tg + 66.0).abs() > 10.0,
        "{}",
        band.rows[0].budget_tg
    );
}

#[test]
fn the_independent_numbers_are_what_the_script_makes_of_the_files() {
    let script =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/reference/takahashi09_integral.py");
    let printed = Command::new(test_data::python())
        .arg(script)
        .arg(test_data::fluxengine("takahashi09"))
        .output()
        .unwrap();
    let trouble = String::from_utf8_lossy(&printed.stderr);
    assert!(printed.status.success(), "{trouble}");
    let now: compute::published::Integrals = serde_json::from_slice(&printed.stdout).unwrap();
    let kept = &*INTEGRALS;
    assert_eq!(now.years.len(), kept.years.len());
    for year in &kept.years {
        let pg = now.year_pg(&year.region, year.earth).unwrap();
        assert!((pg - year.pg).abs() < 2e-9, "{year:?} is now {pg}");
    }
    let months = now.months_tg.iter().zip(&kept.months_tg);
    assert!(months.len() == 12 && now.months_tg.len() == 12);
    for (now, kept) in months {
        assert!((now - kept).abs() < 2e-6, "{kept} is now {now}");
    }
}
