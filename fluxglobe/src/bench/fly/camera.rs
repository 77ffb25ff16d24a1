//! One viewer: says what its camera sees, many times a second, and notes what it is shown.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};
use futures::{SinkExt as _, StreamExt as _};
use serde::Deserialize;
use serde_json::json;
use tokio_tungstenite::connect_async_with_config;
use tokio_tungstenite::tungstenite::Message;

use super::path::Path;

/// How long a camera that rests is waited for.
const REST_LIMIT: Duration = Duration::from_secs(30);

/// What comes before a picture's bytes.
#[derive(Debug, Deserialize)]
struct Header {
    id: u64,
    kind: String,
    width: u32,
}

/// What one viewer saw while it was counted.
#[derive(Debug, Default)]
pub(super) struct Flight {
    /// From the saying of a state to its picture, ms.
    pub(super) latency_ms: Vec<f64>,
    /// Widths of pictures, pixels.
    pub(super) widths: Vec<u32>,
    pub(super) bytes: usize,
    /// From the last state to the picture in full, ms.
    pub(super) rest_ms: Option<f64>,
    pub(super) errors: Vec<String>,
}

impl Flight {
    pub(super) fn pictures(&self) -> usize {
        self.latency_ms.len()
    }
}

/// Flies until the end, then rests until the picture is there in full.
pub(super) async fn fly(
    address: &str,
    path: &Path,
    rate_hz: u16,
    counted_from: Instant,
    end: Instant,
) -> Result<Flight> {
    // Browsers send at once what a page says, however little it is.
    let (socket, _answer) = connect_async_with_config(address, None, true)
        .await
        .with_context(|| format!("cannot follow {address}"))?;
    let (mut say, mut hear) = socket.split();
    let begun = Instant::now();
    let mut flight = Flight::default();
    let mut said: BTreeMap<u64, Instant> = BTreeMap::new();
    let (mut id, mut last_said) = (0, begun);
    let mut tick = tokio::time::interval(Duration::from_secs(1) / u32::from(rate_hz));
    tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        let is_flying = Instant::now() < end;
        ensure!(
            is_flying || end.elapsed() < REST_LIMIT,
            "a camera that rests had no picture in full within {} s",
            REST_LIMIT.as_secs()
        );
        tokio::select! {
            message = hear.next() => {
                let message = message.context("the stream ended")??;
                match message {
                    Message::Binary(bytes) => {
                        let header = header(&bytes)?;
                        let seen = json!({"seen": header.id}).to_string();
                        say.send(Message::text(seen)).await?;
                        let asked_at = said.get(&header.id).copied().context("an unknown state")?;
                        said = said.split_off(&header.id);
                        if header.kind == "full" {
                            if header.id == id && !is_flying {
                                flight.rest_ms = Some(last_said.elapsed().as_secs_f64() * 1e3);
                                return Ok(flight);
                            }
                        } else if asked_at >= counted_from && is_flying {
                            flight.latency_ms.push(asked_at.elapsed().as_secs_f64() * 1e3);
                            flight.widths.push(header.width);
                            flight.bytes += bytes.len();
                        }
                    }
                    Message::Text(text) => flight.errors.push(text.to_string()),
                    Message::Close(frame) => bail!("closed: {frame:?}"),
                    Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => {}
                }
            }
            _tick = tick.tick(), if is_flying => {
                id += 1;
                last_said = Instant::now();
                said.insert(id, last_said);
                let view = path.view(begun.elapsed().as_secs_f64());
                let state = json!({"id": id, "view": view}).to_string();
                say.send(Message::text(state)).await?;
            }
            () = tokio::time::sleep(Duration::from_millis(500)) => {}
        }
    }
}

fn header(bytes: &[u8]) -> Result<Header> {
    let (length, rest) = bytes
        .split_first_chunk()
        .context("a message is cut short")?;
    let length = u32::from_be_bytes(*length) as usize;
    let header = rest.get(..length).context("a message is cut short")?;
    Ok(serde_json::from_slice(header)?)
}
