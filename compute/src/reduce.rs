//! One reduction: a version of a product, weights of a geometry on its grid, and bins of time in; statistics out.
//!
//! Tasks of a run of blocks and a run of steps each read their own values and give back accumulators, which are integers
//! and extremes: merged in any order they have the same bits (docs/decisions/024-one-reduction.md). Values leave no task.

pub(crate) mod accumulator;
mod answer;
mod bins;
mod bytes;
mod cells;
pub(crate) mod held_shares;
mod histogram;
mod inside;
mod kernel;
mod number_runs;
mod order;
mod over_steps;
mod percentiles;
mod piece_queue;
mod question;
mod reduction;
mod region_sums;
pub(crate) mod remembered;
mod remembered_shares;
mod run;
mod scales;
mod step_means;
mod stored;
pub(crate) mod task;
mod tasks;
mod values;
mod weighed;

pub use answer::{statistics, statistics_of};
pub(crate) use over_steps::{RegionOnGrid, sums_over_region};
pub(crate) use percentiles::least_part;
pub(crate) use region_sums::RegionStepSums;
#[cfg(test)]
pub(crate) use run::tests::{sql_of, task_of_pieces};
pub(crate) use step_means::{RegionMeans, StepMean, means_over_region};
pub(crate) use tasks::are_fields_less;
