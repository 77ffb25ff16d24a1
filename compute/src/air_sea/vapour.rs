//! Pressure of water vapour over sea water.

use super::ATMOSPHERE_PA;

/// Temperatures that it was fitted over, K.
pub const RANGE_K: [f64; 2] = [273.15, 313.15];
/// Salinities that it was fitted over.
pub const RANGE_SALINITY: [f64; 2] = [0.0, 40.0];

/// Pressure of vapour in equilibrium with the surface, Pa.
///
/// 0 to 40 °C, salinity 0 to 40; 0.015 %. Source: Weiss and Price (1980), doi:10.1016/0304-4203(80)90024-9, eq. 10.
pub fn weiss_price1980(sst_k: f64, salinity: f64) -> f64 {
    let t = sst_k / 100.0;
    let ln_atm = 24.4543 - 67.4509 / t - 4.8489 * t.ln() - 0.000_544 * salinity;
    ln_atm.exp() * ATMOSPHERE_PA
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `PyCO2SYS` 1.8.3.4, one less its `vp_factor`, atm.
    #[test]
    fn it_is_that_of_another_program() {
        for (sst_k, salinity, dry_share) in [
            (273.15, 35.0, 0.994_088_661_368_613_8),
            (298.15, 35.0, 0.969_344_700_036_820),
            (303.15, 38.0, 0.958_996_152_864_643_3),
        ] {
            let ours = weiss_price1980(sst_k, salinity) / ATMOSPHERE_PA;
            assert!((ours + dry_share - 1.0).abs() < 1e-13, "{ours} {dry_share}");
        }
    }

    /// Saturation pressure over pure water of the steam tables: 3169.9 Pa at 25 °C (IAPWS-IF97).
    #[test]
    fn over_pure_water_it_is_that_of_the_steam_tables() {
        // Goff and Gratch (1946), which the paper was fitted to, lie a thousandth below.
        assert!((weiss_price1980(298.15, 0.0) / 3169.9 - 1.0).abs() < 1.5e-3);
    }
}
