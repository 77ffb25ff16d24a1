//! What is right: of each month in each of its editions the budget, the value at a place, and the picture; from one
//! process that nobody disturbs.

use std::path::Path;

use harness::{granule, program};
use serde_json::Value;

use super::{FOUGHT, PLACE, TIME};

/// Editions of a month: what it is first, and two revisions that are noticed together.
pub(crate) const EDITIONS: usize = 3;
/// The months whose middles `TIME` lies between.
const AROUND: [usize; 2] = [1, 2];
/// Values at a place went through decimal text.
const TOLERANCE: f64 = 1e-6;

/// What is right of one month in one edition.
#[derive(Debug, Clone, Copy)]
struct Month {
    budget_tg: f64,
    value: f64,
}

/// What is right.
pub(crate) struct Truth {
    /// By edition, then by month.
    editions: Vec<Vec<Month>>,
    /// Pictures at `TIME` by the editions of the months around it.
    pictures: Vec<([usize; EDITIONS - 1], Vec<u8>)>,
}

fn ingest(data: &Path, months: impl IntoIterator<Item = usize>, edition: usize) {
    let file = |month| granule::write(data, month, edition).unwrap();
    let files: Vec<_> = months.into_iter().map(file).collect();
    let mut words = vec!["ingest"];
    words.extend(files.iter().map(|file| file.to_str().unwrap()));
    program::succeed(data, &words).unwrap();
}

/// A tile of a data folder at `TIME`.
pub(crate) fn tile(data: &Path, mode: &str, address: &str) -> Vec<u8> {
    let file = data.join("tile.png");
    let [z, x, y] = address.split('/').collect::<Vec<_>>()[..] else {
        panic!("{address}")
    };
    let mut words = vec!["render", "tile", "--layer", FOUGHT, "--mode", mode];
    words.extend(["--time", TIME, "--z", z, "--x", x, "--y", y]);
    words.extend(["-o", file.to_str().unwrap()]);
    program::succeed(data, &words).unwrap();
    std::fs::read(&file).unwrap()
}

impl Truth {
    pub(crate) fn of(months: usize, address: &str) -> Self {
        let data = tempfile::tempdir().unwrap();
        let data = data.path();
        let mut editions = vec![];
        for edition in 0..EDITIONS {
            ingest(data, 0..months, edition);
            editions.push(read(data, months));
        }
        let mut pictures = vec![];
        for first in 0..EDITIONS {
            ingest(data, [AROUND[0]], first);
            for second in 0..EDITIONS {
                ingest(data, [AROUND[1]], second);
                pictures.push(([first, second], tile(data, "map", address)));
            }
        }
        Self { editions, pictures }
    }

    /// The edition of a month that has this budget.
    pub(crate) fn of_budget(&self, month: usize, budget_tg: f64) -> Option<usize> {
        let is_it = |months: &Vec<Month>| months[month].budget_tg.to_bits() == budget_tg.to_bits();
        self.editions.iter().position(is_it)
    }

    /// The edition of a month that has this value at the place.
    pub(crate) fn of_value(&self, month: usize, value: f64) -> Option<usize> {
        let is_it = |months: &Vec<Month>| {
            let right = months[month].value;
            (value - right).abs() <= TOLERANCE * right.abs()
        };
        self.editions.iter().position(is_it)
    }

    /// The months around `TIME` and their editions in this picture.
    pub(crate) fn of_picture(&self, png: &[u8]) -> Option<Vec<(usize, usize)>> {
        let found = self.pictures.iter().find(|(_, right)| right == png)?;
        Some(AROUND.into_iter().zip(found.0).collect())
    }
}

/// Budgets and values of the first months of a data folder.
fn read(data: &Path, months: usize) -> Vec<Month> {
    let words = ["budget", "--product", FOUGHT, "--step", "month", "--json"];
    let budget = program::json(data, &words).unwrap();
    let (lon, lat) = PLACE;
    let place = ["--lon", lon, "--lat", lat];
    let words = [
        &["stats", "point", "--product", FOUGHT, "--json"],
        &place[..],
    ]
    .concat();
    let point = program::json(data, &words).unwrap();
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{value}"));
    let month = |index: usize| Month {
        budget_tg: number(&budget["rows"][index]["budget_tg"]),
        value: number(&point["series"][index]["value"]),
    };
    (0..months).map(month).collect()
}
