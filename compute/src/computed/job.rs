//! What an executor is told: the computation, its grids and one step of it; and what it answers.

use std::collections::BTreeMap;

use contract::computed::Computation;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use serde::{Deserialize, Serialize};

/// Version of the way products are computed: it changes when their bits do.
///
/// 2: rounding takes no column from a globe that is brought to another grid; no comparison with what is no number is true.
pub(crate) const METHOD: u32 = 2;

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
    /// By which [`METHOD`]; executors of before it was told are of the first.
    #[serde(default = "first_method")]
    pub(crate) method: u32,
    pub(crate) index: usize,
    pub(crate) field: ObjectKey,
    pub(crate) valid_cells: u64,
    /// Cells whose result was no number, or none that the quantity can have.
    pub(crate) implausible: u64,
    pub(crate) outside: BTreeMap<String, u64>,
}

fn first_method() -> u32 {
    1
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_executor_that_tells_no_method_is_of_the_first() {
        let told =
            r#"{"index":3,"field":"frames/p/a","valid_cells":1,"implausible":0,"outside":{}}"#;
        let made: FieldMade = serde_json::from_str(told).unwrap();
        assert!((made.method, made.index) == (1, 3) && METHOD != 1);
        let own = FieldMade {
            method: METHOD,
            ..made
        };
        let again: FieldMade = serde_json::from_str(&serde_json::to_string(&own).unwrap()).unwrap();
        assert_eq!(again, own);
    }
}
