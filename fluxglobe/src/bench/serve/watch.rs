//! What servers do while they are asked: their figures before and after in; memory, processor time and the shares of stages
//! out.

use std::process::Stdio;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use serde::Serialize;
use tokio::process::Command;

use super::figures::Figures;

/// How often a graphics card is looked at.
const GPU_PAUSE: Duration = Duration::from_secs(2);
/// What a desk does, by operation.
const WORK: &str = "fluxglobe_render_worker_request_seconds";
/// The steps of drawing.
const STEPS: &str = "fluxglobe_render_worker_draw_step_seconds";
/// The way of a picture through a tile server and who draws for it: name, histogram, label.
const STAGES: [(&str, &str, &str); 12] = [
    (
        "look in the store",
        "fluxglobe_tile_server_look_up_seconds",
        "",
    ),
    (
        "wait for a turn",
        "fluxglobe_tile_server_draw_wait_seconds",
        "",
    ),
    (
        "wait at the worker",
        "fluxglobe_render_worker_wait_seconds",
        "",
    ),
    ("load", WORK, "operation=\"load\""),
    ("plan", STEPS, "step=\"plan\""),
    ("mask", STEPS, "step=\"mask\""),
    ("upload", STEPS, "step=\"upload\""),
    ("draw", STEPS, "step=\"device\""),
    ("read back", STEPS, "step=\"read_back\""),
    ("encode", WORK, "operation=\"encode\""),
    (
        "send",
        "fluxglobe_tile_server_send_seconds",
        // Of routes of pictures alone: news are sent as long as somebody listens.
        "_png}\"",
    ),
    (
        "store, behind the answer",
        "fluxglobe_render_worker_store_seconds",
        "",
    ),
];

/// Servers that are watched, by where their figures are.
pub(super) struct Watch {
    client: reqwest::Client,
    addresses: Vec<String>,
}

/// Readings of all servers at the start, in the middle and at the end.
pub(super) struct Readings {
    servers: Vec<(String, [Figures; 3])>,
    gpu: Option<Gpu>,
}

/// One stage of all pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Stage {
    pub(super) name: &'static str,
    /// How often it was gone through.
    pub(super) times: u64,
    pub(super) mean_ms: f64,
    /// Of the time of all stages, percent.
    pub(super) share_percent: f64,
}

/// One server's process.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Process {
    pub(super) address: String,
    /// Processor time for one answer; the counter tells whole seconds.
    pub(super) cpu_ms_per_answer: Option<f64>,
    /// At the start, in the middle, at the end.
    pub(super) resident_bytes: Option<[u64; 3]>,
}

/// The graphics card, as nvidia-smi tells it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Gpu {
    pub(super) mean_use_percent: f64,
    pub(super) most_memory_mib: f64,
}

impl Watch {
    /// The server at `url`, and others whose `/metrics` are at these addresses.
    pub(super) fn new(client: reqwest::Client, url: &str, others: &[String]) -> Self {
        let of = |url: &str| format!("{}/metrics", url.trim_end_matches('/'));
        let all = std::iter::once(of(url));
        Self {
            client,
            addresses: all.chain(others.iter().map(|other| of(other))).collect(),
        }
    }

    async fn read(&self) -> Result<Vec<Figures>> {
        let mut all = vec![];
        for address in &self.addresses {
            let answer = self.client.get(address).send().await;
            let answer = answer
                .and_then(reqwest::Response::error_for_status)
                .with_context(|| format!("{address} tells no figures"))?;
            all.push(Figures::parse(&answer.text().await?));
        }
        Ok(all)
    }

    /// Reads at both times and between them.
    pub(super) async fn between(self, from: Instant, end: Instant) -> Result<Readings> {
        let gpu = tokio::spawn(gpu(from, end));
        tokio::time::sleep_until(from.into()).await;
        let first = self.read().await?;
        tokio::time::sleep_until((from + (end - from) / 2).into()).await;
        let middle = self.read().await?;
        tokio::time::sleep_until(end.into()).await;
        let last = self.read().await?;
        let three = first.into_iter().zip(middle).zip(last);
        let three = three.map(|((first, middle), last)| [first, middle, last]);
        Ok(Readings {
            servers: self.addresses.into_iter().zip(three).collect(),
            gpu: gpu.await?,
        })
    }
}

impl Readings {
    /// By how much a figure of all servers grew; none if nobody tells it.
    pub(super) fn growth(&self, name: &str, label: &str) -> Option<f64> {
        let of = |[first, _, last]: &[Figures; 3]| {
            let last = last.sum(name, label)?;
            Some(last - first.sum(name, label).unwrap_or(0.0))
        };
        let told = self.servers.iter().filter_map(|(_, three)| of(three));
        told.reduce(|sum, one| sum + one)
    }

    /// Stages that are measured and that were gone through.
    pub(super) fn stages(&self) -> Vec<Stage> {
        let part = |(name, histogram, label): (&'static str, &str, &str)| {
            let seconds = self.growth(&format!("{histogram}_sum"), label)?;
            let times = self.growth(&format!("{histogram}_count"), label)?;
            (times > 0.0).then_some((name, seconds, times))
        };
        let parts: Vec<_> = STAGES.into_iter().filter_map(part).collect();
        let whole_s: f64 = parts.iter().map(|(_, seconds, _)| seconds).sum();
        let stage = |(name, seconds, times): (&'static str, f64, f64)| Stage {
            name,
            times: times as u64,
            mean_ms: 1e3 * seconds / times,
            share_percent: 100.0 * seconds / whole_s.max(f64::MIN_POSITIVE),
        };
        parts.into_iter().map(stage).collect()
    }

    pub(super) fn processes(&self, answers: usize) -> Vec<Process> {
        let process = |(address, three): &(String, [Figures; 3])| {
            let [first, _, last] = three;
            let cpu_s = |figures: &Figures| figures.sum("process_cpu_seconds_total", "");
            let grown = cpu_s(last)
                .zip(cpu_s(first))
                .map(|(last, first)| last - first);
            let bytes = three
                .each_ref()
                .map(|figures| figures.sum("process_resident_memory_bytes", ""));
            let bytes = match bytes {
                [Some(first), Some(middle), Some(last)] => {
                    Some([first, middle, last].map(|bytes| bytes as u64))
                }
                _ => None,
            };
            Process {
                address: address.trim_end_matches("/metrics").to_owned(),
                cpu_ms_per_answer: grown.map(|cpu_s| 1e3 * cpu_s / answers.max(1) as f64),
                resident_bytes: bytes,
            }
        };
        self.servers.iter().map(process).collect()
    }

    pub(super) fn gpu(&self) -> Option<Gpu> {
        self.gpu
    }
}

/// Looks at the graphics card now and then; none where there is none or nobody who tells of it.
async fn gpu(from: Instant, end: Instant) -> Option<Gpu> {
    tokio::time::sleep_until(from.into()).await;
    let (mut uses, mut most_memory_mib) = (vec![], 0.0_f64);
    while Instant::now() < end {
        let look = Command::new("nvidia-smi")
            .args([
                "--query-gpu=utilization.gpu,memory.used",
                "--format=csv,noheader,nounits",
            ])
            .stdin(Stdio::null())
            .kill_on_drop(true)
            .output();
        let told = look.await.ok().filter(|told| told.status.success())?;
        let [share, memory_mib] = first_card(&String::from_utf8_lossy(&told.stdout))?;
        uses.push(share);
        most_memory_mib = most_memory_mib.max(memory_mib);
        tokio::time::sleep(GPU_PAUSE).await;
    }
    (!uses.is_empty()).then(|| Gpu {
        mean_use_percent: uses.iter().sum::<f64>() / uses.len() as f64,
        most_memory_mib,
    })
}

/// Use and memory in the first line of what nvidia-smi prints.
fn first_card(text: &str) -> Option<[f64; 2]> {
    let (share, memory) = text.lines().next()?.split_once(',')?;
    Some([share.trim().parse().ok()?, memory.trim().parse().ok()?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(first: &str, last: &str) -> Readings {
        let [first, last] = [first, last].map(Figures::parse);
        Readings {
            servers: vec![("http://s/metrics".to_owned(), [first.clone(), first, last])],
            gpu: None,
        }
    }

    #[test]
    fn shares_of_stages_are_of_what_was_added_while_it_was_watched() {
        let load = "fluxglobe_render_worker_request_seconds";
        let line = |what: &str, operation: &str, value: f64| {
            format!("{load}_{what}{{operation=\"{operation}\"}} {value}\n")
        };
        let wait = "fluxglobe_tile_server_draw_wait_seconds";
        let before = line("sum", "load", 100.0) + &line("count", "load", 7.0);
        let after = line("sum", "load", 103.0)
            + &line("count", "load", 9.0)
            + &line("sum", "call", 50.0)
            + &line("count", "call", 2.0)
            + &format!("{wait}_sum 1\n{wait}_count 4\n");
        let stages = readings(&before, &after).stages();
        let told: Vec<_> = stages.iter().map(|one| (one.name, one.times)).collect();
        assert_eq!(told, [("wait for a turn", 4), ("load", 2)]);
        let shares: Vec<f64> = stages.iter().map(|one| one.share_percent).collect();
        assert_eq!(shares, [25.0, 75.0]);
        assert!((stages[1].mean_ms - 1500.0).abs() < 1e-9);
    }

    #[test]
    fn memory_and_processor_time_are_told_where_the_server_tells_them() {
        let text = |cpu_s, bytes| {
            format!("process_cpu_seconds_total {cpu_s}\nprocess_resident_memory_bytes {bytes}\n")
        };
        let processes = readings(&text(3, 1000), &text(5, 3000)).processes(4);
        assert_eq!(processes[0].address, "http://s");
        assert_eq!(processes[0].cpu_ms_per_answer, Some(500.0));
        assert_eq!(processes[0].resident_bytes, Some([1000, 1000, 3000]));
        let silent = readings("", "").processes(4);
        assert_eq!(
            (silent[0].cpu_ms_per_answer, silent[0].resident_bytes),
            (None, None)
        );
    }

    #[test]
    fn the_first_card_is_read() {
        assert_eq!(first_card("37, 1024\n5, 6\n"), Some([37.0, 1024.0]));
        assert_eq!(first_card("[N/A], 3"), None);
    }
}
