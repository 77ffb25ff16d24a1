//! What was measured: pictures a second, how late they were, and how fairly they were shared out.

use comfy_table::Table;
use comfy_table::presets::NOTHING;
use serde::Serialize;

use super::camera::Flight;
use crate::bench::quantile;
use crate::cli::BenchFly;

/// What is printed.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    viewers: u16,
    seconds: u16,
    full_size_px: [u32; 2],
    pictures_per_s: f64,
    /// Of a viewer: the slowest one, the median, the quickest one.
    pictures_per_s_and_viewer: [f64; 3],
    latency_p50_ms: f64,
    latency_p95_ms: f64,
    latency_p99_ms: f64,
    median_width_px: u32,
    mean_bytes: usize,
    full_after_rest_p50_ms: Option<f64>,
    full_after_rest_longest_ms: Option<f64>,
    errors: usize,
}

impl Summary {
    /// Of flights with pictures.
    pub(super) fn of(options: &BenchFly, flights: &[Flight]) -> Self {
        let seconds = f64::from(options.seconds.get());
        let sorted = |mut values: Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values
        };
        let all =
            |of: fn(&Flight) -> &Vec<f64>| sorted(flights.iter().flat_map(of).copied().collect());
        let latency_ms = all(|flight| &flight.latency_ms);
        let rates = flights.iter().map(|one| one.pictures() as f64 / seconds);
        let rates = sorted(rates.collect());
        let rest_ms = sorted(flights.iter().filter_map(|one| one.rest_ms).collect());
        let mut widths: Vec<u32> = flights.iter().flat_map(|one| one.widths.clone()).collect();
        widths.sort_unstable();
        let bytes: usize = flights.iter().map(|one| one.bytes).sum();
        let is_there = !rest_ms.is_empty();
        Self {
            viewers: options.clients.get(),
            seconds: options.seconds.get(),
            full_size_px: [options.width, options.height],
            pictures_per_s: latency_ms.len() as f64 / seconds,
            pictures_per_s_and_viewer: [0.0, 0.5, 1.0].map(|share| quantile(&rates, share)),
            latency_p50_ms: quantile(&latency_ms, 0.5),
            latency_p95_ms: quantile(&latency_ms, 0.95),
            latency_p99_ms: quantile(&latency_ms, 0.99),
            median_width_px: widths[widths.len() / 2],
            mean_bytes: bytes / latency_ms.len(),
            full_after_rest_p50_ms: is_there.then(|| quantile(&rest_ms, 0.5)),
            full_after_rest_longest_ms: is_there.then(|| quantile(&rest_ms, 1.0)),
            errors: flights.iter().map(|one| one.errors.len()).sum(),
        }
    }

    pub(super) fn table(&self) -> Table {
        let mut table = Table::new();
        table.load_preset(NOTHING);
        let ms = |ms: f64| format!("{ms:.1} ms");
        let [width, height] = self.full_size_px;
        let [slowest, median, quickest] = self.pictures_per_s_and_viewer;
        let rest = |ms_or_none: Option<f64>| ms_or_none.map_or_else(|| "none came".to_owned(), ms);
        for (name, value) in [
            ("viewers", self.viewers.to_string()),
            ("pictures a second", format!("{:.1}", self.pictures_per_s)),
            (
                "of a viewer",
                format!("{slowest:.1} to {quickest:.1}, median {median:.1}"),
            ),
            ("camera to picture p50", ms(self.latency_p50_ms)),
            ("p95", ms(self.latency_p95_ms)),
            ("p99", ms(self.latency_p99_ms)),
            (
                "median width",
                format!("{} of {width} x {height}", self.median_width_px),
            ),
            ("mean size", format!("{} bytes", self.mean_bytes)),
            (
                "rest to full picture p50",
                rest(self.full_after_rest_p50_ms),
            ),
            ("longest", rest(self.full_after_rest_longest_ms)),
            ("errors", self.errors.to_string()),
        ] {
            table.add_row([name.to_owned(), value]);
        }
        table
    }
}
