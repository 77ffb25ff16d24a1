//! Clients that ask for a tile, a budget and a series all the time, of any tile server that answers; each answer is
//! compared with what is right, and each question without an answer is counted.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use harness::http;
use serde_json::Value;

use super::truth::Truth;
use super::{FOUGHT, MAP_TILE, PLACE, TIME, say};

/// Between two questions of one client.
const PAUSE: Duration = Duration::from_millis(100);
/// First year of the granules.
const FIRST_YEAR: usize = 2000;

/// What a client asks for.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Tile,
    Budget,
    Series,
}

/// The newest edition of each month that a notice was sent of.
pub(crate) type Sent = Arc<Mutex<Vec<usize>>>;

/// What one client met.
#[derive(Debug, Default, Clone)]
pub(crate) struct Tally {
    pub(crate) right: usize,
    /// Answers that say that they can be had later, and questions that no server answered.
    pub(crate) missing: usize,
    /// Between two right answers.
    pub(crate) longest_gap: Duration,
    pub(crate) wrong: Vec<String>,
}

/// Clients at work.
pub(crate) struct Load {
    stop: Arc<AtomicBool>,
    clients: Vec<(&'static str, std::thread::JoinHandle<Tally>)>,
}

struct Client {
    kind: Kind,
    servers: Vec<String>,
    truth: Arc<Truth>,
    sent: Sent,
    /// Of each server and month the newest edition seen: it never goes back.
    seen: Vec<Vec<Option<usize>>>,
    tally: Tally,
}

impl Load {
    pub(crate) fn start(servers: &[String], truth: &Arc<Truth>, sent: &Sent) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let kinds = [
            ("tiles", Kind::Tile),
            ("budgets", Kind::Budget),
            ("series", Kind::Series),
        ];
        let clients = kinds.map(|(name, kind)| {
            let client = Client {
                kind,
                servers: servers.to_vec(),
                truth: Arc::clone(truth),
                sent: Arc::clone(sent),
                seen: vec![vec![]; servers.len()],
                tally: Tally::default(),
            };
            let stop = Arc::clone(&stop);
            (name, std::thread::spawn(move || client.run(&stop)))
        });
        Self {
            stop,
            clients: clients.into(),
        }
    }

    /// What each client met, printed.
    pub(crate) fn end(self) -> Vec<Tally> {
        self.stop.store(true, Ordering::Relaxed);
        let mut all = vec![];
        for (name, client) in self.clients {
            let tally = client.join().unwrap();
            let asked = tally.right + tally.missing + tally.wrong.len();
            say(&format!(
                "{name}: {asked} asked, {} right, {} wrong, {} without an answer ({:.1} %), at most {:.1} s in a row",
                tally.right,
                tally.wrong.len(),
                tally.missing,
                100.0 * tally.missing as f64 / asked.max(1) as f64,
                tally.longest_gap.as_secs_f64()
            ));
            all.push(tally);
        }
        all
    }
}

impl Client {
    fn run(mut self, stop: &AtomicBool) -> Tally {
        let mut last_right = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            match self.ask() {
                Some(Ok(())) => {
                    self.tally.right += 1;
                    let gap = last_right.elapsed();
                    self.tally.longest_gap = self.tally.longest_gap.max(gap);
                    last_right = Instant::now();
                }
                Some(Err(wrong)) => self.tally.wrong.push(wrong),
                None => self.tally.missing += 1,
            }
            std::thread::sleep(PAUSE);
        }
        self.tally.longest_gap = self.tally.longest_gap.max(last_right.elapsed());
        self.tally
    }

    /// Asks one server after the other, as a load balancer does. None if none can answer now.
    fn ask(&mut self) -> Option<Result<(), String>> {
        let (lon, lat) = PLACE;
        let path = match self.kind {
            Kind::Tile => format!("/tiles/{FOUGHT}/map/{MAP_TILE}.png?time={TIME}"),
            Kind::Budget => format!("/api/products/{FOUGHT}/budget?step=month"),
            Kind::Series => format!("/api/products/{FOUGHT}/point?lon={lon}&lat={lat}"),
        };
        for server in 0..self.servers.len() {
            // What was sent after the question is no part of a right answer, but may be in it.
            let Ok(answer) = http::get(&format!("{}{path}", self.servers[server])) else {
                continue;
            };
            match answer.status {
                200 => {
                    let judged = self.judge(server, &answer);
                    return Some(judged.map_err(|wrong| format!("{path} of {server}: {wrong}")));
                }
                502..=504 => {}
                status => return Some(Err(format!("{path}: {status} {}", answer.text()))),
            }
        }
        None
    }

    fn judge(&mut self, server: usize, answer: &http::Answer) -> Result<(), String> {
        let truth = Arc::clone(&self.truth);
        let found = match self.kind {
            Kind::Tile => truth.of_picture(&answer.body),
            Kind::Budget => of_rows(answer, "rows", "budget_tg", |m, v| truth.of_budget(m, v)),
            Kind::Series => of_rows(answer, "series", "value", |m, v| truth.of_value(m, v)),
        };
        let Some(found) = found else {
            let text = match self.kind {
                Kind::Tile => format!("{} bytes", answer.body.len()),
                Kind::Budget | Kind::Series => answer.text(),
            };
            return Err(format!("is of no edition: {text}"));
        };
        let sent = self.sent.lock().unwrap().clone();
        let seen = &mut self.seen[server];
        let is_gone = |month: &usize| found.iter().all(|(there, _)| there != month);
        let mut known = (0..seen.len()).filter(|month| seen[*month].is_some());
        if let Some(month) = known.find(is_gone) {
            return Err(format!("month {month} is gone"));
        }
        for (month, edition) in found {
            seen.resize(seen.len().max(month + 1), None);
            if sent.get(month).is_none_or(|newest| edition > *newest) {
                return Err(format!(
                    "month {month} is of edition {edition}, not sent yet"
                ));
            }
            if seen[month].is_some_and(|seen| edition < seen) {
                return Err(format!("month {month} went back to edition {edition}"));
            }
            seen[month] = Some(edition);
        }
        Ok(())
    }
}

/// Months and editions of the rows of an answer; none if a row is of no edition.
fn of_rows(
    answer: &http::Answer,
    list: &str,
    field: &str,
    edition: impl Fn(usize, f64) -> Option<usize>,
) -> Option<Vec<(usize, usize)>> {
    let json: Value = answer.json().ok()?;
    let rows = json[list].as_array()?;
    let row = |row: &Value| {
        let month = month(row["start"].as_str()?)?;
        Some((month, edition(month, row[field].as_f64()?)?))
    };
    rows.iter().map(row).collect()
}

/// Number of the month, from the first of the granules, that an instant begins.
fn month(start: &str) -> Option<usize> {
    let year: usize = start.get(..4)?.parse().ok()?;
    let of_year: usize = start.get(5..7)?.parse().ok()?;
    Some((year - FIRST_YEAR) * 12 + of_year - 1)
}
