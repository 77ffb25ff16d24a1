//! How a file is refused over its time.

use contract::event::RejectReason;

use crate::rejection::Rejection;

pub(super) fn refused(object: &str, detail: impl AsRef<str>) -> Rejection {
    Rejection::new(RejectReason::Time, object, detail)
}
