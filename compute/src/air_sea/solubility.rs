//! Solubility of CO2 in sea water: how much a volume, or a mass, of it holds for each pascal of CO2's fugacity.

use super::ATMOSPHERE_PA;

/// Temperatures that it was fitted over, K.
pub const RANGE_K: [f64; 2] = [272.15, 313.15];
/// Salinities that it was fitted over.
pub const RANGE_SALINITY: [f64; 2] = [0.0, 40.0];
const LITRES_PER_M3: f64 = 1000.0;

/// `ln K0 = A1 + A2 100/T + A3 ln(T/100) + S (B1 + B2 T/100 + B3 (T/100)²)`, eq. 12 of the paper.
fn weiss1974_per_atm(sst_k: f64, salinity: f64, a: [f64; 3], b: [f64; 3]) -> f64 {
    let t = sst_k / 100.0;
    let ln = a[0] + a[1] / t + a[2] * t.ln() + salinity * (b[0] + t * (b[1] + t * b[2]));
    ln.exp()
}

/// Amount in a volume of water: mol m⁻³ Pa⁻¹.
///
/// Of fugacity, and within 0.4 % of partial pressure. -1 to 40 °C, salinity 0 to 40; 0.2 %.
/// Source: Weiss (1974), doi:10.1016/0304-4203(74)90015-2, eq. 12, table I, mol l⁻¹ atm⁻¹.
pub fn weiss1974(sst_k: f64, salinity: f64) -> f64 {
    const A: [f64; 3] = [-58.0931, 90.5069, 22.2940];
    const B: [f64; 3] = [0.027_766, -0.025_888, 0.005_057_8];
    weiss1974_per_atm(sst_k, salinity, A, B) * LITRES_PER_M3 / ATMOSPHERE_PA
}

/// Amount in a mass of water: mol kg⁻¹ Pa⁻¹.
///
/// It is 2 to 3 % less than [`weiss1974`] by the litre: the density of sea water lies between them.
/// Source: Weiss (1974), doi:10.1016/0304-4203(74)90015-2, eq. 12, table I, mol kg⁻¹ atm⁻¹.
pub fn weiss1974_mass(sst_k: f64, salinity: f64) -> f64 {
    const A: [f64; 3] = [-60.2409, 93.4517, 23.3585];
    const B: [f64; 3] = [0.023_517, -0.023_656, 0.004_703_6];
    weiss1974_per_atm(sst_k, salinity, A, B) / ATMOSPHERE_PA
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of `PyCO2SYS` 1.8.3.4, `sys(...)["k_CO2"]`, mol kg⁻¹ atm⁻¹; at 25 °C and 35 also the check value of Dickson et al. (2007),
    /// Guide to best practices, chapter 5: ln K0 = -3.5617.
    #[test]
    fn by_mass_it_is_that_of_others() {
        let theirs = [
            (273.15, 35.0, 0.062_870_124_276_295_83),
            (283.15, 33.0, 0.044_387_205_392_657_74),
            (298.15, 35.0, 0.028_391_881_804_015_7),
            (293.15, 0.001, 0.039_162_016_561_275_374),
            (303.15, 38.0, 0.024_798_816_618_943_54),
        ];
        for (sst_k, salinity, per_atm) in theirs {
            let ours = weiss1974_mass(sst_k, salinity) * ATMOSPHERE_PA;
            assert!((ours / per_atm - 1.0).abs() < 1e-12, "{ours} {per_atm}");
        }
        let ln = (weiss1974_mass(298.15, 35.0) * ATMOSPHERE_PA).ln();
        assert!((ln - -3.5617).abs() < 5e-5, "{ln}");
    }

    /// Density of sea water at one atmosphere, kg l⁻¹, by the equation of state of 1980 (Fofonoff and Millard 1983, UNESCO
    /// technical papers in marine science 44: 1023.343 kg m⁻³ at 25 °C and 35, 1028.106 at 0 °C).
    #[test]
    fn by_volume_it_is_that_by_mass_times_the_density() {
        for (sst_k, density) in [(298.15, 1.023_343), (273.15, 1.028_106)] {
            let ratio = weiss1974(sst_k, 35.0) / weiss1974_mass(sst_k, 35.0) / LITRES_PER_M3;
            // The two fits of the paper were made apart.
            assert!((ratio / density - 1.0).abs() < 5e-4, "{ratio} {density}");
        }
    }

    /// FluxEngine 4.2.1, `core/fe_core.py`, `solubility_Wanninkhof2014` of CO2, mol l⁻¹ atm⁻¹.
    #[test]
    fn by_volume_it_is_that_of_another_program() {
        for (sst_k, salinity, per_atm) in [
            (273.15, 35.0, 0.064_647_129_599_426_45),
            (283.15, 33.0, 0.045_520_857_551_612_92),
            (298.15, 35.0, 0.029_058_930_310_620_932),
            (303.15, 38.0, 0.025_397_221_939_415_41),
            (293.15, 0.0, 0.039_098_765_313_060_16),
        ] {
            let ours = weiss1974(sst_k, salinity) * ATMOSPHERE_PA / LITRES_PER_M3;
            assert!((ours / per_atm - 1.0).abs() < 1e-12, "{ours} {per_atm}");
        }
    }
}
