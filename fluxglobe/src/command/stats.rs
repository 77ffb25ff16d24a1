//! `fluxglobe stats point`: a product and a place in; the series of its cell as a table with bars, or JSON, out.

use anyhow::Result;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::Engine;
use compute::point::PointAnswer;
use contract::grid::LonLatDeg;

use crate::cli::{Settings, StatsPoint};
use crate::{deployment, progress};

/// Width of the longest bar, characters.
const BAR_CHARS: f64 = 30.0;

pub(crate) async fn point(settings: &Settings, options: &StatsPoint) -> Result<()> {
    let place = LonLatDeg::new(options.lon, options.lat)?;
    let store = deployment::store(settings)?;
    deployment::manifest(&store, &options.product, &settings.data).await?;
    let answer =
        compute::point::point_series(&Engine::local(store), &options.product, place).await?;
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&answer)?);
    }
    progress::result(&table(&answer).to_string())?;
    progress::say(&format!(
        "{} in {}, mean of the cell around {:.4}, {:.4}; cite {}",
        answer.quantity, answer.unit, answer.cell.lon, answer.cell.lat, answer.manifest
    ));
    progress::say(&answer.source);
    Ok(())
}

fn table(answer: &PointAnswer) -> Table {
    let largest = answer
        .series
        .iter()
        .filter_map(|step| step.value)
        .fold(0.0, |a: f64, v| a.max(v.abs()));
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(["from", "to", answer.unit.as_str(), ""]);
    if let Some(column) = table.column_mut(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    for step in &answer.series {
        let (text, bar) = match step.value {
            Some(value) => (format!("{value:.4}"), bar(value, largest)),
            None => ("no data".to_owned(), String::new()),
        };
        table.add_row([
            progress::day(step.start),
            progress::day(step.end),
            text,
            bar,
        ]);
    }
    table
}

/// A bar of a value's size; light for values below zero.
fn bar(value: f64, largest: f64) -> String {
    let length = if largest > 0.0 {
        (value.abs() / largest * BAR_CHARS).round() as usize
    } else {
        0
    };
    if value < 0.0 {
        "░".repeat(length)
    } else {
        "█".repeat(length)
    }
}
