//! Tables of the demo: comparisons in, text out.

use anyhow::Result;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::Engine;
use compute::budget::{BudgetQuery, BudgetStep};
use contract::earth::Earth;
use contract::manifest::Manifest;
use contract::region::{Cells, Region};

use crate::demo::check::Comparison;
use crate::progress;

/// Ours against the published values.
pub(crate) fn against_published(comparison: &Comparison) -> String {
    let mut table = table(&[
        "air-sea carbon, positive out of the sea",
        "period",
        "published",
        "grid",
        "ours",
        "unit",
        "",
    ]);
    for row in &comparison.rows {
        let decimals = if row.unit.starts_with("Pg") { 3 } else { 1 };
        table.add_row([
            row.what.clone(),
            row.period.clone(),
            row.published
                .map_or(String::new(), |value| format!("{value:.2}")),
            format!("{:.decimals$}", row.expected),
            format!("{:.decimals$}", row.ours),
            row.unit.clone(),
            if row.within {
                "ok".to_owned()
            } else {
                format!("off by {:.3}", row.difference)
            },
        ]);
    }
    format!("{table}\n{}", comparison.note)
}

/// Monthly budgets of a synthetic product: nothing is published about it.
pub(crate) async fn synthetic(engine: &Engine, flux: &Manifest) -> Result<String> {
    let query = BudgetQuery {
        product: flux.product.clone(),
        region: Region::Global,
        region_name: "global".to_owned(),
        from: None,
        to: None,
        step: BudgetStep::Month,
        earth: Earth::Wgs84,
        cells: Cells::Whole,
    };
    let answer = compute::budget::budget_of(engine, &query, flux).await?;
    let mut table = table(&[
        "SYNTHETIC: air-sea carbon of a generated sea",
        "to",
        "Tg C",
        "% of sea",
    ]);
    for row in &answer.rows {
        let numbers = [
            format!("{:.3}", row.budget_tg),
            format!("{:.1}", row.coverage_percent),
        ];
        let [budget, coverage] = numbers;
        table.add_row([
            progress::day(row.start),
            progress::day(row.end),
            budget,
            coverage,
        ]);
    }
    Ok(table.to_string())
}

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(header.iter().copied());
    for column in 2..5 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}
