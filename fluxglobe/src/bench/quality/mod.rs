//! `fluxglobe bench quality`: volumes of generated scenes, and of a product if it has landed, against a reference in
//! double precision; a table, JSON and a plot of the error against the number of slices.

mod plot;

use ::render::Scene;
use anyhow::{Context as _, Result};
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use contract::colour::TransferFunction;
use contract::job::{Mode, RenderJob, Style, View};
use contract::manifest::Manifest;
use contract::picture::PictureSources;
use contract::tile::Tile;
use render_proof::{QualityRow, against_slices, ocean};
use render_worker::Desk;
use serde::Serialize;
use storage::Store;

use crate::cli::{BenchQuality, Settings};
use crate::{deployment, picture, progress};

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

/// Something to draw.
struct Subject {
    name: String,
    job: RenderJob,
    scene: Scene,
}

pub(crate) async fn run(settings: &Settings, options: BenchQuality) -> Result<()> {
    let store = deployment::store(settings)?;
    let product = storage::manifests::latest(&store, &options.product).await?;
    let desk = deployment::single_desk(settings, store.clone()).await?;
    let mut subjects = generated(options.size)?;
    match &product {
        Some(manifest) => subjects.extend(landed(&desk, &store, manifest, options.size).await?),
        None => progress::say(&format!(
            "{} has not landed here: generated scenes only",
            options.product
        )),
    }
    let bar = progress::bar("measure", subjects.len() as u64);
    let mut scenes = vec![];
    for subject in subjects {
        bar.set_message(subject.name.clone());
        let (desk, slices) = (desk.clone(), options.slices.clone());
        let measure = move || -> Result<Measured> {
            let renderer = desk.pipeline().renderer();
            let rows = against_slices(renderer, &subject.job, &subject.scene, &slices)?;
            Ok(Measured {
                name: subject.name,
                rows,
            })
        };
        scenes.push(tokio::task::spawn_blocking(measure).await??);
        bar.inc(1);
    }
    progress::done(&bar, "measured");
    if let Some(path) = &options.plot {
        let svg = plot::svg(&scenes)?;
        std::fs::write(path, svg).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let report = Report {
        renderer: desk.pipeline().name().to_owned(),
        scenes,
    };
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&report)?);
    }
    progress::result(&format!("drawn by {}\n{}", report.renderer, table(&report)))
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
    ]);
    for scene in &report.scenes {
        for row in &scene.rows {
            let d = row.difference;
            table.add_row([
                scene.name.clone(),
                row.slices.to_string(),
                d.psnr_db
                    .map_or_else(|| "equal".to_owned(), |db| format!("{db:.2}")),
                format!("{:.4}", d.mean_flip),
                format!("{:.1}", d.most_levels),
                format!("{:.1}", d.within_one_level_percent),
            ]);
        }
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// A coast, the equator and a region on the globe, and a map tile; flux and carbon made up by formulas.
fn generated(size: u32) -> Result<Vec<Subject>> {
    let scene = ocean::scene(ocean::ONE_DEGREE);
    let views = [
        (
            "generated, coast from 2200 km",
            globe(-122.0, 27.0, 2.2e6, size),
        ),
        (
            "generated, equator from 4000 km",
            globe(-150.0, 0.0, 4.0e6, size),
        ),
        ("generated, map tile 3/1/3", tile(3, 1, 3)?),
    ];
    let subject = |(name, view): (&str, View)| Subject {
        name: name.to_owned(),
        job: ocean::job(view),
        scene: scene.clone(),
    };
    let mut region = ocean::job(globe(-135.0, 20.5, 5.3e6, size));
    region.style.particles_per_cell = 1;
    let region = Subject {
        name: "generated, a region in fine cells from 5300 km".to_owned(),
        job: region,
        scene: ocean::scene(ocean::REGION),
    };
    Ok(views.into_iter().map(subject).chain([region]).collect())
}

/// A landed product at the middle of its last step.
async fn landed(
    desk: &Desk,
    store: &Store,
    manifest: &Manifest,
    size: u32,
) -> Result<Vec<Subject>> {
    let last = manifest.steps.last().context("the product has no step")?;
    let accumulated = picture::accumulated(store, manifest).await?;
    let views = [
        (
            "North Atlantic from 4000 km",
            globe(-40.0, 45.0, 4.0e6, size),
        ),
        ("map tile 3/0/3", tile(3, 0, 3)?),
    ];
    let mut subjects = vec![];
    for (name, view) in views {
        let style = Style::with_transfer(TransferFunction::default_for(manifest.quantity));
        let time = last.period.mid();
        let sources = PictureSources {
            accumulated: accumulated.as_ref(),
            ..PictureSources::of(manifest)
        };
        let job = sources.job(Mode::Volume, view, time, style)?;
        subjects.push(Subject {
            name: format!("{}, {name}", manifest.product),
            scene: desk.pipeline().scene(&job).await?,
            job,
        });
    }
    Ok(subjects)
}

fn globe(lon_deg: f64, lat_deg: f64, height_m: f64, size: u32) -> View {
    View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        width_px: size,
        height_px: size,
        angles: contract::camera::CameraAngles::NADIR,
    }
}

fn tile(z: u8, x: u32, y: u32) -> Result<View> {
    Ok(View::Tile {
        tile: Tile::new(z, x, y)?,
        size_px: 256,
    })
}
