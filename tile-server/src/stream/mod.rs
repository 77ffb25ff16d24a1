//! `/stream`: what a camera sees in, pictures of it out, over a WebSocket (docs/stream.md).
//!
//! `message` says what travels, `pace` of which size a picture can be had in time, `picture` how one is come by, and
//! `session` is the way of one client.

mod message;
mod metrics;
mod outbox;
mod pace;
mod picture;
mod places;
mod session;

pub(crate) use message::MOST_MESSAGE_BYTES;
pub(crate) use metrics::StreamMetrics;
pub(crate) use places::Places;
pub(crate) use session::run;
