//! Statistics: array kernels (plain slices in, plain values out), and series over regions made of exact sums.

mod cell_series;
pub mod region_series;

pub(crate) use cell_series::cell_values;
pub use region_series::{region_series, region_series_of};
