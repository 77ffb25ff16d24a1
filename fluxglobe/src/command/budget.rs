//! `fluxglobe budget`: a product, a region and a period in; a table or JSON of Tg C with its coverage and source out.

use std::path::Path;

use anyhow::Result;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::budget::{BudgetAnswer, BudgetQuery, BudgetStep};
use compute::region::file;
use contract::region::Region;

use crate::cli::{Budget, Settings, Step};
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: &Budget) -> Result<()> {
    let store = deployment::store(settings)?;
    deployment::manifest(&store, &options.product, &settings.data).await?;
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
    progress::say(&answer.source);
    Ok(())
}

/// A region file, a named region, a box, GeoJSON text or well-known text.
pub(crate) fn region(text: &str) -> Result<Region> {
    if file::is_file_name(text) {
        Ok(file::read(Path::new(text))?)
    } else {
        Ok(text.parse()?)
    }
}

fn table(answer: &BudgetAnswer) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(["from", "to", "Tg C", "% of area", "10⁶ km² with data"]);
    for column in 2..5 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for row in &answer.rows {
        table.add_row([
            progress::day(row.start),
            progress::day(row.end),
            format!("{:.3}", row.budget_tg),
            format!("{:.1}", row.coverage_percent),
            format!("{:.3}", row.area_m2 / 1e12),
        ]);
    }
    table
}
