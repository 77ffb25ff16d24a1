//! How a step of an attachment is read: what planning found out, as JSON in the attachment, so that later readers plan nothing
//! and what the store says of itself may change without changing values.

use contract::quantity::Quantity;
use serde::{Deserialize, Serialize};
use storage::attached::Attachment;

use crate::inspect::arrays::Indexes;
use crate::plan::cf::axis::Mapping;
use crate::plan::cf::coordinate::{Axis, Role};
use crate::plan::cf::packing::StoredPacking;

/// How stored numbers of an array become values of a product.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Reading {
    /// What the values are, for what can be true of them.
    pub(super) quantity: Quantity,
    /// The profile that was given by its name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) profile: Option<String>,
    /// Axes of the array, but for those of which one index is read.
    pub(super) axes: Vec<Axis>,
    /// Indexes of the others, by the names of their dimensions.
    #[serde(default, skip_serializing_if = "Indexes::is_empty")]
    pub(super) indexes: Indexes,
    /// Where each cell of the grid lies.
    pub(super) mapping: Mapping,
    /// Stored numbers to values.
    pub(super) packing: StoredPacking,
    /// Does a chunk that is not there mean no data?
    pub(super) absent_is_no_data: bool,
}

impl Reading {
    /// That of an attachment.
    pub(super) fn of(attachment: &Attachment) -> Result<Self, String> {
        Self::deserialize(&attachment.reading)
            .map_err(|e| format!("its attachment is of another program: {e}"))
    }

    /// The words that say which indexes are read, each with a space before it.
    pub(super) fn index_words(&self) -> String {
        let each = self.indexes.iter();
        each.fold(String::new(), |text, (name, index)| {
            format!("{text} --index {name}={index}")
        })
    }

    /// Forgets how many steps there are.
    pub(super) fn without_length_of_time(&mut self) {
        let times = self.axes.iter_mut().filter(|axis| axis.role == Role::Time);
        times.for_each(|axis| axis.len = 0);
    }
}
