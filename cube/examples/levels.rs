//! What a very large field costs a cube, and how quickly windows of its levels are read: `cargo run -p cube --example levels -- ROWS COLS FOLDER`.
//!
//! The field is made up, a band of rows at a time, and never held whole.

use std::ops::Range;
use std::time::Instant;

use contract::chunk::Window;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::time::Period;
use cube::{At, Bands, CubeError, Description, Edit, Repository};
use futures::FutureExt as _;
use futures::future::BoxFuture;
use storage::Store;

/// Side of the windows that are read, cells, and how many of each level.
const WINDOW_CELLS: u32 = 256;
const WINDOWS: u32 = 16;

/// A sea surface with land, clouds and noise of 0.03 K, as a file holds it: in steps of 0.01 K.
struct MadeUp {
    cols: u32,
}

impl MadeUp {
    fn value(row: u32, col: u32) -> f32 {
        let (y, x) = (f64::from(row) / 2000.0, f64::from(col) / 2000.0);
        let land = (x * 0.7 + (y * 1.3).sin()).sin() + (y * 0.9 + (x * 1.1).cos()).cos();
        let cloud = (x * 9.0 + (y * 7.0).sin()).sin() * (y * 11.0 + (x * 5.0).cos()).sin();
        if land > 1.1 || cloud > 0.85 {
            return f32::NAN;
        }
        let noise = row.wrapping_mul(0x9E37_79B9) ^ col.wrapping_mul(0x85EB_CA6B);
        let noise = noise.wrapping_mul(0xC2B2_AE35) >> 16;
        let kelvin = 288.0 + 10.0 * (y * 0.35).sin() + (x * 2.0).sin();
        let counted = (kelvin * 100.0).round() + f64::from(noise % 7);
        (counted * 0.01) as f32
    }
}

impl Bands for MadeUp {
    fn rows(&mut self, rows: Range<u32>) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        let cells = rows.flat_map(|row| (0..self.cols).map(move |col| (row, col)));
        let values = cells.map(|(row, col)| Self::value(row, col)).collect();
        async move { Ok(values) }.boxed()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rows, cols, folder] = &arguments[..] else {
        return Err("usage: levels ROWS COLS FOLDER".into());
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()?;
    runtime.block_on(measured(rows.parse()?, cols.parse()?, folder))
}

async fn measured(rows: u32, cols: u32, folder: &str) -> Result<(), Box<dyn std::error::Error>> {
    let grid = Grid {
        rows,
        cols,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 180.0 / f64::from(rows),
        dlon_deg: 360.0 / f64::from(cols),
    };
    let description = Description {
        product: "made-up".parse()?,
        title: "Made up".to_owned(),
        quantity: Quantity::SeaSurfaceTemperature,
        synthetic: true,
        source: "cube/examples/levels.rs".to_owned(),
        grid,
        version: None,
        statistic: None,
    };
    let (store, traffic) = Store::open(folder)?.counted();
    let repository = Repository::create(&store, "p", &description).await?;
    let begun = Instant::now();
    let mut edit = Edit::begin(&repository).await?;
    let mut bands = MadeUp { cols };
    // Whose digest it would be is of no interest here.
    let digest = Digest::of(b"made up");
    edit.put_bands(Period::month(2000, 1)?, digest, &mut bands)
        .await?;
    edit.commit("one step").await?;
    let counts = traffic.counts();
    report(&format!(
        "put in {:.1} s: {:.1} MB in {} objects, {:.2} of the values' bytes; at most {} were held",
        begun.elapsed().as_secs_f64(),
        counts.written_bytes as f64 / 1e6,
        counts.writes,
        counts.written_bytes as f64 / (grid.cell_count() * 4) as f64,
        most_memory(),
    ));
    let cube = repository.at(&At::Newest).await?;
    let levels: Vec<(u32, Grid)> = std::iter::once((0, grid))
        .chain(cube.levels().map(|level| (level.number, level.grid)))
        .collect();
    for (level, grid) in levels {
        windows(folder, level, &grid).await?;
    }
    Ok(())
}

/// Reads windows all over a level as a process that has read nothing of it before.
async fn windows(folder: &str, level: u32, grid: &Grid) -> Result<(), Box<dyn std::error::Error>> {
    let (fresh, traffic) = Store::open(folder)?.counted();
    let repository = Repository::open(&fresh, "p").await?;
    let cube = repository.at(&At::Newest).await?;
    let [rows, cols] = [grid.rows, grid.cols].map(|side| side.min(WINDOW_CELLS));
    // Shares of the golden section lie far from each other.
    let place = |at: u32, of: u32| (f64::from(at) * 0.618_034).fract() * f64::from(of);
    let mut took = vec![];
    let before = traffic.counts();
    for at in 0..WINDOWS {
        let window = Window {
            row: place(at + 1, grid.rows - rows) as u32,
            col: place(3 * at + 2, grid.cols - cols) as u32,
            rows,
            cols,
        };
        let begun = Instant::now();
        let found = cube.window_at(level, window, 0).await?;
        let found = found.ok_or("a step has levels")?;
        assert_eq!(found.values.len(), window.cell_count());
        took.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    let first = took.remove(0);
    took.sort_by(f64::total_cmp);
    let read = traffic.counts().since(before);
    report(&format!(
        "level {level}, {} x {} cells: a window of {rows} x {cols} in {first:.1} ms, others in {:.1} ms (median), {:.1} ms at most; {:.2} MB each",
        grid.rows,
        grid.cols,
        took[took.len() / 2],
        took[took.len() - 1],
        read.read_bytes as f64 / f64::from(WINDOWS) / 1e6,
    ));
    Ok(())
}

/// The most memory that this process had, as Linux tells it.
fn most_memory() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    let words = line.and_then(|line| line.split_once(':'));
    words.map_or_else(String::new, |(_, size)| size.trim().to_owned())
}

#[expect(clippy::print_stdout, reason = "an example prints what it found")]
fn report(line: &str) {
    println!("{line}");
}
