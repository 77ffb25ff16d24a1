//! `fluxglobe bench landing`: one frame landed into products of more and more steps: time, requests and bytes; and how long a
//! window of 256 x 256 cells of it, and of each of its coarser levels, takes to read.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use contract::chunk::Window;
use contract::grid::Grid;
use contract::manifest::{Manifest, Step};
use contract::product::ProductId;
use contract::time::{Period, TimeMs};
use cube::{At, Cube, Repository};
use ingest::{GeneratedSteps, IngestService};
use serde::Serialize;
use storage::log::EmbeddedLog;
use storage::store::Counts;
use storage::{Store, domain, fields, manifests};

use crate::cli::BenchLanding;
use crate::progress;

/// What the generated files land in.
const PRODUCT: &str = "globe-synthetic";
/// Side of the windows that are read, cells, and how many of them.
const WINDOW_CELLS: u32 = 256;
const WINDOWS: u32 = 16;

/// One landing into a product of so many steps.
#[derive(Serialize)]
struct Row {
    /// Steps that were there.
    steps: usize,
    /// Does the frame come as one more step, or in the place of one?
    is_revision: bool,
    /// Until it was told as landed, its cube included.
    seconds: f64,
    /// Objects written until then.
    writes: u64,
    /// Their content, bytes.
    written_bytes: u64,
    /// That over the bytes of the frame as it is stored, once.
    ratio: f64,
    /// Content read, bytes.
    read_bytes: u64,
    /// What is made time-major behind it: seconds and bytes.
    background_seconds: f64,
    background_bytes: u64,
    /// A window of the frame: the first one of a process, and the median of others elsewhere, ms.
    window_ms: [f64; 2],
    /// The same of each coarser level, from the first on, median of all; none of a grid without levels.
    level_window_ms: Vec<f64>,
}

pub(crate) async fn run(options: &BenchLanding) -> Result<()> {
    let work = &options.work;
    std::fs::create_dir_all(work).with_context(|| format!("making {}", work.display()))?;
    let frames: Vec<PathBuf> = (1..=u64::from(options.runs.get()))
        .map(|seed| frame(work, options.degrees, seed))
        .collect::<Result<_>>()?;
    let mut rows = vec![];
    for steps in &options.steps {
        let path = &work.join(format!("landing-{steps}-{}", std::process::id()));
        let store = Store::open(
            path.join("objects")
                .to_str()
                .context("--work is not UTF-8")?,
        )?;
        prepare(&store, path, &frames[0], *steps as usize).await?;
        for (run, frame) in frames.iter().enumerate() {
            rows.push(landed(&store, path, frame, (*steps as usize, run > 0)).await?);
        }
        std::fs::remove_dir_all(path)?;
    }
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&rows)?);
    }
    progress::result(&table(&rows).to_string())
}

/// A file of one day, made if it is not there.
fn frame(work: &Path, degrees: f64, seed: u64) -> Result<PathBuf> {
    let file = work.join(format!("globe-{degrees}-{seed}.h5"));
    if !file.exists() {
        ingest::generate_globe(&file, degrees, seed, GeneratedSteps::Days(1), &|_, _| ())?;
    }
    Ok(file)
}

/// Lands a file as `fluxglobe ingest` does.
async fn land(store: &Store, folder: &Path, file: &Path) -> Result<()> {
    let log = Arc::new(EmbeddedLog::open(&folder.join("events"))?);
    let settings = ingest::Settings::with_current_program()?;
    let service = IngestService::new(store.clone(), log, settings);
    service.notify(&[file.to_owned()], None, None).await?;
    let outcomes = service.drain(&ingest::Quiet).await?;
    let refused = outcomes.iter().find(|outcome| outcome.is_rejected());
    ensure!(
        refused.is_none(),
        "{}",
        refused.map_or_else(String::new, ToString::to_string)
    );
    Ok(())
}

/// Makes a product of steps before that of a file: days with one value wherever the file has one, each day another.
async fn prepare(store: &Store, folder: &Path, file: &Path, steps: usize) -> Result<()> {
    if steps == 0 {
        return Ok(());
    }
    // What the file lands as, in a store that is gone then.
    let (other, aside) = (folder.join("aside"), Store::memory());
    land(&aside, &other, file).await?;
    let product: ProductId = PRODUCT.parse()?;
    let newest = manifests::latest(&aside, &product).await?;
    let mut manifest = newest.context("what landed has a version")?;
    let frame = manifest.steps.remove(0);
    let values = fields::read(&aside, &frame.field, &manifest.grid).await?;
    let cells: Vec<bool> = values.iter().map(|value| !value.is_nan()).collect();
    manifest.domain = domain::write(store, &product, &cells).await?;
    let bar = progress::bar("steps of before", steps as u64);
    let day_ms = frame.period.end.ms() - frame.period.start.ms();
    for at in 0..steps {
        let before = (steps - at) as i64 * day_ms;
        let start = TimeMs::new(frame.period.start.ms() - before)?;
        let period = Period::new(start, TimeMs::new(start.ms() + day_ms)?)?;
        let value = (at + 1) as f32 * 1e-13;
        let of_day = |cell: &bool| if *cell { value } else { f32::NAN };
        let values: Vec<f32> = cells.iter().map(of_day).collect();
        let (store, product, grid) = (store.clone(), product.clone(), manifest.grid);
        let field = fields::write(&store, &product, &grid, &values, period).await?;
        manifest.steps.push(Step {
            period,
            field,
            origin: format!("{at}.nc"),
            ..frame.clone()
        });
        bar.inc(1);
    }
    manifest.notices = vec![];
    manifests::commit(store, &manifest).await?;
    bar.set_message("its cube");
    cube::follow(store, &manifest).await?;
    cube::compact(store, &cube::folder(&product)).await?;
    progress::done(&bar, &format!("{steps} are there"));
    Ok(())
}

/// Lands a frame, as a process that has read nothing before.
async fn landed(
    store: &Store,
    folder: &Path,
    file: &Path,
    (steps, is_revision): (usize, bool),
) -> Result<Row> {
    let (counted, traffic) = store.counted();
    let begun = Instant::now();
    land(&counted, folder, file).await?;
    let seconds = begun.elapsed().as_secs_f64();
    let own = traffic.counts();
    cube::compacted().await;
    let all = begun.elapsed().as_secs_f64();
    let Counts {
        written_bytes: behind,
        ..
    } = traffic.counts().since(own);
    let newest = manifests::latest(store, &PRODUCT.parse()?).await?;
    let manifest = newest.context("what landed has a version")?;
    let frame = manifest.steps.last().context("it has steps")?;
    let frame_bytes = store.size_bytes(&frame.field).await?;
    let (window_ms, level_window_ms) = windows(store, &manifest).await?;
    Ok(Row {
        steps,
        is_revision,
        seconds,
        writes: own.writes,
        written_bytes: own.written_bytes,
        ratio: own.written_bytes as f64 / frame_bytes as f64,
        read_bytes: own.read_bytes,
        background_seconds: all - seconds,
        background_bytes: behind,
        window_ms,
        level_window_ms,
    })
}

/// Reads windows of the newest step, spread over the grid: the first, its cube opened, and the median of the others, ms; and the
/// medians of those of its coarser levels.
async fn windows(store: &Store, manifest: &Manifest) -> Result<([f64; 2], Vec<f64>)> {
    let (fresh, _traffic) = store.counted();
    let begun = Instant::now();
    let repository = Repository::open(&fresh, &cube::folder(&manifest.product)).await?;
    let cube = repository.at(&At::Newest).await?;
    let opened_ms = begun.elapsed().as_secs_f64() * 1e3;
    let step = manifest.steps.len() - 1;
    let mut took = windows_of(&cube, step, 0, &manifest.grid).await?;
    let first_ms = opened_ms + took.remove(0);
    took.sort_by(f64::total_cmp);
    let of_cells = [first_ms, super::quantile(&took, 0.5)];
    let mut of_levels = vec![];
    for level in cube.levels() {
        let mut took = windows_of(&cube, step, level.number, &level.grid).await?;
        took.sort_by(f64::total_cmp);
        of_levels.push(super::quantile(&took, 0.5));
    }
    Ok((of_cells, of_levels))
}

/// How long each of some windows of a level took to read, ms.
async fn windows_of(cube: &Cube, step: usize, level: u32, grid: &Grid) -> Result<Vec<f64>> {
    let [rows, cols] = [grid.rows, grid.cols].map(|side| side.min(WINDOW_CELLS));
    // Shares of the golden section lie far from each other.
    let place = |at: u32, of: u32| (f64::from(at) * 0.618_034).fract() * f64::from(of);
    let mut took = vec![];
    for at in 0..WINDOWS {
        let window = Window {
            row: place(at + 1, grid.rows - rows) as u32,
            col: place(3 * at + 2, grid.cols - cols) as u32,
            rows,
            cols,
        };
        let begun = Instant::now();
        let found = cube.window_at(level, window, step).await?;
        let found = found.context("what landed has levels")?;
        ensure!(
            found.values.len() == window.cell_count(),
            "a window lacks cells"
        );
        took.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    Ok(took)
}

fn table(rows: &[Row]) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header([
        "steps",
        "frame",
        "seconds",
        "objects",
        "written MB",
        "of frame",
        "read MB",
        "behind it s",
        "MB",
        "window ms",
        "again ms",
        "levels ms",
    ]);
    let mb = |bytes: u64| format!("{:.2}", bytes as f64 / 1e6);
    for row in rows {
        table.add_row([
            row.steps.to_string(),
            if row.is_revision {
                "revised"
            } else {
                "one more"
            }
            .to_owned(),
            format!("{:.2}", row.seconds),
            row.writes.to_string(),
            mb(row.written_bytes),
            format!("{:.2}", row.ratio),
            mb(row.read_bytes),
            format!("{:.2}", row.background_seconds),
            mb(row.background_bytes),
            format!("{:.1}", row.window_ms[0]),
            format!("{:.1}", row.window_ms[1]),
            row.level_window_ms
                .iter()
                .map(|ms| format!("{ms:.1}"))
                .collect::<Vec<_>>()
                .join(" "),
        ]);
    }
    table
}
