//! Columns of budgets: a row a period, of several regions each with its name; and of their histories, a row a version.

use super::columns::{about, column, instants, numbers, texts};
use super::{Column, ColumnValues, Columns, Tabular};
use crate::budget::{BudgetAnswer, BudgetHistory, BudgetRow, RegionBudget, VersionBudget};

/// A region's name and one of its rows.
type Row<'a> = (&'a str, &'a BudgetRow);

/// Unit of budgets: 10⁹ kg of carbon.
const TG: &str = "Tg";

impl Tabular for BudgetAnswer {
    fn json(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(self)
    }

    /// Regions one after the other, and the whole last.
    fn columns(&self) -> Columns {
        let of_regions = self.regions.iter().flat_map(|region| {
            let rows = region.rows.iter();
            rows.map(|row| (region.region.as_str(), row))
        });
        let whole = self.rows.iter().map(|row| (self.region.as_str(), row));
        let rows: Vec<Row<'_>> = of_regions.chain(whole).collect();
        let rows = rows.as_slice();
        let area = |name: &str, of: fn(&BudgetRow) -> f64| {
            numbers(name, "m2", rows, |(_, row)| Some(of(row)))
        };
        let mut columns = vec![
            texts("region", rows, |(region, _)| Some((*region).to_owned())),
            instants("start", rows, |(_, row)| row.start),
            instants("end", rows, |(_, row)| row.end),
            numbers("budget_tg", TG, rows, |(_, row)| Some(row.budget_tg)),
            texts("budget_kg", rows, |(_, row)| Some(row.budget_kg.clone())),
            numbers("coverage_percent", "%", rows, |(_, row)| {
                Some(row.coverage_percent)
            }),
            area("area_m2", |row| row.area_m2),
            area("region_area_m2", |row| row.region_area_m2),
            area("ocean_area_m2", |row| row.ocean_area_m2),
            area("ocean_with_data_m2", |row| row.ocean_with_data_m2),
            numbers("gap_tg", TG, rows, |(_, row)| row.gap_tg),
            area("gap_area_m2", |row| row.gap_area_m2),
        ];
        if rows.iter().any(|(_, row)| row.completeness.is_some()) {
            columns.extend([
                numbers("complete_m2", "m2", rows, |(_, row)| {
                    Some(row.completeness?.complete_m2)
                }),
                numbers("incomplete_m2", "m2", rows, |(_, row)| {
                    Some(row.completeness?.incomplete_m2)
                }),
            ]);
        }
        if self.uncertainty.is_some() {
            columns.extend(of_uncertainty(rows));
        }
        if self.river.is_some() {
            columns.extend(of_river(rows));
        }
        Columns {
            about: about(&without_rows(self), "rows"),
            columns,
        }
    }
}

/// All that it says besides its rows and those of its regions.
fn without_rows(answer: &BudgetAnswer) -> BudgetAnswer {
    let without_rows = |region: &RegionBudget| RegionBudget {
        rows: vec![],
        ..region.clone()
    };
    BudgetAnswer {
        rows: vec![],
        regions: answer.regions.iter().map(without_rows).collect(),
        ..answer.clone()
    }
}

/// What rivers take off.
fn of_river(rows: &[Row<'_>]) -> [Column; 3] {
    [
        numbers("river_tg", TG, rows, |(_, row)| Some(row.river?.river_tg)),
        numbers("anthropogenic_tg", TG, rows, |(_, row)| {
            Some(row.river?.anthropogenic_tg)
        }),
        numbers("anthropogenic_sigma_tg", TG, rows, |(_, row)| {
            row.river?.sigma_tg
        }),
    ]
}

/// Errors of rows, and what draws of them came to, if there were any.
fn of_uncertainty(rows: &[Row<'_>]) -> Vec<Column> {
    let mut columns = vec![
        numbers("sigma_tg", TG, rows, |(_, row)| {
            Some(row.uncertainty?.sigma_tg)
        }),
        numbers("uncorrelated_tg", TG, rows, |(_, row)| {
            Some(row.uncertainty?.uncorrelated_tg)
        }),
        numbers("fully_correlated_tg", TG, rows, |(_, row)| {
            Some(row.uncertainty?.fully_correlated_tg)
        }),
        numbers("error_coverage_percent", "%", rows, |(_, row)| {
            Some(row.uncertainty?.error_coverage_percent)
        }),
    ];
    let draws = |row: &BudgetRow| row.uncertainty?.monte_carlo;
    if rows.iter().any(|(_, row)| draws(row).is_some()) {
        columns.extend([
            numbers("monte_carlo_sigma_tg", TG, rows, |(_, row)| {
                Some(draws(row)?.sigma_tg)
            }),
            numbers("monte_carlo_p2_5_tg", TG, rows, |(_, row)| {
                Some(draws(row)?.p2_5_tg)
            }),
            numbers("monte_carlo_p97_5_tg", TG, rows, |(_, row)| {
                Some(draws(row)?.p97_5_tg)
            }),
        ]);
    }
    columns
}

impl Tabular for BudgetHistory {
    fn json(&self) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(self)
    }

    fn columns(&self) -> Columns {
        let rows = &self.versions;
        let instant = |name: &str, of: fn(&VersionBudget) -> Option<crate::time::TimeMs>| {
            let values = rows.iter().map(of).collect();
            column(name, None, ColumnValues::SomeInstants(values))
        };
        let count = |name: &str, of: fn(&VersionBudget) -> u64| {
            let values = rows.iter().map(|row| u32::try_from(of(row)).ok());
            column(name, None, ColumnValues::Counts(values.collect()))
        };
        let mut columns = vec![
            texts("manifest", rows, |row: &VersionBudget| {
                Some(row.manifest.to_string())
            }),
            instants("published", rows, |row| row.published),
            texts("changed", rows, |row| Some(row.changed.clone())),
            count("steps_added", |row| row.steps_added),
            count("steps_replaced", |row| row.steps_replaced),
            count("steps_removed", |row| row.steps_removed),
            instant("start", |row| row.start),
            instant("end", |row| row.end),
            numbers("budget_tg", TG, rows, |row| row.budget_tg),
            texts("budget_kg", rows, |row| row.budget_kg.clone()),
        ];
        if rows.iter().any(|row| row.sigma_tg.is_some()) {
            columns.push(numbers("sigma_tg", TG, rows, |row| row.sigma_tg));
        }
        columns.extend([
            numbers("difference_tg", TG, rows, |row| row.difference_tg),
            numbers("coverage_percent", "%", rows, |row| row.coverage_percent),
        ]);
        let without_rows = Self {
            versions: vec![],
            ..self.clone()
        };
        Columns {
            about: about(&without_rows, "versions"),
            columns,
        }
    }
}

#[cfg(test)]
mod tests;
