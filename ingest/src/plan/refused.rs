//! How a file is refused over its time.

use contract::event::RejectReason;

use crate::error::Rejection;

pub(super) fn refused(object: &str, detail: impl AsRef<str>) -> Rejection {
    Rejection::new(RejectReason::Time, object, detail)
}
