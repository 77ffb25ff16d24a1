//! `fluxglobe bench serve`: how many new pictures a running server gives to clients that each ask for the next one as soon
//! as they have the last. Every question is about an instant that nobody asked about before, so that nothing is stored.

mod answer;
mod questions;
mod summary;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};

use crate::cli::BenchServe;
use crate::progress;
use answer::check;
use questions::Questions;
use summary::{Counted, Summary};

/// Longest wait for one answer.
const ANSWER_LIMIT: Duration = Duration::from_mins(2);
/// What the server calls its pictures that were not stored.
const MISSES: &str = "fluxglobe_tile_server_cache_misses_total";
/// Different reasons of bad answers that are told.
const MOST_REASONS: usize = 5;

/// One answer: when it began to be waited for, how long it took, and its bytes or what was wrong with it.
struct Answered {
    asked_at: Instant,
    took: Duration,
    bytes: Result<usize>,
}

pub(crate) async fn run(options: &BenchServe) -> Result<()> {
    let client = reqwest::Client::builder().timeout(ANSWER_LIMIT).build()?;
    let questions = Arc::new(Questions::of(&client, options).await?);
    let misses_before = misses(&client, &options.url).await?;
    let begun = Instant::now();
    let counted_from = begun + Duration::from_secs(options.warm_up_seconds.into());
    let end = counted_from + Duration::from_secs(u64::from(options.seconds.get()));
    let next = Arc::new(AtomicU64::new(0));
    let all = (0..options.clients.get()).map(|_client| {
        let (client, questions, next) = (client.clone(), Arc::clone(&questions), Arc::clone(&next));
        tokio::spawn(async move { ask_until(end, &client, &questions, &next).await })
    });
    let bar = progress::bar("ask", u64::from(options.clients.get()));
    let mut answers = vec![];
    for one in all.collect::<Vec<_>>() {
        answers.extend(one.await?);
        bar.inc(1);
    }
    let asked = answers.len() as u64;
    let drawn = misses(&client, &options.url)
        .await?
        .saturating_sub(misses_before);
    progress::done(
        &bar,
        &format!("{asked} answers, {drawn} pictures that were not stored"),
    );
    let reasons = bad(&answers);
    let counted = counted(answers, counted_from, end);
    let summary = Summary::of(options, &questions, counted)
        .context("no answer came while answers were counted; give more --seconds")?;
    if options.json {
        progress::result(&serde_json::to_string_pretty(&summary)?)?;
    } else {
        progress::result(&summary.table().to_string())?;
    }
    if !reasons.is_empty() {
        bail!("some answers were no such picture: {}", reasons.join("; "));
    }
    if drawn < asked {
        bail!(
            "{} of {asked} answers were stored pictures, so that this measures no drawing: does somebody else ask for the same?",
            asked - drawn
        );
    }
    Ok(())
}

/// One client.
async fn ask_until(
    end: Instant,
    client: &reqwest::Client,
    questions: &Questions,
    next: &AtomicU64,
) -> Vec<Answered> {
    let mut answers = vec![];
    while Instant::now() < end {
        let number = next.fetch_add(1, Ordering::Relaxed);
        let address = questions.address(number);
        let asked_at = Instant::now();
        let bytes = ask(client, &address, questions.size_px).await;
        let took = asked_at.elapsed();
        if bytes.is_err() {
            // Whoever is sent away does not storm the server.
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        answers.push(Answered {
            asked_at,
            took,
            bytes,
        });
    }
    answers
}

async fn ask(client: &reqwest::Client, address: &str, size_px: [u32; 2]) -> Result<usize> {
    let answer = client.get(address).send().await?;
    let status = answer.status();
    let body = answer.bytes().await?;
    if !status.is_success() {
        bail!("{status}: {}", String::from_utf8_lossy(&body));
    }
    check(&body, size_px)?;
    Ok(body.len())
}

/// Pictures that the server had to have drawn so far.
async fn misses(client: &reqwest::Client, url: &str) -> Result<u64> {
    let text = client
        .get(format!("{url}/metrics"))
        .send()
        .await?
        .text()
        .await?;
    // With labels in a cluster, without them where one process does everything.
    let is_it = |line: &&str| {
        let rest = line.strip_prefix(MISSES);
        rest.is_some_and(|rest| rest.starts_with([' ', '{']))
    };
    let line = text.lines().find(is_it);
    let count = line.and_then(|line| line.rsplit(' ').next());
    let count = count.with_context(|| format!("{url}/metrics does not tell of {MISSES}"))?;
    Ok(count.parse()?)
}

/// Answers to what was asked while answers are counted.
fn counted(answers: Vec<Answered>, from: Instant, end: Instant) -> Counted {
    let mut all = Counted::default();
    for Answered {
        asked_at,
        took,
        bytes,
    } in answers
    {
        let ended_at = asked_at + took;
        if ended_at < from || ended_at > end {
            continue;
        }
        match bytes {
            Ok(bytes) => all.add(took, bytes),
            Err(_said_apart) => all.bad += 1,
        }
    }
    all.seconds = end.duration_since(from).as_secs_f64();
    all
}

/// What was wrong with bad answers, each reason once.
fn bad(answers: &[Answered]) -> Vec<String> {
    let mut reasons = vec![];
    for error in answers
        .iter()
        .filter_map(|answer| answer.bytes.as_ref().err())
    {
        let text = format!("{error:#}");
        if reasons.len() < MOST_REASONS && !reasons.contains(&text) {
            reasons.push(text);
        }
    }
    reasons
}
