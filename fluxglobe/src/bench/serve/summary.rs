//! What was measured: answers a second and how long they took.

use std::time::Duration;

use comfy_table::Table;
use comfy_table::presets::NOTHING;
use serde::Serialize;

use super::questions::Questions;
use crate::bench::quantile;
use crate::cli::BenchServe;

/// Answers that count.
#[derive(Debug, Default)]
pub(super) struct Counted {
    /// How long they were counted, seconds.
    pub(super) seconds: f64,
    /// Answers that were not what was asked for.
    pub(super) bad: usize,
    took_ms: Vec<f64>,
    bytes: usize,
}

impl Counted {
    pub(super) fn add(&mut self, took: Duration, bytes: usize) {
        self.took_ms.push(took.as_secs_f64() * 1e3);
        self.bytes += bytes;
    }
}

/// What is printed.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    product: String,
    what: String,
    clients: u16,
    seconds: f64,
    answers: usize,
    bad_answers: usize,
    answers_per_s: f64,
    p50_ms: f64,
    p95_ms: f64,
    p99_ms: f64,
    longest_ms: f64,
    mean_bytes: usize,
}

impl Summary {
    /// None if nothing was answered.
    pub(super) fn of(
        options: &BenchServe,
        questions: &Questions,
        counted: Counted,
    ) -> Option<Self> {
        let Counted {
            seconds,
            bad,
            mut took_ms,
            bytes,
        } = counted;
        took_ms.sort_by(f64::total_cmp);
        let [width, height] = questions.size_px;
        let mode = options.mode;
        let what = match options.tiles {
            Some(zoom) => format!("{mode} tiles of zoom {zoom}"),
            None => format!("{mode} views of {width} x {height}"),
        };
        Some(Self {
            product: questions.product.clone(),
            what,
            clients: options.clients.get(),
            seconds,
            answers: took_ms.len(),
            bad_answers: bad,
            answers_per_s: took_ms.len() as f64 / seconds,
            longest_ms: *took_ms.last()?,
            p50_ms: quantile(&took_ms, 0.5),
            p95_ms: quantile(&took_ms, 0.95),
            p99_ms: quantile(&took_ms, 0.99),
            mean_bytes: bytes / took_ms.len(),
        })
    }

    pub(super) fn table(&self) -> Table {
        let mut table = Table::new();
        table.load_preset(NOTHING);
        let ms = |ms: f64| format!("{ms:.1} ms");
        for (name, value) in [
            ("new pictures", format!("{}, {}", self.what, self.product)),
            ("clients", self.clients.to_string()),
            (
                "answers",
                format!("{} in {:.0} s", self.answers, self.seconds),
            ),
            ("bad answers", self.bad_answers.to_string()),
            ("answers a second", format!("{:.1}", self.answers_per_s)),
            ("p50", ms(self.p50_ms)),
            ("p95", ms(self.p95_ms)),
            ("p99", ms(self.p99_ms)),
            ("longest", ms(self.longest_ms)),
            ("mean size", format!("{} bytes", self.mean_bytes)),
        ] {
            table.add_row([name.to_owned(), value]);
        }
        table
    }
}
