//! The last resort: a panic in a handler becomes an answer, a line in the log and a count.

use std::any::Any;

use axum::response::{IntoResponse as _, Response};
use prometheus::IntCounter;
use tower_http::catch_panic::ResponseForPanic;

use crate::error::ServerError;

/// Answers for handlers that panicked.
#[derive(Debug, Clone)]
pub(crate) struct CountPanics(pub IntCounter);

impl ResponseForPanic for CountPanics {
    type ResponseBody = axum::body::Body;

    fn response_for_panic(&mut self, payload: Box<dyn Any + Send + 'static>) -> Response {
        self.0.inc();
        ServerError::panicked("a handler", &*payload).into_response()
    }
}
