//! Gap filling proved and measured: against all pairs of cells in double precision, against data that were hidden, and
//! by the clock.

pub mod all_pairs;
pub mod hold_out;
pub mod timing;
