//! `fluxglobe products`: manifests in, a table of what has landed out.

use anyhow::Result;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use compute::dependents::why_it_stays;
use contract::listing::ListedProduct;
use contract::time::TimeMs;
use storage::manifests;

use crate::cli::{Products, Settings};
use crate::instants::{self, Instants};
use crate::{deployment, progress};

/// Codes of a mask that are shown on a line.
const CODES_SHOWN: usize = 20;

/// Warnings about a product; none if nothing was masked.
fn warnings(row: &ListedProduct) -> Vec<String> {
    let (product, steps, masked) = (&row.product, row.step_count, &row.masked);
    let mut lines = vec![];
    if let Some(most) = &masked.most {
        lines.push(format!(
            "{product}: {} in {} of {steps} steps; most in that of {}, {} ({:.2} %)",
            masked.cells(),
            masked.steps,
            instants::shown(most.start),
            most.cells,
            100.0 * most.share
        ));
    }
    if masked.uncounted_steps > 0 {
        lines.push(format!(
            "{product}: {} of {steps} steps landed before masked values were counted; `fluxglobe recompute --product {product} --what frames` counts them",
            masked.uncounted_steps
        ));
    }
    lines
}

/// What the codes of a mask mean; none of what has no codes.
fn codes(row: &ListedProduct) -> Option<String> {
    let flags = row.quantity.flags();
    let shown: Vec<String> = flags
        .iter()
        .take(CODES_SHOWN)
        .map(|flag| format!("{} {}", flag.value, flag.meaning))
        .collect();
    let more = match flags.len() - shown.len() {
        0 => String::new(),
        more => format!(", and {more} more, which --json has"),
    };
    let shown = shown.join(", ");
    (!flags.is_empty()).then(|| format!("{}: codes {shown}{more}", row.product))
}

pub(crate) async fn run(settings: &Settings, options: &Products) -> Result<()> {
    let store = deployment::store(settings)?;
    let (mut rows, mut staying) = (vec![], vec![]);
    for (product, number) in manifests::newest_numbers(&store).await? {
        let newest = match manifests::numbered(&store, &product, number).await? {
            // Clean-up took it away meanwhile: there is a newer one.
            None => manifests::latest(&store, &product).await?,
            newest => newest,
        };
        let Some(manifest) = newest else {
            continue;
        };
        staying.extend(why_it_stays(&manifest));
        rows.push(ListedProduct::of(&manifest, manifest.id()));
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
    let mut besides = vec![];
    let ends = rows.iter().flat_map(|row| [row.start, row.end]);
    let instants = Instants::of(ends.flatten());
    for row in rows {
        besides.extend(codes(&row));
        besides.extend(warnings(&row));
        let end = |time: Option<TimeMs>| time.map_or(String::new(), |time| instants.text(time));
        // Titles of made-up data mostly say so themselves.
        let says = row.title.to_lowercase().contains("synthetic");
        let synthetic = if row.synthetic && !says {
            "SYNTHETIC "
        } else {
            ""
        };
        table.add_row([
            row.product.to_string(),
            format!("{synthetic}{}", row.title),
            format!("{} x {}", row.rows, row.cols),
            row.step_count.to_string(),
            end(row.start),
            end(row.end),
            row.manifest.to_string(),
        ]);
    }
    progress::result(&table.trim_fmt())?;
    for line in besides.iter().chain(&staying) {
        progress::say(line);
    }
    Ok(())
}
