//! What is made of series: pure functions over periods with values beside them, and the questions that read those from products.
//!
//! Pure: `climatology`, `linear_trend`, `theil_sen`, `mann_kendall`, `trend`, `harmonics`, `extremes`, `common_steps`,
//! `correlation`, `mean_difference`, `bands`, and what they share. Asked of products: `of_series`, `together`, `hovmoller`, whose bands
//! `banded` makes of a box or of polygons.

pub mod autocorrelation;
mod band_shares;
mod banded;
pub mod bands;
pub mod climatology;
pub mod common_steps;
pub mod correlation;
pub mod distribution;
pub mod extremes;
pub mod harmonics;
mod hovmoller;
pub mod least_squares;
pub mod line;
pub mod linear_trend;
pub mod mann_kendall;
pub mod mean_difference;
mod of_series;
mod read;
#[cfg(test)]
mod reference;
pub mod selection;
pub mod theil_sen;
pub mod timeline;
mod together;
pub mod trend;
pub mod undefined;

pub use hovmoller::hovmoller;
pub use of_series::analyse;
pub use read::Version;
pub use together::{correlation, difference};
pub use undefined::Undefined;
