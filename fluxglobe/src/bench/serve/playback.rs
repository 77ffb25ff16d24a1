//! A crowd that watches: each viewer has a window of tiles over a place of its own and asks for the next instant when those of
//! the last one are there and its time has passed.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use futures::StreamExt as _;

use super::answer::check;
use super::ask::{Answered, Got, ask, client};
use super::questions::GOLDEN;
use super::window::Window;
use crate::bench::listed::{Listed, Span};
use crate::cli::BenchServe;

/// Requests of one viewer at the same time: as many as browsers open connections to one server.
const AT_ONCE: usize = 6;
/// Every so many viewers the last one watches what the one before him does.
const SHARED_EVERY: u16 = 4;
const DAY_MS: f64 = 86_400_000.0;

/// What all viewers have in common.
pub(super) struct Playback {
    span: Span,
    start_ms: u64,
    step_ms: u64,
    apart_ms: u64,
    period: Duration,
    windows: Vec<Window>,
    clients: u16,
}

/// What one viewer saw.
#[derive(Debug, Default)]
pub(super) struct Watched {
    /// When each instant was there as a whole.
    pub(super) instants: Vec<Instant>,
    pub(super) answers: Vec<Answered>,
}

/// One viewer.
struct Viewer {
    addresses: Vec<String>,
    /// From the start of the product to his first instant, ms.
    from_ms: u64,
}

impl Playback {
    /// `seed` is another one in every run, so that nobody asked for these instants before.
    pub(super) fn of(product: &Listed, options: &BenchServe, seed: u64) -> Result<Self> {
        ensure!(
            options.period_s > 0.0 && options.days_per_period > 0.0 && options.apart_days >= 0.0,
            "--period-s and --days-per-period are more than 0, --apart-days is not less"
        );
        let to_ms = |days: f64| (days * DAY_MS) as u64;
        Ok(Self {
            span: product.span()?,
            // Within a thousand days: instants are whole milliseconds, so that two runs hardly meet.
            start_ms: seed % to_ms(1000.0),
            step_ms: to_ms(options.days_per_period),
            apart_ms: to_ms(options.apart_days),
            period: Duration::from_secs_f64(options.period_s),
            windows: Window::all(product, options)?,
            clients: options.clients().get(),
        })
    }

    /// Addresses and first instant of a viewer.
    fn viewer(&self, number: u16) -> Viewer {
        let is_shared = number % SHARED_EVERY == SHARED_EVERY - 1;
        let place = u64::from(if is_shared { number - 1 } else { number });
        let share = u128::from(place.wrapping_mul(GOLDEN));
        let window = ((share * self.windows.len() as u128) >> 64) as usize;
        Viewer {
            addresses: self.windows[window].addresses.clone(),
            from_ms: self.start_ms + self.apart_ms * u64::from(number) / u64::from(self.clients),
        }
    }

    /// All viewers until the end.
    pub(super) async fn run(self, size_px: [u32; 2], end: Instant) -> Result<Vec<Watched>> {
        let own = Arc::new(self);
        let mut viewers = vec![];
        for number in 0..own.clients {
            let (own, client) = (Arc::clone(&own), client()?);
            let viewer = own.viewer(number);
            viewers.push(tokio::spawn(async move {
                own.watch(&client, &viewer, size_px, end).await
            }));
        }
        let mut all = vec![];
        for viewer in viewers {
            all.push(viewer.await?);
        }
        Ok(all)
    }

    async fn watch(
        &self,
        client: &reqwest::Client,
        viewer: &Viewer,
        size_px: [u32; 2],
        end: Instant,
    ) -> Watched {
        let mut watched = Watched::default();
        for step in 0.. {
            let begun = Instant::now();
            if begun >= end {
                break;
            }
            let time = self.span.at_ms(viewer.from_ms + step * self.step_ms);
            let asking = viewer.addresses.iter().map(|address| {
                let address = format!("{address}time={time}");
                async move { ask(client, &address, |body| check(body, size_px), end).await }
            });
            let asking: Vec<_> = asking.collect();
            let answers: Vec<Answered> = futures::stream::iter(asking)
                .buffer_unordered(AT_ONCE)
                .collect()
                .await;
            if answers.iter().all(|one| matches!(one.got, Got::Picture(_))) {
                watched.instants.push(Instant::now());
            }
            watched.answers.extend(answers);
            tokio::time::sleep_until((begun + self.period).min(end).into()).await;
        }
        watched
    }
}
