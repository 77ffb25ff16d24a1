//! Carbon budgets: B = the integral of the flux over a region's area and over time, exact at any parallelism.

mod accumulated;
mod asked;
pub mod bands;
pub mod chunk;
mod closure;
pub mod fixed;
pub mod gaps;
mod history;
mod measure;
pub mod named;
mod of_region;
pub(crate) mod over_region;
mod parts;
mod query;
mod river;
pub mod rows;
pub mod running;
pub mod sums;
mod uncertainty;

pub use history::history;
pub use measure::Measure;
pub use query::{budget, budget_of};
