//! What goes to a client: one message at a time, and a client that takes none for long is given up.

use std::time::{Duration, Instant};

use axum::extract::ws::{CloseFrame, Message, WebSocket};
use futures::SinkExt as _;
use futures::stream::SplitSink;
use prometheus::Histogram;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

/// How long a message may take to be taken.
const LIMIT: Duration = Duration::from_secs(10);
/// Messages that wait. A picture that waits gets old, and what is smaller passes none.
const WAITING: usize = 1;

/// The way to one client.
pub(super) struct Outbox {
    sender: mpsc::Sender<Message>,
    writing: JoinHandle<()>,
}

impl Outbox {
    /// `send_s` learns how long pictures take to be taken.
    pub(super) fn start(sink: SplitSink<WebSocket, Message>, send_s: Histogram) -> Self {
        let (sender, messages) = mpsc::channel(WAITING);
        let writing = tokio::spawn(write(sink, messages, send_s));
        Self { sender, writing }
    }

    /// Waits for room; none if nothing can be sent any more.
    pub(super) async fn room(&self) -> Option<mpsc::Permit<'_, Message>> {
        self.sender.reserve().await.ok()
    }

    /// Sends, if there is room now.
    pub(super) fn offer(&self, message: Message) {
        // Full or ended: what is offered can be done without.
        drop(self.sender.try_send(message));
    }

    /// Says why it ends, in time, and ends.
    pub(super) async fn close(self, why: Option<CloseFrame>) {
        let closing = async {
            // Ended by the other side: there is nobody to tell.
            if let Some(why) = why {
                drop(self.sender.send(Message::Close(Some(why))).await);
            }
            drop(self.sender);
            if let Err(error) = self.writing.await {
                tracing::debug!(%error, "a stream was cut off");
            }
        };
        drop(tokio::time::timeout(LIMIT, closing).await);
    }
}

async fn write(
    mut sink: SplitSink<WebSocket, Message>,
    mut messages: mpsc::Receiver<Message>,
    send_s: Histogram,
) {
    while let Some(message) = messages.recv().await {
        let is_picture = matches!(message, Message::Binary(_));
        let begun = Instant::now();
        match tokio::time::timeout(LIMIT, sink.send(message)).await {
            Ok(Ok(())) if is_picture => send_s.observe(begun.elapsed().as_secs_f64()),
            Ok(Ok(())) => {}
            Ok(Err(_gone)) => return,
            Err(_elapsed) => {
                tracing::debug!("a client takes nothing");
                return;
            }
        }
    }
    // Who closes is answered so (RFC 6455, 5.5.1), and who breaks the protocol is told that it ends.
    drop(tokio::time::timeout(LIMIT, sink.close()).await);
}
