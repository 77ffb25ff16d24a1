//! Array kernels of statistics: plain slices in, plain values out; no Arrow, no input and output.

pub mod series;
