//! Files of observations, for clean-up: in use are those that the newest and the young indexes of their dataset name, and these.

use std::collections::BTreeSet;

use async_trait::async_trait;
use contract::key::ObjectKey;
use contract::kind::Kind;
use storage::gc::{Kept, Owner};
use storage::{StorageError, Store};

use crate::files::index;

/// Datasets of observations that are kept as files.
#[derive(Debug)]
pub struct Datasets;

#[async_trait]
impl Owner for Datasets {
    fn kinds(&self) -> &'static [Kind] {
        &[Kind::ObservationIndex, Kind::Observations]
    }

    async fn in_use(
        &self,
        store: &Store,
        kept: &Kept,
    ) -> Result<BTreeSet<ObjectKey>, StorageError> {
        if kept.versions == 0 {
            return Ok(BTreeSet::new());
        }
        index::named_by_newest(store, kept.versions, kept.oldest_ms).await
    }
}
