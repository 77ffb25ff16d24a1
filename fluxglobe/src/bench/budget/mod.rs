//! `fluxglobe bench budget`: budgets of a year of days over a polygon, a box of a degree and all of the grid, each asked of
//! a process of its own; beside a script on xarray over the same file, if a Python is given. Answers are compared before
//! any time is told.

mod process;
mod summary;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use ingest::GeneratedSteps;
use serde::Deserialize;

use crate::cli::BenchBudget;
use crate::command::generate;
use crate::progress;
use process::{Ran, ran};
use summary::{Row, Timed, table};

/// The script, which shares no code with this program.
const PEER: &str = include_str!("../../../../tests/reference/budget_xarray.py");
/// What the generated file lands in.
const PRODUCT: &str = "china-sea-synthetic";
const SEED: u64 = 1;
/// How far two answers may be apart, as a share of the larger one: stored fluxes have 24 bits, and the script's areas of
/// cells that an edge cuts are of edges in pieces.
const AGREEMENT: f64 = 1e-6;

/// Regions: a name, and corners `[lon, lat]`. The polygon holds some 50,000 cells of 1/15 degree.
const REGIONS: [(&str, &[[f64; 2]]); 3] = [
    (
        "polygon",
        &[
            [109.3, 16.2],
            [113.0, 12.1],
            [119.6, 14.4],
            [123.7, 22.9],
            [126.1, 30.3],
            [122.8, 31.8],
            [117.2, 26.5],
            [111.4, 21.7],
        ],
    ),
    (
        "1-degree box",
        &[[115.0, 20.0], [116.0, 20.0], [116.0, 21.0], [115.0, 21.0]],
    ),
    (
        "all of the grid",
        &[[100.0, 0.0], [130.0, 0.0], [130.0, 41.0], [100.0, 41.0]],
    ),
];

/// A program that is asked for budgets.
struct BenchedProgram {
    name: &'static str,
    program: PathBuf,
    /// All of its words but the last, which is a file with a region.
    words: Vec<String>,
}

/// What both print.
#[derive(Debug, Deserialize)]
struct Answer {
    rows: Vec<AnswerRow>,
}

#[derive(Debug, Deserialize)]
struct AnswerRow {
    budget_tg: f64,
}

pub(crate) fn run(options: &BenchBudget) -> Result<()> {
    let work = &options.work;
    std::fs::create_dir_all(work).with_context(|| format!("making {}", work.display()))?;
    let file = generated(options)?;
    let mut landings = vec![];
    let asked = programs(options, &file, &mut landings)?;
    let mut rows = vec![];
    for (region, corners) in REGIONS {
        let region_file = work.join(format!("{}.geojson", region.replace(' ', "-")));
        std::fs::write(&region_file, geojson(corners))?;
        let mut timed = vec![];
        for one in &asked {
            timed.push(time(one, &region_file, options.runs.get())?);
        }
        let first = timed[0].budget_tg;
        for (one, other) in asked.iter().zip(&timed) {
            ensure!(
                agree(other.budget_tg, first),
                "{region}: {} says {} Tg C and {} {} Tg C: no times are told of answers that differ",
                asked[0].name,
                first,
                one.name,
                other.budget_tg
            );
        }
        rows.push(Row { region, timed });
    }
    if options.json {
        let all = serde_json::json!({ "landings": landings, "budgets": rows });
        return progress::result(&serde_json::to_string_pretty(&all)?);
    }
    progress::say(&format!("{} ({} build)", file.display(), build()));
    progress::result(&table(&landings, &rows).to_string())
}

/// How this program was built: a debug build is no measure of a release.
fn build() -> &'static str {
    if cfg!(debug_assertions) {
        "development"
    } else {
        "release"
    }
}

/// The file, made if it is not there.
fn generated(options: &BenchBudget) -> Result<PathBuf> {
    let name = format!("china-sea-{}-days-{}.nc", options.days, options.scale);
    let file = options.work.join(name);
    if !file.exists() {
        let days = GeneratedSteps::Days(options.days);
        generate::china_sea(&file, options.scale, SEED, days)?;
    }
    Ok(file)
}

/// Who is asked, the file landed with each of them.
fn programs(
    options: &BenchBudget,
    file: &Path,
    landings: &mut Vec<(&'static str, Ran)>,
) -> Result<Vec<BenchedProgram>> {
    let own = std::env::current_exe()?;
    let stem = file.with_extension("");
    let place = |ending: &str| format!("{}-{ending}", stem.display());
    let path = |path: &Path| path.display().to_string();
    let store = place("store");
    if !Path::new(&store).exists() {
        let words = ["--data", &store, "ingest", &path(file)].map(str::to_owned);
        landings.push(("fluxglobe", ran(&own, &words)?));
    }
    let budget = "budget --earth sphere --json --product";
    let mut words = vec!["--data".to_owned(), store];
    words.extend(budget.split(' ').map(str::to_owned));
    words.extend([PRODUCT.to_owned(), "--region".to_owned()]);
    let mut all = vec![BenchedProgram {
        name: "fluxglobe",
        program: own,
        words,
    }];
    let Some(python) = &options.python else {
        return Ok(all);
    };
    let script = options.work.join("budget_xarray.py");
    std::fs::write(&script, PEER)?;
    let zarr = place("zarr");
    if !Path::new(&zarr).exists() {
        let words = [path(&script), "land".to_owned(), path(file), zarr.clone()];
        landings.push(("xarray, Zarr", ran(python, &words)?));
    }
    for (name, source) in [("xarray, NetCDF", path(file)), ("xarray, Zarr", zarr)] {
        all.push(BenchedProgram {
            name,
            program: python.clone(),
            words: vec![path(&script), "budget".to_owned(), source],
        });
    }
    Ok(all)
}

/// A first time, in which weights are computed and kept, and the others.
fn time(asked: &BenchedProgram, region: &Path, runs: u16) -> Result<Timed> {
    let mut words = asked.words.clone();
    words.push(region.display().to_string());
    let ask = || -> Result<(f64, Ran)> {
        let ran = ran(&asked.program, &words)?;
        let answer: Answer = serde_json::from_str(&ran.output)
            .with_context(|| format!("{} printed no answer: {}", asked.name, ran.output))?;
        let [row] = &answer.rows[..] else {
            anyhow::bail!("{} printed {} rows", asked.name, answer.rows.len());
        };
        Ok((row.budget_tg, ran))
    };
    let (budget_tg, first) = ask()?;
    let mut again = vec![];
    for _ in 0..runs {
        let (same_tg, ran) = ask()?;
        // Floats that threads add up in any order are not the same bits each time.
        ensure!(
            agree(same_tg, budget_tg),
            "{} answers {budget_tg} and then {same_tg}",
            asked.name
        );
        again.push(ran);
    }
    Ok(Timed::new(asked.name, budget_tg, &first, &again))
}

fn agree(a: f64, b: f64) -> bool {
    (a - b).abs() <= AGREEMENT * a.abs().max(b.abs())
}

fn geojson(corners: &[[f64; 2]]) -> String {
    let mut ring = corners.to_vec();
    ring.extend(corners.first());
    serde_json::json!({ "type": "Polygon", "coordinates": [ring] }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_such_that_both_can_read_them() {
        for (name, corners) in REGIONS {
            let region: contract::region::Region = geojson(corners).parse().unwrap();
            assert!(
                matches!(region, contract::region::Region::Polygons(_)),
                "{name}"
            );
            assert!(PEER.contains("def budget(") && !PEER.contains("fluxglobe."));
        }
    }

    #[test]
    fn answers_that_differ_by_more_than_rounding_do_not_agree() {
        assert!(agree(-1.0, -1.000_000_5) && agree(0.0, 0.0));
        assert!(!agree(-1.0, -1.000_002) && !agree(1.0, -1.0) && !agree(1.0, f64::NAN));
    }

    #[test]
    fn an_answer_of_ours_is_one_of_those_that_are_read() {
        let answer: Answer = serde_json::from_str(
            r#"{"product": "p", "rows": [{"budget_tg": -1.5, "coverage_percent": 3.0}]}"#,
        )
        .unwrap();
        assert_eq!(answer.rows[0].budget_tg.to_bits(), (-1.5f64).to_bits());
    }
}
