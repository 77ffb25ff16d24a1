//! One question: an address in, a whole picture out, however often the server says to come again later.

use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use bytes::Bytes;
use reqwest::StatusCode;
use reqwest::header::RETRY_AFTER;

/// Longest wait for one answer.
const ANSWER_LIMIT: Duration = Duration::from_mins(2);
/// A connection that nothing moved on for so long is not used again: servers end those on which nothing was asked after 10 s and
/// others after 75 s, and a question that meets that end has no answer. Browsers ask again then.
const IDLE_LIMIT: Duration = Duration::from_secs(5);
/// Pause after a bad answer: whoever is treated badly does not storm the server.
const PAUSE: Duration = Duration::from_millis(100);
/// Longest pause that a server may ask for.
const LONGEST_PAUSE: Duration = Duration::from_mins(1);

/// What came of a question.
#[derive(Debug)]
pub(super) enum Got {
    /// A good picture of so many bytes.
    Picture(usize),
    /// What was wrong.
    Bad(String),
    /// The time was over.
    Nothing,
}

/// A question and its answer.
#[derive(Debug)]
pub(super) struct Answered {
    pub(super) asked_at: Instant,
    /// Until the picture was there, the times of waiting that the server asked for among it.
    pub(super) took: Duration,
    /// Times that the server said to come again.
    pub(super) sent_away: u32,
    pub(super) got: Got,
}

impl Answered {
    pub(super) fn ended_at(&self) -> Instant {
        self.asked_at + self.took
    }
}

/// A client with connections of its own that stay open.
pub(super) fn client() -> Result<reqwest::Client> {
    let client = reqwest::Client::builder()
        .timeout(ANSWER_LIMIT)
        .pool_idle_timeout(IDLE_LIMIT);
    Ok(client.build()?)
}

/// Asks until there is a picture, or something that `check` takes for none, or the time is over.
pub(super) async fn ask(
    client: &reqwest::Client,
    address: &str,
    check: impl Fn(&Bytes) -> Result<()>,
    end: Instant,
) -> Answered {
    let (asked_at, mut sent_away) = (Instant::now(), 0);
    let asking = async {
        loop {
            match once(client, address).await {
                Ok(Once::Picture(bytes)) => {
                    return match check(&bytes) {
                        Ok(()) => Got::Picture(bytes.len()),
                        Err(error) => Got::Bad(format!("{error:#}")),
                    };
                }
                Ok(Once::Later(pause)) => {
                    sent_away += 1;
                    tokio::time::sleep(pause).await;
                }
                Err(error) => return Got::Bad(format!("{error:#}")),
            }
        }
    };
    let got = tokio::time::timeout_at(end.into(), asking).await;
    let answered = Answered {
        asked_at,
        took: asked_at.elapsed(),
        sent_away,
        got: got.unwrap_or(Got::Nothing),
    };
    if matches!(answered.got, Got::Bad(_)) {
        tokio::time::sleep(PAUSE).await;
    }
    answered
}

enum Once {
    Picture(Bytes),
    Later(Duration),
}

async fn once(client: &reqwest::Client, address: &str) -> Result<Once> {
    let answer = client.get(address).send().await?;
    let status = answer.status();
    let retry_after = answer.headers().get(RETRY_AFTER).cloned();
    let body = answer.bytes().await?;
    let text = || String::from_utf8_lossy(&body).trim().to_owned();
    if status == StatusCode::SERVICE_UNAVAILABLE {
        let seconds = retry_after.as_ref().and_then(|value| value.to_str().ok());
        let seconds = seconds.with_context(|| format!("503 without Retry-After: {}", text()))?;
        let pause = Duration::from_secs(seconds.parse().context("Retry-After is no number")?);
        return Ok(Once::Later(pause.min(LONGEST_PAUSE)));
    }
    if !status.is_success() {
        bail!("{status}: {}", text());
    }
    Ok(Once::Picture(body))
}
