use super::*;
use crate::budget::{Completeness, RowRiver, RowUncertainty};
use crate::earth::Earth;
use crate::region::Cells;
use crate::time::{Period, TimeMs};

fn row(month: u32, budget_tg: f64) -> BudgetRow {
    let Period { start, end } = Period::month(2000, month).unwrap();
    BudgetRow {
        start,
        end,
        budget_kg: format!("{budget_tg}000000000.000000001"),
        budget_tg,
        coverage_percent: 50.0,
        area_m2: 1.0,
        region_area_m2: 4.0,
        ocean_area_m2: 3.0,
        ocean_with_data_m2: 1.5,
        gap_tg: None,
        gap_area_m2: 0.0,
        completeness: None,
        uncertainty: None,
        river: None,
    }
}

fn answer() -> BudgetAnswer {
    BudgetAnswer {
        product: "flux".parse().unwrap(),
        manifest: "flux@1-0a1b2c3d".parse().unwrap(),
        title: "Flux".to_owned(),
        source: "a test".to_owned(),
        synthetic: true,
        region: "global".to_owned(),
        earth: Earth::Wgs84,
        cells: Cells::Whole,
        ocean_source: String::new(),
        unit: "Tg C".to_owned(),
        region_area_m2: 4.0,
        ocean_area_m2: 3.0,
        gap_basis: String::new(),
        notes: vec![],
        uncertainty: None,
        river: None,
        rows: vec![row(1, 3.0), row(2, 4.0)],
        regions: vec![],
        closure: None,
    }
}

fn names(columns: &Columns) -> Vec<&str> {
    let columns = columns.columns.iter();
    columns.map(|own| own.name.as_str()).collect()
}

fn values<'a>(columns: &'a Columns, name: &str) -> &'a ColumnValues {
    let found = columns.columns.iter().find(|own| own.name == name);
    &found.unwrap().values
}

fn texts_of(all: &[&str]) -> ColumnValues {
    ColumnValues::Texts(all.iter().map(|own| Some((*own).to_owned())).collect())
}

#[test]
fn regions_come_before_the_whole_and_each_row_says_whose_it_is() {
    let mut own = answer();
    let plain = own.columns();
    assert_eq!(names(&plain).len(), 12);
    assert_eq!(values(&plain, "region"), &texts_of(&["global", "global"]));
    own.regions = vec![RegionBudget {
        region: "basins@1-0a1b2c3d:1 (atlantic)".to_owned(),
        region_area_m2: 1.0,
        ocean_area_m2: 1.0,
        notes: vec![],
        rows: vec![row(1, 1.0)],
    }];
    let columns = own.columns();
    let regions = ["basins@1-0a1b2c3d:1 (atlantic)", "global", "global"];
    assert_eq!(values(&columns, "region"), &texts_of(&regions));
    let budgets = ColumnValues::Numbers(vec![Some(1.0), Some(3.0), Some(4.0)]);
    assert_eq!(values(&columns, "budget_tg"), &budgets);
    let exact = ["1", "3", "4"].map(|own| format!("{own}000000000.000000001"));
    let exact = exact.each_ref().map(String::as_str);
    assert_eq!(values(&columns, "budget_kg"), &texts_of(&exact));
    assert_eq!(
        values(&columns, "gap_tg"),
        &ColumnValues::Numbers(vec![None; 3])
    );
    assert!(columns.columns.iter().all(|own| own.values.len() == 3));
    let about: serde_json::Value = serde_json::from_str(&columns.about).unwrap();
    assert_eq!(about["manifest"], "flux@1-0a1b2c3d");
    assert!(about.get("rows").is_none());
    assert_eq!(about["regions"][0]["rows"], serde_json::json!([]));
}

#[test]
fn what_was_asked_besides_has_columns_of_its_own() {
    let mut own = answer();
    own.uncertainty = Some(crate::budget::BudgetUncertainty {
        error: "20 % of the flux".to_owned(),
        manifest: None,
        correlation_length_km: 0.0,
        correlation_days: 0.0,
        scheme: String::new(),
        assumptions: vec![],
        draws: None,
        seed: None,
    });
    own.river = Some(crate::budget::RiverFlux {
        source: "a test".to_owned(),
        tg_per_year: Some(1.0),
        sigma_tg_per_year: None,
        manifest: None,
        meaning: String::new(),
    });
    own.rows[0].uncertainty = Some(RowUncertainty {
        sigma_tg: 0.25,
        uncorrelated_tg: 0.125,
        fully_correlated_tg: 0.5,
        error_coverage_percent: 100.0,
        monte_carlo: None,
    });
    own.rows[1].river = Some(RowRiver {
        river_tg: 1.0,
        anthropogenic_tg: 3.0,
        sigma_tg: None,
    });
    own.rows[1].completeness = Some(Completeness {
        complete_m2: 2.0,
        incomplete_m2: 1.0,
    });
    let columns = own.columns();
    for (name, wanted) in [
        ("complete_m2", [None, Some(2.0)]),
        ("sigma_tg", [Some(0.25), None]),
        ("fully_correlated_tg", [Some(0.5), None]),
        ("river_tg", [None, Some(1.0)]),
        ("anthropogenic_sigma_tg", [None, None]),
    ] {
        let wanted = ColumnValues::Numbers(wanted.to_vec());
        assert_eq!(values(&columns, name), &wanted, "{name}");
    }
    assert!(!names(&columns).contains(&"monte_carlo_sigma_tg"));
}

#[test]
fn a_history_has_a_row_a_version() {
    let version = |number: u64, budget_tg: Option<f64>| VersionBudget {
        manifest: format!("flux@{number}-0a1b2c3d").parse().unwrap(),
        published: TimeMs::new(0).unwrap(),
        changed: "1 step added, \"new\"".to_owned(),
        steps_added: 1,
        steps_replaced: u64::MAX,
        steps_removed: 0,
        start: None,
        end: Some(TimeMs::new(1000).unwrap()),
        budget_kg: budget_tg.map(|tg| format!("{tg}")),
        budget_tg,
        sigma_tg: None,
        difference_tg: None,
        coverage_percent: None,
    };
    let own = BudgetHistory {
        product: "flux".parse().unwrap(),
        region: "global".to_owned(),
        unit: "Tg C".to_owned(),
        version_count: 3,
        notes: vec![],
        versions: vec![version(1, None), version(3, Some(2.0))],
    };
    let columns = own.columns();
    let manifests = ["flux@1-0a1b2c3d", "flux@3-0a1b2c3d"];
    assert_eq!(values(&columns, "manifest"), &texts_of(&manifests));
    let budgets = ColumnValues::Numbers(vec![None, Some(2.0)]);
    assert_eq!(values(&columns, "budget_tg"), &budgets);
    let replaced = ColumnValues::Counts(vec![None, None]);
    assert_eq!(values(&columns, "steps_replaced"), &replaced);
    assert!(!names(&columns).contains(&"sigma_tg"));
    assert!(columns.columns.iter().all(|own| own.values.len() == 2));
}
