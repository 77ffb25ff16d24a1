//! Which refusal an error of the program becomes that a file must not wait for.

use contract::event::RejectReason;

use crate::error::{Cause, IngestError, Rejection};

/// The refusal of a file that makes the program fail however often it is tried, so that others need not wait behind it.
pub(crate) fn blame(error: &IngestError) -> Rejection {
    let (reason, object, advice) = match error.cause() {
        Cause::Stored => (
            RejectReason::Conflict,
            "product",
            "mend what is stored, then send the notice again",
        ),
        Cause::Passing | Cause::Place | Cause::Granule => (
            RejectReason::Unreadable,
            "file",
            "this is a fault of the program: report it with the file",
        ),
    };
    Rejection::new(reason, object, format!("{error}; {advice}"))
}
