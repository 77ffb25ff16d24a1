//! `fluxglobe bench quality`: volumes of generated scenes, and of a product if it has landed, against a reference in
//! double precision; a table, JSON, pictures, and a plot of the error against the number of slices.

mod bounds;
mod plot;
pub(super) mod scenes;

use std::path::Path;

use anyhow::{Context as _, Result, bail};
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use contract::job::{Style, View};
use render_proof::{Quality, QualityRow, against_slices, shown};
use serde::Serialize;

use crate::cli::{BenchQuality, Settings};
use crate::{deployment, progress};
use bounds::Bounds;

/// What is printed.
#[derive(Debug, Serialize)]
struct Report {
    /// What drew.
    renderer: String,
    scenes: Vec<Measured>,
}

/// One scene.
#[derive(Debug, Serialize)]
pub(super) struct Measured {
    pub(super) name: String,
    pub(super) rows: Vec<QualityRow>,
}

pub(crate) async fn run(settings: &Settings, options: BenchQuality) -> Result<()> {
    let bounds = Bounds {
        least_psnr_db: options.least_psnr,
        most_flip: options.most_flip,
    };
    bounds.validate()?;
    let report = measured(settings, &options, &bounds).await?;
    if let Some(file) = &options.plot {
        crate::plot::write(file, &plot::svg(&report.scenes)?)?;
    }
    if options.json {
        progress::result(&serde_json::to_string_pretty(&report)?)?;
    } else {
        progress::result(&format!("drawn by {}\n{}", report.renderer, table(&report)))?;
    }
    bounds.hold(&report.scenes)
}

async fn measured(settings: &Settings, options: &BenchQuality, bounds: &Bounds) -> Result<Report> {
    let outlines = scenes::outlines(
        options.scenes,
        options.only.as_deref(),
        options.product.as_str(),
    )?;
    let store = deployment::store(settings)?;
    let product = storage::manifests::latest(&store, &options.product).await?;
    let desk = deployment::single_desk(settings, store.clone()).await?;
    let unlanded = outlines.iter().filter(|outline| outline.needs_product());
    if product.is_none() && unlanded.count() > 0 {
        if !bounds.is_empty() {
            bail!(
                "{} has not landed here, so its scenes cannot be held to anything: `fluxglobe demo` lands it, and \
                 --only generated leaves them out",
                options.product
            );
        }
        progress::say(&format!(
            "{} has not landed here: generated scenes only",
            options.product
        ));
    }
    let bar = progress::bar("measure", outlines.len() as u64);
    let mut scenes = vec![];
    for outline in outlines {
        let made = scenes::subject(outline, &desk, &store, product.as_ref(), options.size).await?;
        let Some(mut subject) = made else {
            bar.inc(1);
            continue;
        };
        let own = &mut subject.job.style.particles_per_cell;
        // Cells of a region are drawn with one particle, as fine cells are.
        if *own > 1 {
            let usual = match subject.job.view {
                View::Globe { .. } => Style::GLOBE_PARTICLES_PER_CELL,
                View::Tile { .. } => *own,
            };
            *own = options.particles_per_cell.unwrap_or(usual);
        }
        bar.set_message(subject.name.clone());
        let (desk, slices) = (desk.clone(), options.slices.clone());
        let measure = move || -> Result<(String, Quality)> {
            let renderer = desk.pipeline().renderer();
            let quality = against_slices(renderer, &subject.job, &subject.scene, &slices)?;
            Ok((subject.name, quality))
        };
        let (name, quality) = tokio::task::spawn_blocking(measure).await??;
        if let Some(folder) = &options.pictures {
            keep_pictures(folder, &name, &quality)?;
        }
        scenes.push(Measured {
            name,
            rows: quality.rows,
        });
        bar.inc(1);
    }
    progress::done(&bar, "measured");
    Ok(Report {
        renderer: desk.pipeline().name().to_owned(),
        scenes,
    })
}

fn table(report: &Report) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING).set_header([
        "scene",
        "slices",
        "PSNR dB",
        "mean FLIP",
        "largest levels",
        "within 1 level %",
        "drawn %",
        "PSNR dB of drawn",
        "mean FLIP of drawn",
    ]);
    let in_db = |db: Option<f64>| db.map_or_else(|| "equal".to_owned(), |db| format!("{db:.2}"));
    for scene in &report.scenes {
        for row in &scene.rows {
            let d = row.difference;
            let [percent, psnr_db, mean_flip] = d.covered.map_or_else(Default::default, |c| {
                [
                    format!("{:.1}", c.percent),
                    in_db(c.psnr_db),
                    format!("{:.4}", c.mean_flip),
                ]
            });
            table.add_row([
                scene.name.clone(),
                row.slices.to_string(),
                in_db(d.psnr_db),
                format!("{:.4}", d.mean_flip),
                format!("{:.1}", d.most_levels),
                format!("{:.1}", d.within_one_level_percent),
                percent,
                psnr_db,
                mean_flip,
            ]);
        }
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Writes what was drawn, what it should be and where they differ.
fn keep_pictures(folder: &Path, name: &str, quality: &Quality) -> Result<()> {
    let file = file_name(name);
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let keep = |what: &str, image: &render::Image| {
        let path = folder.join(format!("{file}-{what}.png"));
        std::fs::write(&path, image.encode_png()?)
            .with_context(|| format!("cannot write {}", path.display()))
    };
    keep("reference", &shown::seen(&quality.reference))?;
    for (row, picture) in quality.rows.iter().zip(&quality.drawn) {
        keep(&row.slices.to_string(), &shown::seen(picture))?;
        let apart =
            shown::apart(picture, &quality.reference).context("the sizes of pictures differ")?;
        keep(&format!("{}-difference", row.slices), &apart)?;
    }
    Ok(())
}

/// Words of a scene's name, joined.
fn file_name(scene: &str) -> String {
    let words = scene.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<_> = words.filter(|word| !word.is_empty()).collect();
    words.join("-").to_lowercase()
}
