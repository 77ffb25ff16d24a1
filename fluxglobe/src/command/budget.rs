//! `fluxglobe budget`: a product, a region and a period in; a table or JSON of Tg C with its coverage and source out.

use std::path::Path;

use anyhow::Result;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::budget::{BudgetAnswer, BudgetQuery, BudgetRow, BudgetStep};
use contract::quantity::Quantity;
use contract::region::Region;

use crate::cli::{Budget, Settings, Step};
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: &Budget) -> Result<()> {
    let store = deployment::store(settings)?;
    let product = deployment::manifest(&store, &options.product, &settings.data).await?;
    let query = BudgetQuery {
        product: options.product.clone(),
        region: region(&options.region)?,
        region_name: options.region.clone(),
        from: options.from,
        to: options.to,
        step: match options.step {
            Step::Month => BudgetStep::Month,
            Step::Year => BudgetStep::Year,
            Step::Total => BudgetStep::Total,
        },
        earth: options.earth,
    };
    let bar = progress::bar("sum over the region", 1);
    let engine = deployment::region_engine(settings, store)?;
    let answer = compute::budget::budget(&engine, &query).await?;
    bar.finish_and_clear();
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&answer)?);
    }
    progress::result(&table(&answer).to_string())?;
    progress::say(&format!(
        "{} of {}, {} earth, positive out of the sea; cite {}",
        answer.unit, answer.region, answer.earth, answer.manifest
    ));
    let is_counted = |row: &BudgetRow| row.completeness.is_some();
    if product.quantity == Quantity::AccumulatedCarbon && !answer.rows.iter().all(is_counted) {
        progress::say(
            "how complete its sums are is unknown: an older version accumulated it; `fluxglobe derive accumulated` does it anew",
        );
    }
    progress::say(&answer.source);
    Ok(())
}

/// A GeoJSON file, a named region or a box.
pub(crate) fn region(text: &str) -> Result<Region> {
    let extension = Path::new(text)
        .extension()
        .and_then(|extension| extension.to_str());
    match extension.map(str::to_ascii_lowercase).as_deref() {
        Some("geojson" | "json") => Ok(compute::region::geojson_file::read(Path::new(text))?),
        _ => Ok(text.parse()?),
    }
}

fn table(answer: &BudgetAnswer) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    let is_counted = answer.rows.iter().any(|row| row.completeness.is_some());
    let mut header = vec!["from", "to", "Tg C", "% of area", "10⁶ km² with data"];
    if is_counted {
        header.extend(["10⁶ km² complete", "incomplete", "% complete"]);
    }
    table.set_header(header);
    for column in 2..8 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for row in &answer.rows {
        let mut cells = vec![
            progress::day(row.start),
            progress::day(row.end),
            format!("{:.3}", row.budget_tg),
            format!("{:.1}", row.coverage_percent),
            format!("{:.3}", row.area_m2 / 1e12),
        ];
        if let Some(completeness) = &row.completeness {
            cells.push(format!("{:.3}", completeness.complete_m2 / 1e12));
            cells.push(format!("{:.3}", completeness.incomplete_m2 / 1e12));
            let percent = completeness.percent();
            cells.push(percent.map_or("no data".to_owned(), |percent| format!("{percent:.1}")));
        }
        table.add_row(cells);
    }
    table
}
