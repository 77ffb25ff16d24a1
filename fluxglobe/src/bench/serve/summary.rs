//! What was measured: answers a second and how long they took, how fairly they were shared out, and what it cost the server.

use std::time::Duration;

use comfy_table::Table;
use comfy_table::presets::NOTHING;
use serde::Serialize;

use super::watch::{Gpu, Process, Stage};
use super::{Measured, counted};
use crate::bench::quantile;
use crate::cli::BenchServe;

const MIB: f64 = (1 << 20) as f64;

/// Answers that count.
#[derive(Debug, Default)]
pub(super) struct Counted {
    /// How long they were counted, seconds.
    pub(super) seconds: f64,
    /// Answers that were not what was asked for.
    pub(super) bad: usize,
    /// Times that a client was told to come again.
    pub(super) sent_away: u64,
    took_ms: Vec<f64>,
    bytes: usize,
}

impl Counted {
    pub(super) fn add(&mut self, took: Duration, bytes: usize) {
        self.took_ms.push(took.as_secs_f64() * 1e3);
        self.bytes += bytes;
    }
}

/// What viewers got: of the slowest one, the median, the quickest one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Viewers {
    instants_per_s_and_viewer: [f64; 3],
    tiles_per_s_and_viewer: [f64; 3],
    /// Instants that were shown as a whole.
    instants: usize,
}

impl Viewers {
    /// Of what each viewer saw.
    pub(super) fn of(instants: &[usize], tiles: &[usize], seconds: f64) -> Self {
        let rates = |counts: &[usize]| {
            let mut rates: Vec<f64> = counts.iter().map(|count| *count as f64 / seconds).collect();
            rates.sort_by(f64::total_cmp);
            [0.0, 0.5, 1.0].map(|share| quantile(&rates, share))
        };
        Self {
            instants_per_s_and_viewer: rates(instants),
            tiles_per_s_and_viewer: rates(tiles),
            instants: instants.iter().sum(),
        }
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
    /// 503 with Retry-After: it was waited for and asked again.
    sent_away: u64,
    bad_answers: usize,
    answers_per_s: f64,
    p50_ms: f64,
    p95_ms: f64,
    p99_ms: f64,
    longest_ms: f64,
    mean_bytes: usize,
    viewers: Option<Viewers>,
    stages: Vec<Stage>,
    servers: Vec<Process>,
    gpu: Option<Gpu>,
}

impl Summary {
    /// None if nothing was answered.
    pub(super) fn of(options: &BenchServe, product: &str, measured: Measured) -> Option<Self> {
        let Counted {
            seconds,
            bad,
            sent_away,
            mut took_ms,
            bytes,
        } = counted(&measured.answers, measured.time);
        took_ms.sort_by(f64::total_cmp);
        Some(Self {
            product: product.to_owned(),
            what: measured.what,
            clients: options.clients().get(),
            seconds,
            answers: took_ms.len(),
            sent_away,
            bad_answers: bad,
            answers_per_s: took_ms.len() as f64 / seconds,
            longest_ms: *took_ms.last()?,
            p50_ms: quantile(&took_ms, 0.5),
            p95_ms: quantile(&took_ms, 0.95),
            p99_ms: quantile(&took_ms, 0.99),
            mean_bytes: bytes / took_ms.len(),
            viewers: measured.viewers,
            stages: measured.readings.stages(),
            servers: measured.readings.processes(took_ms.len()),
            gpu: measured.readings.gpu(),
        })
    }

    pub(super) fn table(&self) -> Table {
        let mut table = Table::new();
        table.load_preset(NOTHING);
        let ms = |ms: f64| format!("{ms:.1} ms");
        let mut rows = vec![
            ("pictures", format!("{}, {}", self.what, self.product)),
            ("clients", self.clients.to_string()),
            (
                "answers",
                format!("{} in {:.0} s", self.answers, self.seconds),
            ),
            ("told to come again", self.sent_away.to_string()),
            ("bad answers", self.bad_answers.to_string()),
            ("answers a second", format!("{:.1}", self.answers_per_s)),
            ("p50", ms(self.p50_ms)),
            ("p95", ms(self.p95_ms)),
            ("p99", ms(self.p99_ms)),
            ("longest", ms(self.longest_ms)),
            ("mean size", format!("{} bytes", self.mean_bytes)),
        ];
        if let Some(viewers) = &self.viewers {
            let three = |[slowest, median, quickest]: [f64; 3]| {
                format!("{slowest:.3}, {median:.3}, {quickest:.3} (slowest, median, quickest)")
            };
            rows.extend([
                ("instants shown", viewers.instants.to_string()),
                (
                    "instants a second and viewer",
                    three(viewers.instants_per_s_and_viewer),
                ),
                (
                    "tiles a second and viewer",
                    three(viewers.tiles_per_s_and_viewer),
                ),
            ]);
        }
        for (name, value) in rows {
            table.add_row([name.to_owned(), value]);
        }
        for stage in &self.stages {
            let value = format!(
                "{:.0} % of the time, {:.1} ms each of {}",
                stage.share_percent, stage.mean_ms, stage.times
            );
            table.add_row([stage.name.to_owned(), value]);
        }
        for server in &self.servers {
            add_server(&mut table, server);
        }
        if let Some(gpu) = self.gpu {
            let value = format!(
                "{:.0} % in use, at most {:.0} MiB",
                gpu.mean_use_percent, gpu.most_memory_mib
            );
            table.add_row(["graphics card".to_owned(), value]);
        }
        table
    }
}

fn add_server(table: &mut Table, server: &Process) {
    if let Some(cpu_ms) = server.cpu_ms_per_answer {
        let value = format!("{cpu_ms:.1} ms an answer");
        table.add_row([format!("processor of {}", server.address), value]);
    }
    if let Some(bytes) = server.resident_bytes {
        let [first, middle, last] = bytes.map(|bytes| bytes as f64 / MIB);
        let value = format!("{first:.0}, {middle:.0}, {last:.0} MiB (start, middle, end)");
        table.add_row([format!("memory of {}", server.address), value]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "these numbers are exact")]
    fn the_slowest_and_the_quickest_viewer_are_told_beside_the_median() {
        let viewers = Viewers::of(&[4, 1, 2], &[40, 12, 30], 2.0);
        assert_eq!(viewers.instants_per_s_and_viewer, [0.5, 1.0, 2.0]);
        assert_eq!(viewers.tiles_per_s_and_viewer, [6.0, 15.0, 20.0]);
        assert_eq!(viewers.instants, 7);
    }
}
