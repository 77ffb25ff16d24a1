//! `fluxglobe products`: manifests in, a table of what has landed out.

use anyhow::Result;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use contract::manifest::{Manifest, Step};
use contract::masked::MaskedCells;
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
    masked: Masked,
}

/// Cells that files gave a value for and that hold none.
#[derive(Serialize)]
struct Masked {
    out_of_range: u64,
    poor_quality: u64,
    implausible: u64,
    /// Steps that have any.
    steps: usize,
    /// Steps of files that landed before masked cells were counted.
    uncounted_steps: usize,
    /// The step that lost most.
    #[serde(skip_serializing_if = "Option::is_none")]
    most: Option<Most>,
}

#[derive(Serialize)]
struct Most {
    from: String,
    cells: u64,
    /// Of the cells that the file gave a value for.
    share: f64,
}

impl Masked {
    fn of(manifest: &Manifest) -> Self {
        let (sum, uncounted_steps) = match manifest.derived_from {
            // What is computed has no file.
            Some(_) => (MaskedCells::default(), 0),
            None => manifest.masked(),
        };
        let counted = |step: &Step| step.masked.map_or(0, MaskedCells::total);
        let most = manifest.steps.iter().max_by_key(|step| counted(step));
        let most = most.filter(|step| counted(step) > 0).map(|step| Most {
            from: step.period.start.to_string(),
            cells: counted(step),
            share: counted(step) as f64 / (counted(step) + step.valid_cells) as f64,
        });
        Self {
            out_of_range: sum.out_of_range,
            poor_quality: sum.poor_quality,
            implausible: sum.implausible,
            steps: manifest
                .steps
                .iter()
                .filter(|step| counted(step) > 0)
                .count(),
            uncounted_steps,
            most,
        }
    }

    fn cells(&self) -> MaskedCells {
        MaskedCells {
            out_of_range: self.out_of_range,
            poor_quality: self.poor_quality,
            implausible: self.implausible,
        }
    }

    /// Warnings about a product; none if nothing was masked.
    fn lines(&self, product: &str, steps: usize) -> Vec<String> {
        let mut lines = vec![];
        if let Some(most) = &self.most {
            lines.push(format!(
                "{product}: {} in {} of {steps} steps; most in that of {}, {} ({:.2} %)",
                self.cells(),
                self.steps,
                &most.from[..10],
                most.cells,
                100.0 * most.share
            ));
        }
        if self.uncounted_steps > 0 {
            lines.push(format!(
                "{product}: {} of {steps} steps landed before masked values were counted; `fluxglobe recompute --product {product} --what frames` counts them",
                self.uncounted_steps
            ));
        }
        lines
    }
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
            masked: Masked::of(&manifest),
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
    let mut warnings = vec![];
    for row in rows {
        warnings.extend(row.masked.lines(&row.product, row.steps));
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
    progress::result(&table.to_string())?;
    for line in &warnings {
        progress::say(line);
    }
    Ok(())
}
