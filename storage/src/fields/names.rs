//! Which of two names of fields stays: a field that was named by its bytes is no other one for being named by its values.

use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::Vouched;

use super::{digest_of, read_with_period};
use crate::{StorageError, Store};

/// The name of a field that is to stand in the place of another: that one's name if both hold the same values of the
/// same period.
///
/// Only a field that is named by its bytes has to be read for it. One that is gone or damaged stays nobody's name.
pub async fn settle(
    store: &Store,
    there: &ObjectKey,
    new: &ObjectKey,
    grid: &Grid,
) -> Result<ObjectKey, StorageError> {
    let (Vouched::Bytes(_), Vouched::Values(name)) = (there.vouches(), new.vouches()) else {
        return Ok(new.clone());
    };
    match read_with_period(store, there, grid).await {
        Ok((values, period)) if digest_of(grid, &values, period) == name => Ok(there.clone()),
        Ok(_other) => Ok(new.clone()),
        Err(e) if e.is_not_found() => Ok(new.clone()),
        Err(error @ StorageError::Damaged { .. }) => {
            tracing::warn!(%error, "a damaged field is replaced");
            Ok(new.clone())
        }
        Err(e) => Err(e),
    }
}
