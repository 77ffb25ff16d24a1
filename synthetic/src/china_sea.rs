//! The China Seas, 0 to 41 N and 100 to 130 E.

pub mod coast;
pub mod flux;
