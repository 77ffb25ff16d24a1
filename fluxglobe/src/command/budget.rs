//! `fluxglobe budget`: a product, a region and a period in; a table or JSON of Tg C with its coverage and source out.

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::region::{file, mask};
use contract::budget::{BudgetAnswer, BudgetQuery, BudgetRow};
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::region::AskedRegion;
use storage::Store;

use crate::cli::{Budget, Settings};
use crate::{deployment, progress};

const M2_PER_MILLION_KM2: f64 = 1e12;

pub(crate) async fn run(settings: &Settings, options: &Budget) -> Result<()> {
    let store = deployment::store(settings)?;
    let product = deployment::manifest(&store, &options.product, &settings.data).await?;
    let query = BudgetQuery {
        from: options.from,
        to: options.to,
        step: options.step,
        earth: options.earth,
        cells: options.cells,
        ocean: ocean(settings, &store, options.ocean.as_ref()).await?,
        ..BudgetQuery::new(
            options.product.clone(),
            stored_region(settings, &store, &options.region).await?,
        )
    };
    let bar = progress::bar("sum over the region", 1);
    let engine = deployment::region_engine(settings, store)?;
    let answer = compute::budget::budget(&engine, &query).await?;
    bar.finish_and_clear();
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&answer)?);
    }
    progress::result(&table(&answer).to_string())?;
    let million_km2 = |m2: f64| m2 / M2_PER_MILLION_KM2;
    progress::say(&format!(
        "{} of {}, {} earth, positive out of the sea; {} ({}); cite {}",
        answer.unit,
        answer.region,
        answer.earth,
        answer.cells.title(),
        answer.cells,
        answer.manifest
    ));
    progress::say(&format!(
        "asked for {:.3} 10⁶ km², {:.3} of it sea; what gaps would add, not part of the budget: {}",
        million_km2(answer.region_area_m2),
        million_km2(answer.ocean_area_m2),
        answer.gap_basis
    ));
    progress::say(&format!("what is sea: {}", answer.ocean_source));
    for note in &answer.notes {
        progress::say(&format!("note: {note}"));
    }
    let is_counted = |row: &BudgetRow| row.completeness.is_some();
    if product.quantity == Quantity::AccumulatedCarbon && !answer.rows.iter().all(is_counted) {
        progress::say(
            "how complete its sums are is unknown: an older version accumulated it; `fluxglobe derive accumulated` does it anew",
        );
    }
    progress::say(&answer.source);
    Ok(())
}

/// The newest version of the product that says what is sea.
pub(crate) async fn ocean(
    settings: &Settings,
    store: &Store,
    product: Option<&ProductId>,
) -> Result<Option<Arc<Manifest>>> {
    let Some(product) = product else {
        return Ok(None);
    };
    let manifest = deployment::manifest(store, product, &settings.data).await?;
    Ok(Some(Arc::new(manifest)))
}

/// As [`region`], or the cells of a landed mask that have a code: `PRODUCT:CODE`.
pub(crate) async fn stored_region(
    settings: &Settings,
    store: &Store,
    text: &str,
) -> Result<AskedRegion> {
    let Some((product, code)) = mask::asked(text) else {
        return region(text);
    };
    let mask = deployment::manifest(store, &product, &settings.data).await?;
    Ok(mask::region(store, &mask, code).await?)
}

/// A region file, a named region, a box, GeoJSON text or well-known text.
pub(crate) fn region(text: &str) -> Result<AskedRegion> {
    if file::is_file_name(text) {
        let (region, name) = (file::read(Path::new(text))?, text.to_owned());
        Ok(AskedRegion { region, name })
    } else {
        Ok(text.parse()?)
    }
}

fn table(answer: &BudgetAnswer) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    let is_counted = answer.rows.iter().any(|row| row.completeness.is_some());
    let mut header = vec![
        "from",
        "to",
        "Tg C",
        "% of sea",
        "10⁶ km² of sea with data",
        "gaps would add Tg C",
        "for 10⁶ km²",
    ];
    if is_counted {
        header.extend(["10⁶ km² complete", "incomplete", "% complete"]);
    }
    table.set_header(header);
    for column in 2..10 {
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
            format!("{:.3}", row.ocean_with_data_m2 / M2_PER_MILLION_KM2),
            row.gap_tg
                .map_or_else(|| "unknown".to_owned(), |gap_tg| format!("{gap_tg:.3}")),
            format!("{:.3}", row.gap_area_m2 / M2_PER_MILLION_KM2),
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
