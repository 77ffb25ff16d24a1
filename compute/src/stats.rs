//! Statistics: array kernels (plain slices in, plain values out), and series over regions made of exact sums.

pub mod region_series;
pub mod series;

pub use region_series::{
    RegionSeries, RegionSeriesQuery, RegionValue, region_series, region_series_of,
};
