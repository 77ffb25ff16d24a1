//! One client's stream: its newest state is drawn, older ones are dropped, and what rests is drawn in full.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use axum::http::StatusCode;
use futures::FutureExt as _;
use futures::future::BoxFuture;
use futures::stream::{FuturesUnordered, SplitStream, StreamExt as _};
use tokio::time::{Instant as At, Interval, MissedTickBehavior};

use super::message::{Kind, Picture, Said, refusal};
use super::metrics::StreamMetrics;
use super::outbox::Outbox;
use super::pace::{Detail, Pace};
use super::picture::Wish;
use super::places::Place;
use crate::error::ServerError;
use crate::state::AppState;

/// Pictures that a client has not seen, at most.
const MOST_UNSEEN: usize = 3;
/// A camera that does not move for so long rests.
const REST: Duration = Duration::from_millis(150);
/// A picture that is not seen within this time does not hold back others: its client may have stopped telling.
const UNSEEN: Duration = Duration::from_secs(2);
/// Pause before a state is drawn that could not be for now.
const AGAIN: Duration = Duration::from_millis(250);
/// How often a client is asked whether it is there, and how long it may be silent.
const PING: Duration = Duration::from_secs(10);
const SILENCE: Duration = Duration::from_secs(30);

/// A picture on its way, with the detail that it is drawn in if it is one in motion.
type Drawing = BoxFuture<'static, (Wish, Option<Detail>, Result<Picture, ServerError>)>;

/// Why a stream ends.
struct End {
    /// For its metric.
    reason: &'static str,
    /// For the client, if it is there.
    frame: Option<CloseFrame>,
}

impl End {
    fn told(reason: &'static str, code: u16, text: impl Into<String>) -> Self {
        // A close frame holds 123 bytes of text.
        let mut text: String = text.into();
        while text.len() > 123 {
            text.pop();
        }
        Self {
            reason,
            frame: Some(CloseFrame {
                code,
                reason: text.into(),
            }),
        }
    }

    fn gone() -> Self {
        Self {
            reason: "gone",
            frame: None,
        }
    }
}

/// A stream.
struct Session {
    server: AppState,
    metrics: StreamMetrics,
    pace: Pace,
    /// The highest number that came.
    last_id: Option<u64>,
    /// The last one whose refusal was told.
    refused_id: Option<u64>,
    /// What is to be drawn next.
    newest: Option<Wish>,
    /// What is drawn in full if nothing comes before the time.
    rest: Option<(At, Wish)>,
    /// Not before this are states drawn again that could not be.
    again: Option<At>,
    moving: FuturesUnordered<Drawing>,
    full: Option<Drawing>,
    /// The newest picture that is not sent, and the highest number of one that is.
    ready: Option<Picture>,
    sent_id: Option<u64>,
    /// The layer of the picture that was sent last.
    shown: Option<String>,
    /// Pictures sent and not seen, oldest first.
    unseen: VecDeque<(u64, Instant)>,
    tells_seen: bool,
    heard: Instant,
}

/// Serves one client until one of the two ends it.
pub(crate) async fn run(server: AppState, socket: WebSocket, mut place: Place) {
    let metrics = server.metrics.streams.clone();
    metrics.open.inc();
    let (sink, mut said) = socket.split();
    let outbox = Outbox::start(sink, metrics.send_s.clone());
    let mut session = Session::new(server);
    let end = session.serve(&mut said, &outbox, &mut place).await;
    metrics.ended.with_label_values(&[end.reason]).inc();
    // What is drawn for nobody is given up before its client is told.
    drop(session);
    outbox.close(end.frame).await;
    metrics.open.dec();
}

/// The product and the mode of a view: its address without parameters.
fn layer(view: &str) -> &str {
    view.split_once('?').map_or(view, |(path, _query)| path)
}

impl Session {
    fn new(server: AppState) -> Self {
        Self {
            metrics: server.metrics.streams.clone(),
            server,
            pace: Pace::new(),
            last_id: None,
            refused_id: None,
            newest: None,
            rest: None,
            again: None,
            moving: FuturesUnordered::new(),
            full: None,
            ready: None,
            sent_id: None,
            shown: None,
            unseen: VecDeque::new(),
            tells_seen: false,
            heard: Instant::now(),
        }
    }

    async fn serve(
        &mut self,
        said: &mut SplitStream<WebSocket>,
        outbox: &Outbox,
        place: &mut Place,
    ) -> End {
        let mut ping = every(PING);
        loop {
            self.begin();
            let rest_at = self.rest.as_ref().map(|(at, _wish)| *at);
            let again_at = self.again.filter(|_at| self.newest.is_some());
            let unseen_until = self.unseen_until().filter(|_at| self.is_held_back());
            let turned = tokio::select! {
                biased;
                () = place.ending() => {
                    Err(End::told("stopping", close_code::AWAY, "the server stops: connect again"))
                }
                message = said.next() => self.hear(message),
                room = outbox.room(), if self.ready.is_some() => match room {
                    Some(room) => {
                        room.send(self.send());
                        Ok(())
                    }
                    None => Err(End::told("slow", close_code::POLICY, "nothing was taken for 10 s")),
                },
                Some((wish, detail, drawn)) = self.moving.next(), if !self.moving.is_empty() => {
                    self.drawn(outbox, wish, detail, drawn)
                }
                (wish, detail, drawn) = now(self.full.as_mut()), if self.full.is_some() => {
                    self.full = None;
                    self.drawn(outbox, wish, detail, drawn)
                }
                () = at(rest_at), if rest_at.is_some() => {
                    self.draw_in_full();
                    Ok(())
                }
                () = at(again_at), if again_at.is_some() => {
                    self.again = None;
                    Ok(())
                }
                () = at(unseen_until), if unseen_until.is_some() => {
                    self.unseen.pop_front();
                    Ok(())
                }
                _tick = ping.tick() => self.ask(outbox),
            };
            if let Err(end) = turned {
                return end;
            }
        }
    }

    /// A message of the client.
    fn hear(&mut self, message: Option<Result<Message, axum::Error>>) -> Result<(), End> {
        let message = match message {
            Some(Ok(message)) => message,
            Some(Err(error)) if is_too_long(&error) => {
                return Err(End::told(
                    "too_long",
                    close_code::SIZE,
                    "a message has at most 8 KiB",
                ));
            }
            Some(Err(error)) if is_no_text(&error) => {
                return Err(End::told(
                    "refused",
                    close_code::INVALID,
                    "messages are text of UTF-8",
                ));
            }
            Some(Err(_)) | None => return Err(End::gone()),
        };
        self.heard = Instant::now();
        match message {
            Message::Text(text) => match serde_json::from_str(&text) {
                Ok(Said::State(state)) => {
                    if self.last_id.is_some_and(|last| state.id <= last) {
                        let text = format!("id {} is not above all before it", state.id);
                        return Err(End::told("refused", close_code::INVALID, text));
                    }
                    self.last_id = Some(state.id);
                    self.wish(Wish {
                        state,
                        arrived: self.heard,
                    });
                    Ok(())
                }
                Ok(Said::Seen { seen }) => {
                    self.seen(seen);
                    Ok(())
                }
                Err(_wrong) => Err(End::told(
                    "refused",
                    close_code::INVALID,
                    "neither {\"id\": NUMBER, \"view\": ADDRESS} nor {\"seen\": NUMBER}",
                )),
            },
            Message::Binary(_) => Err(End::told(
                "refused",
                close_code::UNSUPPORTED,
                "messages are text",
            )),
            Message::Ping(_) | Message::Pong(_) => Ok(()),
            Message::Close(_) => Err(End::gone()),
        }
    }

    /// A new state takes the place of the one before.
    fn wish(&mut self, wish: Wish) {
        self.rest = Some((At::now() + REST, wish.clone()));
        // What rested moves again.
        self.full = None;
        if self.newest.replace(wish).is_some() {
            self.metrics.stale.inc();
        }
    }

    fn seen(&mut self, id: u64) {
        self.tells_seen = true;
        while let Some(&(first, sent)) = self.unseen.front() {
            if first > id {
                break;
            }
            if first == id {
                self.pace.seen(sent.elapsed());
            }
            self.unseen.pop_front();
        }
    }

    fn is_held_back(&self) -> bool {
        self.tells_seen && self.unseen.len() >= MOST_UNSEEN
    }

    fn unseen_until(&self) -> Option<At> {
        let &(_id, sent) = self.unseen.front()?;
        Some(At::from_std(sent + UNSEEN))
    }

    /// Begins to draw the newest state, if there is room.
    fn begin(&mut self) {
        if self.moving.len() >= self.pace.at_once() || self.again.is_some() || self.is_held_back() {
            return;
        }
        let Some(wish) = self.newest.take() else {
            return;
        };
        let (detail, quality) = (self.pace.detail(), self.pace.quality());
        let server = self.server.clone();
        let drawing = async move {
            let drawn = wish.clone().moving(server, detail, quality).await;
            (wish, Some(detail), drawn)
        };
        self.moving.push(drawing.boxed());
    }

    fn draw_in_full(&mut self) {
        let Some((_at, wish)) = self.rest.take() else {
            return;
        };
        let server = self.server.clone();
        let drawing = async move {
            let drawn = wish.clone().full(server).await;
            (wish, None, drawn)
        };
        self.full = Some(drawing.boxed());
    }

    /// A picture is there, or is not.
    fn drawn(
        &mut self,
        outbox: &Outbox,
        wish: Wish,
        detail: Option<Detail>,
        drawn: Result<Picture, ServerError>,
    ) -> Result<(), End> {
        let picture = match drawn {
            Ok(picture) => picture,
            Err(error) => return self.failed(outbox, wish, &error),
        };
        let (id, kind) = (picture.header.id, picture.header.kind);
        if let Some(detail) = detail {
            self.pace.drawn(detail, wish.arrived.elapsed());
        }
        // A full one takes the place of the moving one of the same state, and never the other way round.
        let newest = self.ready.as_ref().map(|ready| ready.header.id);
        let newest = newest.max(self.sent_id);
        let is_news =
            newest.is_none_or(|newest| id > newest || (id == newest && kind == Kind::Full));
        if is_news {
            self.ready = Some(picture);
        }
        Ok(())
    }

    /// The picture that is ready, as a message.
    fn send(&mut self) -> Message {
        let Some(picture) = self.ready.take() else {
            return Message::Ping(bytes::Bytes::new());
        };
        let kind = picture.header.kind;
        let label = [kind.as_str()];
        self.metrics.pictures.with_label_values(&label).inc();
        let bytes = picture.bytes.len() as u64;
        self.metrics.bytes.with_label_values(&label).inc_by(bytes);
        let took_s = picture.header.took_ms * 1e-3;
        self.metrics
            .latency_s
            .with_label_values(&label)
            .observe(took_s);
        self.sent_id = Some(picture.header.id);
        self.shown = Some(layer(&picture.header.view).to_owned());
        if kind == Kind::Moving {
            self.unseen.push_back((picture.header.id, Instant::now()));
            // Of a client that does not tell, none is waited for.
            if self.unseen.len() > MOST_UNSEEN && !self.tells_seen {
                self.unseen.pop_front();
            }
        }
        picture.message()
    }

    fn failed(&mut self, outbox: &Outbox, wish: Wish, error: &ServerError) -> Result<(), End> {
        // What never was there is a state that is wrong, as another one.
        let was_shown = self.shown.as_deref() == Some(layer(&wish.state.view));
        if error.status() == StatusCode::NOT_FOUND && was_shown {
            let text = error.to_string();
            return Err(End::told("removed", close_code::POLICY, text));
        }
        let is_newest = self.last_id == Some(wish.state.id);
        // Once, however often it is tried again.
        if is_newest && self.refused_id.replace(wish.state.id) != Some(wish.state.id) {
            outbox.offer(refusal(wish.state.id, error));
        }
        if error.is_retryable() {
            self.again = Some(At::now() + AGAIN);
            if is_newest && self.newest.is_none() {
                self.rest = Some((At::now() + AGAIN + REST, wish.clone()));
                self.newest = Some(wish);
            }
        } else if is_newest {
            // It would be refused in full, too.
            self.rest = None;
        }
        Ok(())
    }

    /// Is the client there?
    fn ask(&mut self, outbox: &Outbox) -> Result<(), End> {
        if self.heard.elapsed() > SILENCE {
            return Err(End::told(
                "silent",
                close_code::POLICY,
                "no answer within 30 s",
            ));
        }
        outbox.offer(Message::Ping(bytes::Bytes::new()));
        Ok(())
    }
}

fn every(period: Duration) -> Interval {
    let mut interval = tokio::time::interval(period);
    interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
    interval
}

/// Until a time; for ever without one.
async fn at(time: Option<At>) {
    match time {
        Some(time) => tokio::time::sleep_until(time).await,
        None => std::future::pending().await,
    }
}

/// The outcome of what is under way; for ever without it.
async fn now<T>(under_way: Option<&mut BoxFuture<'static, T>>) -> T {
    match under_way {
        Some(under_way) => under_way.await,
        None => std::future::pending().await,
    }
}

fn is_too_long(error: &axum::Error) -> bool {
    error.to_string().contains("too long")
}

fn is_no_text(error: &axum::Error) -> bool {
    error.to_string().contains("UTF-8")
}
