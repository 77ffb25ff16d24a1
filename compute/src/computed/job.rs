//! What an executor is told: the computation, its grids and one step of it; and what it answers.

use std::collections::BTreeMap;

use contract::computed::Computation;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use serde::{Deserialize, Serialize};

/// What all steps of a computation share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Job {
    pub(crate) how: Computation,
    /// Names in the expression and units of the inputs, in the order of fields.
    pub(crate) inputs: Vec<(String, String)>,
    /// The one grid of the inputs.
    pub(crate) grid: Grid,
    /// That of the result.
    pub(crate) target_grid: Grid,
    pub(crate) target: ProductId,
    pub(crate) quantity: Quantity,
}

/// One step to compute.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct FieldTask {
    pub(crate) index: usize,
    pub(crate) period: Period,
    pub(crate) fields: Vec<ObjectKey>,
}

/// A step that is stored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct FieldMade {
    pub(crate) index: usize,
    pub(crate) field: ObjectKey,
    pub(crate) valid_cells: u64,
    /// Cells whose result was no number, or none that the quantity can have.
    pub(crate) implausible: u64,
    pub(crate) outside: BTreeMap<String, u64>,
}

/// A run of stored steps, to find which cells hold data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ExtentTask {
    pub(crate) first: usize,
    pub(crate) fields: Vec<ObjectKey>,
}

/// The cells that hold data in some step of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ExtentMade {
    pub(crate) first: usize,
    pub(crate) domain: ObjectKey,
}
