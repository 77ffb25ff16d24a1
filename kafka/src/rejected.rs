//! What was refused: listed, and sent again once its cause is gone. Works on any event log.
//!
//! Nothing is marked: a message that is sent again and refused again is listed twice, with a higher attempt if it is a
//! notice of this program.

use std::collections::BTreeSet;

use contract::event::{Body, Event, RejectReason};
use contract::topic::{Origin, Topic};
use storage::StorageError;
use storage::log::{EventLog, Message, contents};

/// A refusal.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejected {
    /// Where the refusal lies.
    pub at: Origin,
    /// Same as of the refused message.
    pub trace: String,
    /// Path of the file, or what the message is called.
    pub path: String,
    /// Class of the reason.
    pub reason: RejectReason,
    /// What is wrong and what to do.
    pub detail: String,
    /// Which try it was, from 1.
    pub attempt: u32,
    /// Where the refused message lies; absent for files that came without one.
    pub origin: Option<Origin>,
}

/// What became of sending again.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Replayed {
    /// Messages sent again.
    pub sent: u64,
    /// Refusals whose message is no longer kept, or that never had one.
    pub gone: Vec<Origin>,
}

/// All refusals that are kept, oldest first within a partition. What is no refusal in that topic is passed over.
pub async fn list(log: &dyn EventLog) -> Result<Vec<Rejected>, StorageError> {
    let messages = contents(log, Topic::GranuleRejected).await?;
    Ok(messages.iter().filter_map(refusal).collect())
}

/// Sends the messages of some refusals again: a notice as the next attempt, anything else as it was. Each message once,
/// however many of the refusals speak of it.
///
/// # Errors
/// Of the log. What was sent before stays sent; `replay` of the same refusals would send it once more.
pub async fn replay(log: &dyn EventLog, refusals: &[Rejected]) -> Result<Replayed, StorageError> {
    let mut replayed = Replayed::default();
    let mut seen = BTreeSet::new();
    for refusal in refusals {
        let Some(origin) = refusal.origin else {
            replayed.gone.push(refusal.at);
            continue;
        };
        if !seen.insert(origin) {
            continue;
        }
        let Some(message) = log.message(origin).await? else {
            replayed.gone.push(refusal.at);
            continue;
        };
        send_again(log, &message, &refusal.path).await?;
        replayed.sent += 1;
    }
    Ok(replayed)
}

fn refusal(message: &Message) -> Option<Rejected> {
    let event = message.event().ok()?;
    let Body::GranuleRejected {
        path,
        reason,
        detail,
        attempt,
        origin,
    } = event.body
    else {
        return None;
    };
    Some(Rejected {
        at: message.origin,
        trace: event.trace,
        path,
        reason,
        detail,
        attempt,
        origin,
    })
}

async fn send_again(log: &dyn EventLog, message: &Message, path: &str) -> Result<(), StorageError> {
    match message.event() {
        Ok(mut event) if event.body.topic() == message.origin.topic => {
            next_attempt(&mut event);
            // It keeps its place in the order of notices: what was refused then is no newer for being sent again.
            event.noticed = event.noticed.or(message.time);
            log.append(&[event]).await
        }
        // Not ours, or not understood: the bytes as they were.
        Ok(_) | Err(_) => {
            let (topic, content) = (message.origin.topic, message.content.clone());
            log.append_message(topic, path, content).await
        }
    }
}

fn next_attempt(event: &mut Event) {
    if let Body::GranuleNotice { attempt, .. } = &mut event.body {
        *attempt = attempt.saturating_add(1);
    }
}
