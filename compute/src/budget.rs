//! Carbon budgets: B = the integral of the flux over a region's area and over time, exact at any parallelism.

mod accumulated;
mod asked;
pub mod bands;
pub mod chunk;
pub mod fixed;
pub mod gaps;
pub mod named;
pub(crate) mod over_region;
mod query;
pub mod rows;
pub mod running;
pub mod sums;

pub use accumulated::Completeness;
pub(crate) use query::steps_inside;
pub use query::{BudgetAnswer, BudgetQuery, budget, budget_of};
pub use rows::{BudgetRow, BudgetStep};
pub use sums::Measure;
