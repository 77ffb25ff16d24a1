//! Statistics and carbon budgets over stored products, on Ballista and DataFusion.
//!
//! Questions are SQL over the stored fields, a row a chunk; the array work happens in the SQL functions of
//! [`functions`], which call the pure kernels of [`budget`] and [`stats`]. Values along time come from cubes ([`Engine::values`]). Sums are integers, so that an answer has the
//! same bits however many parts it was computed in.

pub mod air_sea;
pub mod analysis;
mod awaited;
pub mod budget;
pub mod catalogue;
pub mod check;
mod close_name;
pub mod cluster;
mod complete_sums;
pub mod computed;
pub mod dependents;
mod depth;
pub mod derive;
mod error;
pub mod expression;
mod failure;
pub mod flight_sql;
pub mod functions;
pub mod gc;
mod made_from;
pub mod matchup;
mod objects;
mod open_versions;
#[cfg(test)]
mod peak;
pub mod point;
mod publish;
pub mod published;
pub mod recompute;
pub mod reduce;
pub mod region;
pub mod regrid;
mod retry_store;
mod scan;
pub mod service;
mod session;
mod shared_grid;
pub mod sql;
mod standalone;
mod state;
pub mod stats;
mod step_range;
mod summed;
mod tail_store;
mod workshop;

pub use budget::budget;
pub use check::compare;
pub use close_name::close_name;
pub use cluster::SchedulerUrl;
pub use derive::{DeriveProgress, derive_accumulated};
pub use error::{ComputeError, ErrorClass};
pub use objects::Objects;
pub use point::point_series;
pub use session::Engine;
pub use summed::has_budget;
