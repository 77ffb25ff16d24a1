//! Budgets as tables.

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use contract::budget::{BudgetAnswer, BudgetHistory, BudgetRow, RowDraws};

use crate::figures::{figures, million_km2};
use crate::instants::Instants;

/// Columns of days and words, which stand to the left.
const WORDS: [&str; 6] = [
    "region",
    "from",
    "to",
    "version",
    "published",
    "what it changed",
];

/// A line a row; of several regions each has its lines, and the whole stands last.
pub(super) fn of(answer: &BudgetAnswer) -> Table {
    let regions = answer.regions.iter().flat_map(|region| &region.rows);
    let rows = regions.chain(&answer.rows);
    let columns = Columns {
        instants: Instants::of(rows.flat_map(|row| [row.start, row.end])),
        region: !answer.regions.is_empty(),
        uncertainty: answer.uncertainty.is_some(),
        draws: answer.rows.iter().any(|row| draws(row).is_some()),
        river: answer.river.is_some(),
        completeness: answer.rows.iter().any(|row| row.completeness.is_some()),
    };
    let mut table = table(columns.header());
    for region in &answer.regions {
        for row in &region.rows {
            table.add_row(columns.cells(&region.region, row));
        }
    }
    for row in &answer.rows {
        table.add_row(columns.cells(&answer.region, row));
    }
    table
}

/// What random errors came to.
fn draws(row: &BudgetRow) -> Option<RowDraws> {
    row.uncertainty.and_then(|own| own.monte_carlo)
}

fn table(header: Vec<&str>) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    let numbers: Vec<usize> = (0..header.len())
        .filter(|at| !WORDS.contains(&header[*at]))
        .collect();
    table.set_header(header);
    for at in numbers {
        if let Some(column) = table.column_mut(at) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// What stands beside the budget.
#[derive(Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "one a group of columns")]
struct Columns {
    instants: Instants,
    region: bool,
    uncertainty: bool,
    draws: bool,
    river: bool,
    completeness: bool,
}

impl Columns {
    fn header(self) -> Vec<&'static str> {
        let mut header = vec![];
        if self.region {
            header.push("region");
        }
        header.extend(["from", "to", "Tg C"]);
        if self.uncertainty {
            header.push("±");
        }
        if self.draws {
            header.extend(["drawn ±", "2.5 to 97.5 % of draws"]);
        }
        if self.river {
            header.extend(["rivers Tg C", "anthropogenic Tg C"]);
            if self.uncertainty {
                header.push("its ±");
            }
        }
        header.extend([
            "% of sea",
            "10⁶ km² of sea with data",
            "gaps would add Tg C",
            "for 10⁶ km²",
        ]);
        if self.completeness {
            header.extend(["10⁶ km² complete", "incomplete", "% complete"]);
        }
        header
    }

    fn cells(self, region: &str, row: &BudgetRow) -> Vec<String> {
        let tg = |value: f64| figures(value, 3);
        let optional = |value: Option<f64>| value.map_or_else(|| "unknown".to_owned(), tg);
        let mut cells = vec![];
        if self.region {
            cells.push(region.to_owned());
        }
        cells.extend([
            self.instants.text(row.start),
            self.instants.text(row.end),
            tg(row.budget_tg),
        ]);
        if self.uncertainty {
            cells.push(optional(row.uncertainty.map(|own| own.sigma_tg)));
        }
        if self.draws {
            let drawn = draws(row);
            let sigma =
                |own: RowDraws| format!("{} ± {}", tg(own.sigma_tg), tg(own.sigma_error_tg));
            let between = |own: RowDraws| format!("{} to {}", tg(own.p2_5_tg), tg(own.p97_5_tg));
            let unknown = || "unknown".to_owned();
            cells.push(drawn.map_or_else(unknown, sigma));
            cells.push(drawn.map_or_else(unknown, between));
        }
        if self.river {
            let of = |part: fn(&contract::budget::RowRiver) -> f64| {
                row.river
                    .as_ref()
                    .map_or_else(String::new, |own| tg(part(own)))
            };
            cells.extend([of(|own| own.river_tg), of(|own| own.anthropogenic_tg)]);
            if self.uncertainty {
                let sigma = row.river.and_then(|own| own.sigma_tg);
                cells.push(sigma.map_or_else(String::new, tg));
            }
        }
        cells.extend([
            format!("{:.1}", row.coverage_percent),
            million_km2(row.ocean_with_data_m2),
            optional(row.gap_tg),
            million_km2(row.gap_area_m2),
        ]);
        if let Some(completeness) = &row.completeness {
            cells.push(million_km2(completeness.complete_m2));
            cells.push(million_km2(completeness.incomplete_m2));
            let percent = completeness.percent();
            cells.push(percent.map_or("no data".to_owned(), |percent| format!("{percent:.1}")));
        }
        cells
    }
}

/// A change of a budget, Tg, with its sign.
fn signed(change_tg: f64) -> String {
    let sign = if change_tg < 0.0 { "" } else { "+" };
    format!("{sign}{}", figures(change_tg, 3))
}

/// A line a version.
pub(super) fn of_history(answer: &BudgetHistory) -> Table {
    let has_sigma = answer.versions.iter().any(|own| own.sigma_tg.is_some());
    let mut header = vec!["version", "published", "what it changed", "Tg C"];
    if has_sigma {
        header.push("±");
    }
    header.extend(["change", "% of sea"]);
    let mut table = table(header);
    let tg = |value: f64| figures(value, 3);
    for own in &answer.versions {
        let budget = match own.budget_tg {
            Some(budget_tg) => tg(budget_tg),
            None => "no step in the period".to_owned(),
        };
        let mut cells = vec![
            own.manifest.to_string(),
            own.published.to_string(),
            own.changed.clone(),
            budget,
        ];
        if has_sigma {
            cells.push(own.sigma_tg.map_or_else(String::new, tg));
        }
        let change = own.difference_tg.map(signed);
        let percent = own.coverage_percent.map(|percent| format!("{percent:.1}"));
        cells.extend([change.unwrap_or_default(), percent.unwrap_or_default()]);
        table.add_row(cells);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_below_a_gigagram_is_no_zero() {
        let texts = [0.5, -1.25, 2e-4, -2e-4, 0.0].map(signed);
        assert_eq!(
            texts,
            ["+0.500", "-1.250", "+2.000e-4", "-2.000e-4", "+0.000"]
        );
    }
}
