//! What goes to a client: one message at a time, and a client that takes none for long is given up.

use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket};
use futures::SinkExt as _;
use futures::stream::SplitSink;
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
    pub(super) fn start(sink: SplitSink<WebSocket, Message>) -> Self {
        let (sender, messages) = mpsc::channel(WAITING);
        let writing = tokio::spawn(write(sink, messages));
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

async fn write(mut sink: SplitSink<WebSocket, Message>, mut messages: mpsc::Receiver<Message>) {
    while let Some(message) = messages.recv().await {
        match tokio::time::timeout(LIMIT, sink.send(message)).await {
            Ok(Ok(())) => {}
            Ok(Err(_gone)) => return,
            Err(_elapsed) => {
                tracing::debug!("a client takes nothing");
                return;
            }
        }
    }
}
