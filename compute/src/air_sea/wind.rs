//! Means of powers of the wind where only its mean is known, or mean and spread.
//!
//! The Rayleigh distribution is that of Weibull with shape 2; over open sea shapes of 2 are usual (Wanninkhof 1992,
//! doi:10.1029/92JC00188; Wanninkhof et al. 2002, doi:10.1029/GM127p0351).

use std::f64::consts::PI;

/// Mean of U² of winds that are spread as by Rayleigh: `4/π` times the square of their mean, m² s⁻².
pub fn moment2_rayleigh(wind_m_s: f64) -> f64 {
    4.0 / PI * wind_m_s * wind_m_s
}

/// Mean of U³ of winds that are spread as by Rayleigh: `6/π` times the cube of their mean, m³ s⁻³.
pub fn moment3_rayleigh(wind_m_s: f64) -> f64 {
    6.0 / PI * wind_m_s * wind_m_s * wind_m_s
}

/// Mean of U² from mean and standard deviation, whatever the spread: `<U>² + σ²`, m² s⁻².
pub fn moment2(wind_m_s: f64, standard_deviation_m_s: f64) -> f64 {
    wind_m_s * wind_m_s + standard_deviation_m_s * standard_deviation_m_s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The density `u/s² exp(-u²/2s²)` summed by the midpoint rule.
    #[test]
    fn moments_are_the_integrals_over_the_density() {
        let scale = 5.6;
        let step = 1e-3;
        let mean_of = |power: i32| -> f64 {
            (0..80_000)
                .map(|i| (f64::from(i) + 0.5) * step)
                .map(|u| {
                    let density = u / (scale * scale) * (-u * u / (2.0 * scale * scale)).exp();
                    u.powi(power) * density * step
                })
                .sum()
        };
        let mean = mean_of(1);
        assert!((moment2_rayleigh(mean) / mean_of(2) - 1.0).abs() < 1e-6);
        assert!((moment3_rayleigh(mean) / mean_of(3) - 1.0).abs() < 1e-6);
        let deviation = (mean_of(2) - mean * mean).sqrt();
        assert!((moment2(mean, deviation) / mean_of(2) - 1.0).abs() < 1e-6);
    }
}
