//! What commits cost, and what a killed writer leaves: the figures of docs/decisions/019.
//!
//! `commits measure FOLDER STEPS` commits so many steps of 180 x 360 cells, one a commit, and prints what the 1st, 10th,
//! 100th ... cost. `commits append FOLDER` commits steps until it is killed, and prints the first instant of each when it is
//! committed; several may do so at once. `commits check FOLDER` reads every step, compares it with its digest and prints its
//! first instant: every line that an `append` printed must be among them.

use std::collections::BTreeMap;
use std::error::Error;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::sync::Arc;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use contract::chunk::Window;
use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use cube::{At, CubeError, Description, Edit, Repository};
use storage::Store;

type Outcome = Result<(), Box<dyn Error>>;

const GRID: Grid = Grid {
    rows: 180,
    cols: 360,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

#[tokio::main]
async fn main() -> Outcome {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match words[..] {
        ["measure", folder, steps] => measure(folder, steps.parse()?).await,
        ["append", folder] => append(folder).await,
        ["check", folder] => check(folder).await,
        _ => Err("measure FOLDER STEPS | append FOLDER | check FOLDER".into()),
    }
}

async fn open(folder: &str) -> Result<Repository, Box<dyn Error>> {
    let store = Store::open(folder)?;
    match Repository::open(&store, "p").await {
        Err(CubeError::Missing { .. }) => {}
        opened => return Ok(opened?),
    }
    let description = Description {
        product: "p".parse()?,
        title: "P".to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        source: "made up".to_owned(),
        grid: GRID,
        version: None,
        statistic: None,
    };
    Ok(Repository::create(&store, "p", &description).await?)
}

/// Noise in a third of the mantissa, a third of cells without data: it compresses as real fields do, to about a half.
fn field(seed: u32) -> Arc<[f32]> {
    let value = |cell: u32| {
        let noise = (cell ^ seed.wrapping_mul(0x9E37_79B9)).wrapping_mul(0x85EB_CA6B) >> 16;
        match cell / 90 % 3 {
            0 => f32::NAN,
            _ => f32::from_bits(0x3F80_0000 | noise),
        }
    };
    (0..GRID.cell_count() as u32).map(value).collect()
}

fn day(number: u32) -> Result<Period, contract::ContractError> {
    let start = TimeMs::from_ymd(1950, 1, 1)?.ms() + i64::from(number) * 86_400_000;
    Period::new(TimeMs::new(start)?, TimeMs::new(start + 86_400_000)?)
}

#[expect(clippy::print_stdout, reason = "the figures are the result")]
async fn measure(folder: &str, steps: u32) -> Outcome {
    let repository = open(folder).await?;
    let mut shown = 1;
    println!("step  ms  objects  bytes  repo-bytes  open-ms  cold-ms  warm-ms  total-s");
    let start = Instant::now();
    for step in 0..steps {
        let is_shown = step + 1 == shown;
        let before = if is_shown {
            files(Path::new(folder))?
        } else {
            BTreeMap::new()
        };
        let begun = Instant::now();
        let mut edit = Edit::begin(&repository).await?;
        edit.put(day(step)?, field(step)).await?;
        edit.commit("a step").await?;
        if !is_shown {
            continue;
        }
        shown *= 10;
        let ms = begun.elapsed().as_secs_f64() * 1e3;
        let after = files(Path::new(folder))?;
        let new = after.iter().filter(|(file, _)| !before.contains_key(file));
        let new: Vec<u64> = new.map(|(_, bytes)| *bytes).collect();
        let repo = std::fs::metadata(Path::new(folder).join("p/repo"))?.len();
        let (opened, cold, warm) = reads(folder, step).await?;
        println!(
            "{}  {ms:.1}  {}  {}  {repo}  {opened:.1}  {cold:.1}  {warm:.2}  {:.1}",
            step + 1,
            new.len(),
            new.iter().sum::<u64>(),
            start.elapsed().as_secs_f64()
        );
    }
    Ok(())
}

/// Milliseconds to open the newest state, to read a chunk, and to read it again.
async fn reads(folder: &str, step: u32) -> Result<(f64, f64, f64), Box<dyn Error>> {
    let ms = |begun: Instant| begun.elapsed().as_secs_f64() * 1e3;
    let begun = Instant::now();
    let repository = open(folder).await?;
    let cube = repository.at(&At::Newest).await?;
    let opened = ms(begun);
    let window = Window {
        row: 10,
        col: 10,
        rows: 8,
        cols: 8,
    };
    let begun = Instant::now();
    cube.window(step as usize / 2, window).await?;
    let cold = ms(begun);
    let begun = Instant::now();
    cube.window(step as usize / 2, window).await?;
    Ok((opened, cold, ms(begun)))
}

/// Sizes by inode: a second name is no second file.
fn files(folder: &Path) -> std::io::Result<BTreeMap<u64, u64>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let meta = entry.metadata()?;
        if meta.is_dir() {
            found.append(&mut files(&entry.path())?);
        } else {
            found.insert(meta.ino(), meta.len());
        }
    }
    Ok(found)
}

#[expect(clippy::print_stdout, reason = "what was committed is the result")]
async fn append(folder: &str) -> Outcome {
    let repository = open(folder).await?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH)?;
    let mut seed = (now.as_nanos() as u32) ^ std::process::id();
    loop {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let mut edit = Edit::begin(&repository).await?;
        let day = day(seed >> 20)?;
        edit.put(day, field(seed)).await?;
        edit.commit("a step").await?;
        println!("{}", day.start);
    }
}

#[expect(clippy::print_stdout, reason = "the figures are the result")]
async fn check(folder: &str) -> Outcome {
    let repository = open(folder).await?;
    let cube = repository.at(&At::Newest).await?;
    for (place, step) in cube.steps().iter().enumerate() {
        cube.field(place).await?;
        println!("{}", step.period.start);
    }
    Ok(())
}
