//! Carbon budgets: B = the integral of the flux over a region's area and over time, exact at any parallelism.

pub mod chunk;
pub mod fixed;
mod query;
pub mod rows;
pub mod running;

pub use query::{BudgetAnswer, BudgetQuery, budget, budget_of};
pub use rows::{BudgetRow, BudgetStep};
