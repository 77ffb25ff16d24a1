//! What reads steps from stores of others.

use std::ops::Range;
use std::sync::Arc;

use async_trait::async_trait;

use super::attachment::Attachment;
use super::reference::Reference;
use crate::failure::Failure;

/// Reads steps from stores of others.
#[async_trait]
pub trait Source: std::fmt::Debug + Send + Sync {
    /// Rows of a step of many cells that are read together, north to south: all of it, in bands that suit how it lies there.
    async fn bands(
        &self,
        _attachment: &Arc<Attachment>,
        reference: &Reference,
    ) -> Result<Vec<Range<u32>>, Failure> {
        Ok(std::iter::once(0..reference.rows).collect())
    }

    /// The values of some rows of a step, `[row, col]`, stored unit, NaN no data.
    async fn values(
        &self,
        attachment: &Arc<Attachment>,
        reference: &Reference,
        rows: Range<u32>,
    ) -> Result<Vec<f32>, Failure>;

    /// Why there is no store any more where an attachment says: its values are then lost, and not changed. None where there is one,
    /// and where that is not known.
    async fn gone(&self, _attachment: &Attachment, _reference: &Reference) -> Option<Failure> {
        None
    }

    /// Lets go of what is kept of the store of an attachment, which may be of before it changed and was attached anew. False where nothing
    /// is kept, or what is has just been read.
    fn let_go(&self, _attachment: &Attachment) -> bool {
        false
    }
}
