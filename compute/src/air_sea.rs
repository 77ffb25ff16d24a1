//! The air-sea flux of CO2 from what it is computed of, as pure functions of numbers: no grid, no Arrow, no store.
//!
//! Everything is in SI units, temperature in K, salinity practical. NaN in, NaN out. Each function names its paper, and the
//! range that the paper gives; outside it a function goes on, and whoever maps it over cells counts them
//! ([`crate::expression`]). The flux is `F = k (K0w pCO2w - K0a pCO2a) (1 - ice)`, positive out of the sea
//! (Wanninkhof 2014, doi:10.4319/lom.2014.12.351, eq. 1 and 6).

pub mod fugacity;
pub mod gas_transfer;
pub mod ice;
pub mod partial_pressure;
pub mod schmidt;
pub mod skin;
pub mod solubility;
pub mod vapour;
pub mod wind;

/// One standard atmosphere, Pa.
pub const ATMOSPHERE_PA: f64 = 101_325.0;
/// 0 °C, K.
pub const ZERO_CELSIUS_K: f64 = 273.15;
