//! What is asked of how two products go together in each cell.

use serde::Serialize;

use super::correlation::check_lag;
use crate::ContractError;
use crate::product::ProductId;

/// The other side of a correlation of cells.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MapCorrelation {
    /// The second product, on the grid of the first.
    pub with: ProductId,
    /// Steps that the second is read after the first, -400 to 400: above zero the first leads.
    pub lag_steps: i32,
    /// Is the mean of each calendar month taken off both first?
    pub deseasonalise: bool,
}

impl MapCorrelation {
    /// With a product at the same time, seasons and all.
    pub fn new(with: ProductId) -> Self {
        Self {
            with,
            lag_steps: 0,
            deseasonalise: false,
        }
    }

    /// Is it one that can be asked for?
    ///
    /// # Errors
    /// A lag beyond 400 steps.
    pub fn check(&self) -> Result<(), ContractError> {
        check_lag(self.lag_steps.unsigned_abs())
    }
}
