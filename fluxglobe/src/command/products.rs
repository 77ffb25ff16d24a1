//! `fluxglobe products`: manifests in, a table of what has landed out.

use anyhow::Result;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use serde::Serialize;

use crate::cli::{Products, Settings};
use crate::{deployment, progress};

#[derive(Serialize)]
struct Row {
    product: String,
    title: String,
    unit: &'static str,
    synthetic: bool,
    rows: u32,
    cols: u32,
    steps: usize,
    from: Option<String>,
    to: Option<String>,
    manifest: String,
    derived_from: Option<String>,
    source: String,
}

pub(crate) async fn run(settings: &Settings, options: &Products) -> Result<()> {
    let store = deployment::store(settings)?;
    let mut rows = vec![];
    for product in storage::manifests::products(&store).await? {
        let Some(manifest) = storage::manifests::latest(&store, &product).await? else {
            continue;
        };
        let extent = manifest.extent();
        rows.push(Row {
            product: product.to_string(),
            manifest: manifest.id().to_string(),
            unit: manifest.quantity.display().unit,
            synthetic: manifest.synthetic,
            rows: manifest.grid.rows,
            cols: manifest.grid.cols,
            steps: manifest.steps.len(),
            from: extent.map(|period| period.start.to_string()),
            to: extent.map(|period| period.end.to_string()),
            derived_from: manifest.derived_from.map(|id| id.to_string()),
            title: manifest.title,
            source: manifest.source,
        });
    }
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&rows)?);
    }
    if rows.is_empty() {
        progress::say("nothing has landed yet; try `fluxglobe ingest FILE...` or `fluxglobe demo`");
        return Ok(());
    }
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header([
        "product", "title", "cells", "steps", "from", "to", "manifest",
    ]);
    for row in rows {
        let day = |time: Option<String>| time.map_or(String::new(), |t| t[..10].to_owned());
        // Titles of made-up data mostly say so themselves.
        let says = row.title.to_lowercase().contains("synthetic");
        let synthetic = if row.synthetic && !says {
            "SYNTHETIC "
        } else {
            ""
        };
        table.add_row([
            row.product,
            format!("{synthetic}{}", row.title),
            format!("{} x {}", row.rows, row.cols),
            row.steps.to_string(),
            day(row.from),
            day(row.to),
            row.manifest,
        ]);
    }
    progress::result(&table.to_string())
}
