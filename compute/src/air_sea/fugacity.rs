//! Fugacity of CO2 in air: its partial pressure, less what its molecules and those of air do to each other.

use super::ATMOSPHERE_PA;

/// Temperatures that the virial coefficient holds over, K.
pub const RANGE_K: [f64; 2] = [273.0, 313.0];
/// Gas constant, cm³ Pa K⁻¹ mol⁻¹ (CODATA 2018, 8.314 462 618 J K⁻¹ mol⁻¹).
const GAS_CM3_PA: f64 = 8.314_462_618e6;

/// `f/p = exp((B(T) + 2 (1 - x)² δ(T)) P / (R T))`, dimensionless, about 0.996; the mole fraction x of CO2 in air is taken for 0.
///
/// - `sst_k`: temperature, K; `pressure_pa`: of all the air, Pa
///
/// Source: Weiss (1974), doi:10.1016/0304-4203(74)90015-2, eq. 6, 9 and 11 (B and δ in cm³ mol⁻¹).
pub fn coefficient_weiss1974(sst_k: f64, pressure_pa: f64) -> f64 {
    let t = sst_k;
    let b = -1636.75 + t * (12.0408 - t * (0.032_795_7 - t * 3.165_28e-5));
    let delta = 57.7 - 0.118 * t;
    ((b + 2.0 * delta) * pressure_pa / (GAS_CM3_PA * t)).exp()
}

/// Fugacity of a partial pressure of CO2, Pa. See [`coefficient_weiss1974`].
pub fn of_partial_pressure(pco2_pa: f64, sst_k: f64, pressure_pa: f64) -> f64 {
    pco2_pa * coefficient_weiss1974(sst_k, pressure_pa)
}

/// Partial pressure of a fugacity of CO2, Pa. See [`coefficient_weiss1974`].
pub fn to_partial_pressure(fco2_pa: f64, sst_k: f64, pressure_pa: f64) -> f64 {
    fco2_pa / coefficient_weiss1974(sst_k, pressure_pa)
}

/// Fugacity coefficient at one atmosphere.
pub fn at_one_atmosphere(sst_k: f64) -> f64 {
    coefficient_weiss1974(sst_k, ATMOSPHERE_PA)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `PyCO2SYS` 1.8.3.4, its `fugacity_factor` at one atmosphere; its gas constant is an older one.
    #[test]
    fn it_is_that_of_another_program() {
        for (sst_k, factor) in [
            (273.15, 0.995_606_040_313_540_5),
            (283.15, 0.996_150_122_009_494_5),
            (298.15, 0.996_810_440_544_739),
            (303.15, 0.996_996_875_078_588),
        ] {
            let ours = at_one_atmosphere(sst_k);
            assert!((ours - factor).abs() < 1e-7, "{ours} {factor}");
        }
    }

    #[test]
    fn there_and_back_is_the_same_and_thin_air_is_nearly_ideal() {
        let f = of_partial_pressure(40.0, 290.0, 100_000.0);
        assert!(f < 40.0);
        assert!((to_partial_pressure(f, 290.0, 100_000.0) - 40.0).abs() < 1e-12);
        assert!((coefficient_weiss1974(290.0, 100.0) - 1.0).abs() < 1e-5);
    }
}
