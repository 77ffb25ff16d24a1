//! The budgets that FluxEngine's authors print of their two verification runs, under the choices that they made.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use compute::Engine;
use contract::budget::BudgetQuery;
use contract::earth::Earth;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::region::Cells;
use contract::time::{Period, TimeStep};
use storage::Store;

use crate::fixture::{ONE_DEGREE, ask, folder_store, land, months, parts, product, total};

/// What the script says of a run, Tg C, negative into the sea.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Run {
    pub(crate) year: i32,
    pub(crate) printed_net_tg: f64,
    pub(crate) printed_missing_tg: f64,
    /// Net and missing flux of every month.
    pub(crate) printed_months_tg: Vec<[f64; 2]>,
    made_anew_net_tg: f64,
    made_anew_missing_tg: f64,
    /// By earth and how cells count, January to December.
    months_tg: BTreeMap<String, Vec<f64>>,
}

/// Runs the script; the fluxes that it makes are in the folder.
pub(crate) fn runs(folder: &Path) -> BTreeMap<String, Run> {
    let script = "../tests/reference/fluxengine_budgets.py";
    let printed = Command::new(test_data::python())
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(script))
        .args([test_data::fluxengine(""), test_data::fluxengine_land()])
        .arg(folder)
        .output()
        .unwrap();
    let trouble = String::from_utf8_lossy(&printed.stderr);
    assert!(printed.status.success(), "{trouble}");
    serde_json::from_slice(&printed.stdout).unwrap()
}

/// Fluxes that the script wrote, kg m⁻² s⁻¹.
async fn land_flux(store: &Store, folder: &Path, name: &str, year: i32) {
    let mut reader = netcdf3::FileReader::open(folder.join(format!("{name}.nc"))).unwrap();
    let grams_a_day = reader.read_var_f32("flux").unwrap();
    let of_month = |(period, values): (Period, &[f32])| {
        let kg_a_second = |value: &f32| {
            let is_none = value.to_bits() == (-999.0f32).to_bits();
            let kg_a_second = f64::from(*value) * 1e-3 / 86_400.0;
            if is_none {
                f32::NAN
            } else {
                kg_a_second as f32
            }
        };
        (period, values.iter().map(kg_a_second).collect())
    };
    let maps = grams_a_day.chunks(ONE_DEGREE.cell_count());
    let steps: Vec<_> = months(year).into_iter().zip(maps).map(of_month).collect();
    assert_eq!(steps.len(), 12);
    let flux = Quantity::CarbonFlux;
    land(store, &product(name), flux, ONE_DEGREE, &steps).await;
}

pub(crate) async fn land_mask(store: &Store) -> Arc<Manifest> {
    let mut reader = netcdf3::FileReader::open(test_data::fluxengine_land()).unwrap();
    let share = reader.read_var_f32("land_proportion").unwrap();
    let steps = [(Period::year(2000).unwrap(), share)];
    let quantity = Quantity::LandAreaFraction;
    Arc::new(land(store, &product("onedeg-land"), quantity, ONE_DEGREE, &steps).await)
}

pub(crate) fn assert_close(ours: f64, theirs: f64, by: f64, what: &str) {
    let off = (ours / theirs - 1.0).abs();
    assert!(
        off < by,
        "{what}: {ours} against {theirs}, off by {off:.1e}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn both_totals_come_out_under_the_choices_of_their_authors() {
    let (folder, store) = folder_store();
    let runs = runs(folder.path());
    let mask = land_mask(&store).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    for (name, run) in &runs {
        land_flux(&store, folder.path(), name, run.year).await;
        // The script understands what they did: their totals, gaps filled, to the last digits that they print.
        assert_close(run.made_anew_net_tg, run.printed_net_tg, 2e-7, "net");
        assert_close(
            run.made_anew_missing_tg,
            run.printed_missing_tg,
            2e-6,
            "missing",
        );
        for (choice, independent) in &run.months_tg {
            let (earth, cells) = choice.split_once(' ').unwrap();
            let query = BudgetQuery {
                step: TimeStep::Month,
                earth: earth.parse().unwrap(),
                cells: cells.parse().unwrap(),
                ocean: Some(Arc::clone(&mask)),
                ..total(&product(name), "global")
            };
            let answer = ask(&engine, &query).await;
            assert_eq!((answer.earth, answer.cells), (query.earth, query.cells));
            assert!(answer.ocean_source.contains("onedeg-land@1"));
            assert_eq!(answer.rows.len(), 12);
            let ours: Vec<f64> = answer.rows.iter().map(|row| row.budget_tg).collect();
            for (month, (ours, independent)) in ours.iter().zip(independent).enumerate() {
                assert_close(
                    *ours,
                    *independent,
                    1e-6,
                    &format!("{name} {choice} {month}"),
                );
            }
            if (query.earth, query.cells) == (Earth::LocalRadius, Cells::OceanShare) {
                the_printed(name, run, &ours);
            }
        }
    }
    assert_eq!(runs.len(), 2);
}

/// Ours under their choices, which is what they print less what they fill gaps with.
fn the_printed(name: &str, run: &Run, ours: &[f64]) {
    /// Their year is twelve of these.
    const MONTH_DAYS: f64 = 30.5;
    let mut year_tg = 0.0;
    let periods = months(run.year);
    for ((ours, [net, missing]), period) in ours.iter().zip(&run.printed_months_tg).zip(periods) {
        // They print eight digits of each.
        assert_close(*ours, net - missing, 1e-6, name);
        year_tg += ours * MONTH_DAYS * 86_400.0 / period.seconds();
    }
    let printed_tg = run.printed_net_tg - run.printed_missing_tg;
    assert_close(year_tg, printed_tg, 1e-6, name);
    eprintln!(
        "{name}: printed net {} = {printed_tg:.4} and {} for gaps; ours {year_tg:.4} Tg C in twelve months of {MONTH_DAYS} days",
        run.printed_net_tg, run.printed_missing_tg
    );
}
