//! `fluxglobe bench serve`: what clients of a running server get: new pictures, pictures that were drawn already, or tiles while
//! time runs; and what the server does for it.

mod answer;
mod ask;
mod crowd;
mod figures;
mod playback;
mod questions;
mod summary;
mod watch;
mod window;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};

use crate::bench::listed::{Listed, listed};
use crate::bench::window_size::WindowSize;
use crate::cli::BenchServe;
use crate::progress;
use ask::{Answered, Got};
use crowd::{Crowd, misses};
use playback::{Playback, Watched};
use questions::{GOLDEN, Questions, TILE_PX};
use summary::{Counted, Summary, Viewers};
use watch::{Readings, Watch};

/// Different reasons of bad answers that are told.
const MOST_REASONS: usize = 5;
/// How long the first answers to a set may take.
const DRAWING_LIMIT: Duration = Duration::from_mins(5);

/// From when to when answers count.
#[derive(Debug, Clone, Copy)]
struct Time {
    from: Instant,
    end: Instant,
}

impl Time {
    fn of(options: &BenchServe) -> Self {
        let from = Instant::now() + Duration::from_secs(options.warm_up_seconds.into());
        let end = from + Duration::from_secs(u64::from(options.seconds.get()));
        Self { from, end }
    }

    fn seconds(self) -> f64 {
        (self.end - self.from).as_secs_f64()
    }

    fn has(self, at: Instant) -> bool {
        (self.from..=self.end).contains(&at)
    }
}

/// What was measured.
struct Measured {
    time: Time,
    what: String,
    answers: Vec<Answered>,
    viewers: Option<Viewers>,
    readings: Readings,
}

pub(crate) async fn run(options: &BenchServe) -> Result<()> {
    let client = ask::client()?;
    let layer = options.layer.as_ref();
    let product = listed(&client, &options.url, layer, options.mode).await?;
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH)?;
    let seed = (now.as_nanos() as u64).wrapping_mul(GOLDEN);
    let bar = progress::bar("ask", 1);
    let measured = if options.playback {
        play(options, client, &product, seed).await?
    } else {
        crowd(options, client, &product, seed).await?
    };
    bar.inc(1);
    let asked = measured.answers.len();
    progress::done(&bar, &format!("{asked} answers"));
    let reasons = bad(&measured.answers);
    let summary = Summary::of(options, &product.product, measured)
        .context("no answer came while answers were counted; give more --seconds");
    match summary {
        Ok(summary) if options.json => {
            progress::result(&serde_json::to_string_pretty(&summary)?)?;
        }
        Ok(summary) => progress::result(&summary.table().to_string())?,
        Err(error) if reasons.is_empty() => return Err(error),
        Err(_said_below) => {}
    }
    if !reasons.is_empty() {
        bail!("some answers were no such picture: {}", reasons.join("; "));
    }
    Ok(())
}

/// Clients that ask for new pictures, or for the same ones again.
async fn crowd(
    options: &BenchServe,
    client: reqwest::Client,
    product: &Listed,
    seed: u64,
) -> Result<Measured> {
    let questions = Questions::about(product, options, seed)?;
    let crowd = if options.warm {
        Crowd::of_warm(questions, options.set.get(), Instant::now() + DRAWING_LIMIT).await?
    } else {
        Crowd::of_new(questions)
    };
    let crowd = Arc::new(crowd);
    let before = misses(&client, &options.url).await?;
    let time = Time::of(options);
    let watch = Watch::new(client.clone(), &options.url, &options.figures);
    let (answers, readings) = tokio::try_join!(
        Arc::clone(&crowd).run(options.clients().get(), time.end),
        watch.between(time.from, time.end)
    )?;
    let drawn = misses(&client, &options.url).await?.saturating_sub(before);
    let pictures = answers.iter().filter(|one| is_picture(one)).count() as u64;
    if options.warm {
        ensure!(
            drawn == 0,
            "{drawn} of {pictures} pictures were drawn anew: does somebody else ask, or is --tile-memory-bytes of the server \
             less than the set, and its store away?"
        );
    } else {
        ensure!(
            drawn >= pictures,
            "{} of {pictures} answers were stored pictures, so that this measures no drawing: does somebody else ask for \
             the same?",
            pictures - drawn
        );
    }
    let [width, height] = crowd.questions().size_px;
    let mode = options.mode;
    let pictures = match options.tiles {
        Some(zoom) => format!("{mode} tiles of zoom {zoom}"),
        None => format!("{mode} views of {width} x {height}"),
    };
    let what = if options.warm {
        format!("{pictures}, {} of them again and again", options.set)
    } else {
        format!("new {pictures}")
    };
    Ok(Measured {
        time,
        what,
        answers,
        viewers: None,
        readings,
    })
}

/// Viewers who watch time run.
async fn play(
    options: &BenchServe,
    client: reqwest::Client,
    product: &Listed,
    seed: u64,
) -> Result<Measured> {
    let playback = Playback::of(product, options, seed)?;
    let time = Time::of(options);
    let watch = Watch::new(client, &options.url, &options.figures);
    let (watched, readings) = tokio::try_join!(
        playback.run([TILE_PX, TILE_PX], time.end),
        watch.between(time.from, time.end)
    )?;
    let count = |of: &dyn Fn(&Watched) -> usize| watched.iter().map(of).collect::<Vec<_>>();
    let is_in_time = |at: &Instant| time.has(*at);
    let instants = count(&|one| one.instants.iter().copied().filter(is_in_time).count());
    let tiles = count(&|one| {
        let answers = one.answers.iter().filter(|answer| is_picture(answer));
        answers.filter(|answer| time.has(answer.ended_at())).count()
    });
    let viewers = Viewers::of(&instants, &tiles, time.seconds());
    let WindowSize { columns, rows } = options.window;
    Ok(Measured {
        time,
        what: format!(
            "playback of {} tiles of zoom {}, {columns} x {rows} a viewer",
            options.mode,
            options.zoom()
        ),
        answers: watched.into_iter().flat_map(|one| one.answers).collect(),
        viewers: Some(viewers),
        readings,
    })
}

fn is_picture(answered: &Answered) -> bool {
    matches!(answered.got, Got::Picture(_))
}

/// What was wrong with bad answers, each reason once.
fn bad(answers: &[Answered]) -> Vec<String> {
    let reasons = answers.iter().filter_map(|answer| match &answer.got {
        Got::Bad(reason) => Some(reason.clone()),
        Got::Picture(_) | Got::Nothing => None,
    });
    let reasons: BTreeSet<String> = reasons.collect();
    reasons.into_iter().take(MOST_REASONS).collect()
}

/// Answers of the time that counts.
fn counted(answers: &[Answered], time: Time) -> Counted {
    let mut all = Counted::default();
    // Who was sent away until the end has no answer that ended in time, and was sent away all the same.
    let is_counted = |one: &&Answered| time.has(one.ended_at()) || matches!(one.got, Got::Nothing);
    for answered in answers.iter().filter(is_counted) {
        all.sent_away += u64::from(answered.sent_away);
        match answered.got {
            Got::Picture(bytes) => all.add(answered.took, bytes),
            Got::Bad(_) => all.bad += 1,
            Got::Nothing => {}
        }
    }
    all.seconds = time.seconds();
    all
}
