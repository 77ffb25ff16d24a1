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
/// Source: Takahashi et al. (2009), doi:10.1016/j.dsr2.2008.12.009.
pub fn at_temperature_takahashi2009(pco2_pa: f64, from_k: f64, to_k: f64) -> f64 {
    let (from, to) = (from_k - ZERO_CELSIUS_K, to_k - ZERO_CELSIUS_K);
    pco2_pa * (0.0433 * (to - from) - 4.35e-5 * (to * to - from * from)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
