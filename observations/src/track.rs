//! The limits of a question for the way of one platform.

use contract::ContractError;
use contract::observation::{MAX_PLACES, TrackQuery};

use crate::filter::{check_span, is_name};

/// Checks every limit of a question that came from outside.
///
/// # Errors
/// The first limit that is broken, with what would be valid.
pub(crate) fn check(query: &TrackQuery) -> Result<(), ContractError> {
    if !(1..=MAX_PLACES).contains(&query.limit) {
        let text = query.limit.to_string();
        return Err(ContractError::invalid(
            "limit",
            &text,
            format!("1 to {MAX_PLACES}"),
        ));
    }
    if !is_name(&query.platform) {
        let reason = "1 to 64 printable bytes";
        return Err(ContractError::invalid("platform", &query.platform, reason));
    }
    check_span(query.from, query.to)
}
