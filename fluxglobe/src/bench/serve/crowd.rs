//! Clients that each ask for the next picture as soon as they have the last: new ones, or the same ones again and again.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use bytes::Bytes;
use futures::StreamExt as _;

use super::answer::check;
use super::ask::{Answered, Got, ask, client};
use super::questions::Questions;

/// Pictures of a set that are asked for at once when it is first drawn.
const FIRST_AT_ONCE: usize = 4;

/// What clients ask.
pub(super) struct Crowd {
    questions: Questions,
    next: AtomicU64,
    /// The first answers to a set that is asked again and again; empty where every question is another one.
    first: Vec<Bytes>,
}

impl Crowd {
    /// Clients that never ask the same twice.
    pub(super) fn of_new(questions: Questions) -> Self {
        Self {
            questions,
            next: AtomicU64::new(0),
            first: vec![],
        }
    }

    /// Clients that ask for a set of pictures again and again, each of which is drawn now.
    pub(super) async fn of_warm(questions: Questions, set: u16, until: Instant) -> Result<Self> {
        let client = client()?;
        let (client, asked) = (&client, &questions);
        let first = futures::stream::iter((0..u64::from(set)).map(async |number| {
            let address = asked.address(number);
            let kept = std::sync::Mutex::new(Bytes::new());
            let keep = |body: &Bytes| {
                check(body, asked.size_px)?;
                *kept.lock().expect("nobody panics while holding it") = body.clone();
                Ok(())
            };
            let answered = ask(client, &address, keep, until).await;
            match answered.got {
                Got::Picture(_) => Ok(kept.into_inner().expect("nobody panics while holding it")),
                Got::Bad(reason) => Err(anyhow::anyhow!("{address}: {reason}")),
                Got::Nothing => Err(anyhow::anyhow!("{address} was not drawn in time")),
            }
        }));
        let first: Vec<Result<Bytes>> = first.buffered(FIRST_AT_ONCE).collect().await;
        Ok(Self {
            next: AtomicU64::new(0),
            first: first.into_iter().collect::<Result<_>>()?,
            questions,
        })
    }

    pub(super) fn questions(&self) -> &Questions {
        &self.questions
    }

    /// All clients until the end.
    pub(super) async fn run(self: Arc<Self>, clients: u16, end: Instant) -> Result<Vec<Answered>> {
        let mut asking = vec![];
        for _ in 0..clients {
            let (own, client) = (Arc::clone(&self), client()?);
            asking.push(tokio::spawn(
                async move { own.ask_until(&client, end).await },
            ));
        }
        let mut all = vec![];
        for one in asking {
            all.extend(one.await?);
        }
        Ok(all)
    }

    async fn ask_until(&self, client: &reqwest::Client, end: Instant) -> Vec<Answered> {
        let mut answers = vec![];
        while Instant::now() < end {
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            let first = match self.first.len() as u64 {
                0 => None,
                set => self.first.get((number % set) as usize),
            };
            let address = match self.first.len() as u64 {
                0 => self.questions.address(number),
                set => self.questions.address(number % set),
            };
            let check = |body: &Bytes| self.check(body, first);
            answers.push(ask(client, &address, check, end).await);
        }
        answers
    }

    fn check(&self, body: &Bytes, first: Option<&Bytes>) -> Result<()> {
        check(body, self.questions.size_px)?;
        let Some(first) = first else { return Ok(()) };
        let place = body.iter().zip(first).position(|(one, other)| one != other);
        let same = body.len() == first.len() && place.is_none();
        ensure!(
            same,
            "a picture that was given before came as other bytes, the first of them at {}",
            place.unwrap_or(body.len().min(first.len()))
        );
        Ok(())
    }
}

/// Pictures that the server had to have drawn so far.
pub(super) async fn misses(client: &reqwest::Client, url: &str) -> Result<u64> {
    /// What the server calls its pictures that were not stored.
    const MISSES: &str = "fluxglobe_tile_server_cache_misses_total";
    let address = format!("{url}/metrics");
    let text = client.get(&address).send().await?.text().await?;
    let figures = super::figures::Figures::parse(&text);
    let count = figures.sum(MISSES, "");
    Ok(count.with_context(|| format!("{address} does not tell of {MISSES}"))? as u64)
}
