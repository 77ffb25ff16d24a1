//! The cool skin of the sea: what its uppermost tenth of a millimetre is colder than the water below.
//!
//! Three temperatures are kept apart: of the skin (infrared radiometers), of the subskin (microwaves, a millimetre deep), of
//! the foundation (free of the day's warming). Gas enters at the skin and is dissolved below it (Woolf et al. 2016,
//! doi:10.1002/2015JC011427).

/// Skin less subskin temperature at night, K, negative: `-0.14 - 0.30 exp(-U/3.7)`.
///
/// 0.07 K. Source: Donlon et al. (2002), doi:10.1175/1520-0442(2002)015<0353:TIVOTS>2.0.CO;2.
pub fn donlon2002(wind_m_s: f64) -> f64 {
    -0.14 - 0.30 * (-wind_m_s / 3.7).exp()
}

/// Skin less subskin temperature in winds over 6 m s⁻¹, K: one number, which many flux products use.
///
/// Source: Donlon et al. (2002), as above: -0.17 ± 0.07 K.
pub const DONLON_2002_WINDY_K: f64 = -0.17;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_deepest_in_calm_and_nears_the_windy_value() {
        assert!((donlon2002(0.0) + 0.44).abs() < 1e-12);
        assert!((donlon2002(8.5) - DONLON_2002_WINDY_K).abs() < 0.002);
        // By hand at 3.7 m/s: -0.14 - 0.30 / e.
        assert!((donlon2002(3.7) + 0.250_363_8).abs() < 1e-6);
        // FluxEngine 4.2.1, `core/settings.xml`, `cool_skin_difference`: what it takes off where nothing else is said.
        assert!((DONLON_2002_WINDY_K + 0.17).abs() < 1e-12);
    }
}
