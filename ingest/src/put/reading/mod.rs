//! What a file was read as, noted in the store under the hash of all that it follows from: file, name, profile, decoder.
//!
//! It tells whether a step is what the file would be read as now, and what of a re-reading that was killed is done. It
//! lies in `readings/{product}/{raw}-{input}` and goes with its raw file.

use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::{Kind, Vouched};
use contract::manifest::Step;
use contract::product::ProductId;
use contract::quantity::Quantity;
use serde::{Deserialize, Serialize};
use storage::gc::Owner;
use storage::{StorageError, Store, document};

use crate::error::IngestError;
use crate::plan::Target;
use crate::plan::recipe::Recipe;

/// Version of the note's JSON as it is written. Those of version 1 are not sealed and are read as well.
const SCHEMA: u32 = 2;

/// What one file was read as; its fields are durable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Reading {
    schema: u32,
    pub(crate) recipe: Recipe,
    pub(crate) title: String,
    pub(crate) source: String,
    pub(crate) quantity: Quantity,
    pub(crate) synthetic: bool,
    pub(crate) grid: Grid,
    /// In the order of time, at least one.
    pub(crate) steps: Vec<Step>,
    /// What was taken for granted, because nothing in the file says it. One line each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) assumptions: Vec<String>,
}

impl Reading {
    /// What a file was read as.
    pub(crate) fn new(recipe: Recipe, target: &Target, grid: Grid, steps: Vec<Step>) -> Self {
        Self {
            schema: SCHEMA,
            recipe,
            title: target.title.clone(),
            source: target.source.clone(),
            quantity: target.quantity,
            synthetic: target.synthetic,
            grid,
            steps,
            assumptions: vec![],
        }
    }

    /// The file that it is of.
    pub(crate) fn raw_sha256(&self) -> Digest {
        self.steps[0].raw_sha256
    }

    /// Notes it. An equal note may be there; one that is damaged, or of an older schema, is replaced.
    ///
    /// # Errors
    /// `Conflict` if the same file was read in the same way as something else.
    pub(crate) async fn put(&self, store: &Store, product: &ProductId) -> Result<(), StorageError> {
        let Some(first) = self.steps.first() else {
            return Ok(());
        };
        let key = key(product, &self.recipe, first.raw_sha256, &first.origin)?;
        match document::put_new(store, &key, self).await {
            Err(conflict @ StorageError::Conflict { .. }) => {
                match document::get::<Self>(store, &key).await {
                    Ok(Some(there)) if there.schema == SCHEMA && !self.renames(&there) => {
                        return Err(conflict);
                    }
                    Ok(_older) => {}
                    Err(error @ StorageError::Damaged { .. }) => {
                        tracing::warn!(%error, "a note of a reading is written again");
                    }
                    Err(e) => return Err(e),
                }
                document::put_over(store, &key, self).await
            }
            noted => noted.map(|_new| ()),
        }
    }
}

impl Reading {
    /// Is it another reading but for the names of fields that were named by their bytes there, which may be gone, and for what codes
    /// mean, which programs of before left out?
    fn renames(&self, there: &Self) -> bool {
        let is_renamed = |old: &Step, new: &Step| {
            let named_alike = Step {
                field: new.field.clone(),
                ..old.clone()
            };
            old == new || (named_alike == *new && matches!(old.field.vouches(), Vouched::Bytes(_)))
        };
        let steps = there.steps.iter().zip(&self.steps);
        let is_untold = there.quantity.flags().is_empty();
        let joined = there.quantity.joined(self.quantity).filter(|_| is_untold);
        let alike = Self {
            steps: self.steps.clone(),
            quantity: joined.unwrap_or(there.quantity),
            ..there.clone()
        };
        alike == *self
            && there.steps.len() == self.steps.len()
            && steps.into_iter().all(|(old, new)| is_renamed(old, new))
    }
}

/// What is known of the reading of raw files: in use as long as that file is.
#[derive(Debug)]
pub struct Readings;

impl Owner for Readings {
    fn kinds(&self) -> &'static [Kind] {
        &[Kind::Reading]
    }

    fn is_made_again(&self) -> bool {
        true
    }

    fn lives_with(&self, key: &ObjectKey) -> Option<ObjectKey> {
        if Kind::of(key) != Some(Kind::Reading) {
            return None;
        }
        let product = key.as_str().split('/').nth(1)?.parse().ok()?;
        Some(ObjectKey::raw(&product, &raw_of(key)?))
    }
}

/// Where the reading of a file by a recipe lies.
pub(crate) fn key(
    product: &ProductId,
    recipe: &Recipe,
    raw_sha256: Digest,
    file_name: &str,
) -> Result<ObjectKey, StorageError> {
    let input = recipe.input(raw_sha256, file_name);
    let text = format!("{}/{product}/{raw_sha256}-{input}", Kind::Reading.folder());
    text.parse().map_err(|_no_key| damaged(&text, "is no key"))
}

/// All notes of a product, sorted by raw file.
pub(crate) async fn keys(
    store: &Store,
    product: &ProductId,
) -> Result<Vec<ObjectKey>, IngestError> {
    let listed = store
        .list(&format!("{}/{product}", Kind::Reading.folder()))
        .await;
    listed.map_err(IngestError::storage("list readings"))
}

/// The raw file that a note is of.
pub(crate) fn raw_of(key: &ObjectKey) -> Option<Digest> {
    let name = key.as_str().rsplit('/').next()?;
    name.split_once('-')?.0.parse().ok()
}

/// One note; none if it is gone, damaged, or was written by a program that notes other things: the file is read again.
pub(crate) async fn get(store: &Store, key: &ObjectKey) -> Result<Option<Reading>, IngestError> {
    match document::get::<Reading>(store, key).await {
        Ok(reading) => Ok(reading.filter(|r| r.schema <= SCHEMA && !r.steps.is_empty())),
        Err(error @ StorageError::Damaged { .. }) => {
            tracing::warn!(%error, "a note of a reading is left alone");
            Ok(None)
        }
        Err(e) => Err(IngestError::storage("read a reading")(e)),
    }
}

fn damaged(object: &str, reason: &str) -> StorageError {
    StorageError::Damaged {
        object: object.to_owned(),
        reason: reason.to_owned(),
    }
}

#[cfg(test)]
mod tests;
