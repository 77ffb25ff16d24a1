//! Partial pressure of CO2: in air from its share of dry air, and in water at another temperature than it was measured at.

use super::ZERO_CELSIUS_K;

/// In air that is wet at the surface, Pa: `x (P - pH2O)`.
///
/// - `dry_mole_fraction`: mol mol⁻¹, 400e-6 for 400 ppm; `pressure_pa`: of all the air; `vapour_pa`: of water
///
/// Source: Dickson et al. (2007), Guide to best practices for ocean CO2 measurements, PICES special publication 3, SOP 5.
pub fn in_wet_air(dry_mole_fraction: f64, pressure_pa: f64, vapour_pa: f64) -> f64 {
    dry_mole_fraction * (pressure_pa - vapour_pa)
}

/// In water brought from one temperature to another: `p exp(0.0423 ΔT)`, Pa.
///
/// 2 to 25 °C. Source: Takahashi et al. (1993), doi:10.1029/93GB02263.
pub fn at_temperature_takahashi1993(pco2_pa: f64, from_k: f64, to_k: f64) -> f64 {
    pco2_pa * (0.0423 * (to_k - from_k)).exp()
}

/// The same with a second-degree term: `p exp(0.0433 (t₂ - t₁) - 4.35e-5 (t₂² - t₁²))`, t in °C.
///
/// Source: Takahashi et al. (2009), doi:10.1016/j.dsr2.2008.12.009, by the second fit of Takahashi et al. (1993).
pub fn at_temperature_takahashi2009(pco2_pa: f64, from_k: f64, to_k: f64) -> f64 {
    let (from, to) = (from_k - ZERO_CELSIUS_K, to_k - ZERO_CELSIUS_K);
    pco2_pa * (0.0433 * (to - from) - 4.35e-5 * (to * to - from * from)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::air_sea::ATMOSPHERE_PA;
    use crate::air_sea::vapour::weiss_price1980;

    /// 4.23 % a degree is the value that the paper is cited for; by hand e^0.0423 = 1.043207.
    #[test]
    fn a_degree_is_four_and_a_quarter_percent() {
        let warmer = at_temperature_takahashi1993(36.0, 290.0, 291.0);
        assert!((warmer / 36.0 - 1.043_207_4).abs() < 1e-6, "{warmer}");
        let (a, b) = (288.15, 289.15);
        let later = at_temperature_takahashi2009(36.0, a, b) / 36.0;
        // By hand at 15 to 16 °C: exp(0.0433 - 4.35e-5 · 31).
        assert!((later - (0.041_951_5f64).exp()).abs() < 1e-12, "{later}");
    }

    #[test]
    fn there_and_back_is_the_same() {
        for at in [at_temperature_takahashi1993, at_temperature_takahashi2009] {
            let back = at(at(36.0, 280.0, 295.0), 295.0, 280.0);
            assert!((back - 36.0).abs() < 1e-12, "{back}");
        }
    }

    /// By hand: 400 ppm of an atmosphere whose 2 % are vapour are 392 µatm.
    #[test]
    fn vapour_takes_its_place() {
        let p = in_wet_air(400e-6, 101_325.0, 0.02 * 101_325.0);
        assert!((p / 0.101_325 - 392.0).abs() < 1e-9, "{p}");
    }

    /// `PyCO2SYS` 1.8.3.4, `upsilon.expUps_linear_TOG93` and `upsilon.expUps_quadratic_TOG93`, °C; the second also `pyseaflux` 2.2.1,
    /// `auxiliary_equations.temperature_correction`, to the last digit.
    #[test]
    fn at_another_temperature_it_is_that_of_others() {
        for (from, to, linear, quadratic) in [
            (10.0, 20.0, 1.526_534_295_966_456_7, 1.521_885_459_443_273_1),
            (2.0, 25.0, 2.645_605_601_573_314, 2.635_008_742_962_091_4),
            (20.0, 18.0, 0.918_879_762_805_999_1, 0.920_080_603_754_680_1),
        ] {
            let (from_k, to_k) = (from + ZERO_CELSIUS_K, to + ZERO_CELSIUS_K);
            let of_1993 = at_temperature_takahashi1993(36.0, from_k, to_k) / 36.0;
            let of_2009 = at_temperature_takahashi2009(36.0, from_k, to_k) / 36.0;
            assert!((of_1993 / linear - 1.0).abs() < 1e-12, "{of_1993}");
            assert!((of_2009 / quadratic - 1.0).abs() < 1e-12, "{of_2009}");
        }
    }

    /// `PyCO2SYS` 1.8.3.4, `sys(par1=…, par1_type=9)["pCO2"]`: µatm of so many ppm of dry air at one atmosphere.
    #[test]
    fn in_air_wet_as_over_the_sea_it_is_that_of_another_program() {
        for (ppm, sst_k, salinity, theirs) in [
            (400.0, 298.15, 35.0, 387.737_880_014_728_1),
            (415.0, 273.15, 35.0, 412.546_794_467_974_73),
            (380.0, 303.15, 38.0, 364.418_538_088_564_4),
        ] {
            let vapour_pa = weiss_price1980(sst_k, salinity);
            let ours_pa = in_wet_air(ppm * 1e-6, ATMOSPHERE_PA, vapour_pa);
            let ours = ours_pa / ATMOSPHERE_PA * 1e6;
            assert!((ours / theirs - 1.0).abs() < 1e-12, "{ours} {theirs}");
        }
    }
}
