//! Gas-transfer velocity of CO2 from wind at 10 m, m s⁻¹.
//!
//! Arguments are *means of powers* of the wind, not powers of the mean: over a month the mean of U² is a quarter more than
//! the square of mean U ([`super::wind`]). `schmidt` is that of CO2 at the temperature of the water, dimensionless.

/// One cm h⁻¹, which the papers use, in m s⁻¹.
const CM_H: f64 = 0.01 / 3600.0;
/// Schmidt number of CO2 at 20 °C in sea water.
const SEA_20: f64 = 660.0;
/// The same in fresh water.
const FRESH_20: f64 = 600.0;

/// `coefficient_cm_h · (Sc / reference)^-½`
fn scaled(cm_h: f64, schmidt: f64, reference: f64) -> f64 {
    cm_h * CM_H * (reference / schmidt).sqrt()
}

/// `k = 0.251 <U²> (Sc/660)^-½`, from the inventory of bomb radiocarbon.
///
/// Uncertainty 20 %; meant for U of 4 to 15 m s⁻¹. Source: Wanninkhof (2014), doi:10.4319/lom.2014.12.351, eq. 4.
pub fn wanninkhof2014(wind_moment2_m2_s2: f64, schmidt: f64) -> f64 {
    scaled(0.251 * wind_moment2_m2_s2, schmidt, SEA_20)
}

/// `k = 0.31 <U²> (Sc/660)^-½`, for steady winds.
///
/// For long-term mean speeds the paper has 0.39 times the square of the mean, which holds the second moment of a
/// Rayleigh distribution in it. Source: Wanninkhof (1992), doi:10.1029/92JC00188, eq. 3.
pub fn wanninkhof1992(wind_moment2_m2_s2: f64, schmidt: f64) -> f64 {
    scaled(0.31 * wind_moment2_m2_s2, schmidt, SEA_20)
}

/// `k = 0.0283 <U³> (Sc/660)^-½`, short-term winds.
///
/// Source: Wanninkhof and `McGillis` (1999), doi:10.1029/1999GL900363.
pub fn wanninkhof_mcgillis1999(wind_moment3_m3_s3: f64, schmidt: f64) -> f64 {
    scaled(0.0283 * wind_moment3_m3_s3, schmidt, SEA_20)
}

/// `k = (0.222 <U²> + 0.333 <U>) (Sc/600)^-½`, from two tracers in the North Sea.
///
/// Source: Nightingale et al. (2000), doi:10.1029/1999GB900091.
pub fn nightingale2000(wind_m_s: f64, wind_moment2_m2_s2: f64, schmidt: f64) -> f64 {
    scaled(
        0.222 * wind_moment2_m2_s2 + 0.333 * wind_m_s,
        schmidt,
        FRESH_20,
    )
}

/// `k = (3.3 + 0.026 <U³>) (Sc/660)^-½`, from eddy covariance (GasEx-98).
///
/// Source: `McGillis` et al. (2001), doi:10.1029/2000JC000506.
pub fn mcgillis2001(wind_moment3_m3_s3: f64, schmidt: f64) -> f64 {
    scaled(3.3 + 0.026 * wind_moment3_m3_s3, schmidt, SEA_20)
}

/// `k = 0.266 <U²> (Sc/600)^-½`, from two tracers in the Southern Ocean (SAGE).
///
/// Source: Ho et al. (2006), doi:10.1029/2006GL026817.
pub fn ho2006(wind_moment2_m2_s2: f64, schmidt: f64) -> f64 {
    scaled(0.266 * wind_moment2_m2_s2, schmidt, FRESH_20)
}

/// `k = 0.27 <U²> (Sc/660)^-½`, from the inventory of bomb radiocarbon, revised.
///
/// Source: Sweeney et al. (2007), doi:10.1029/2006GB002784.
pub fn sweeney2007(wind_moment2_m2_s2: f64, schmidt: f64) -> f64 {
    scaled(0.27 * wind_moment2_m2_s2, schmidt, SEA_20)
}

/// `k = 0.26 <U²> (Sc/660)^-½`, scaled to Sweeney's radiocarbon with the winds of NCEP/DOE.
///
/// Source: Takahashi et al. (2009), doi:10.1016/j.dsr2.2008.12.009.
pub fn takahashi2009(wind_moment2_m2_s2: f64, schmidt: f64) -> f64 {
    scaled(0.26 * wind_moment2_m2_s2, schmidt, SEA_20)
}

/// `k = (3 + 0.1 <U> + 0.064 <U²> + 0.011 <U³>) (Sc/660)^-½`.
///
/// Source: Wanninkhof et al. (2009), doi:10.1146/annurev.marine.010908.163742, eq. 37.
pub fn wanninkhof2009(
    wind_m_s: f64,
    wind_moment2_m2_s2: f64,
    wind_moment3_m3_s3: f64,
    schmidt: f64,
) -> f64 {
    let cm_h = 3.0 + 0.1 * wind_m_s + 0.064 * wind_moment2_m2_s2 + 0.011 * wind_moment3_m3_s3;
    scaled(cm_h, schmidt, SEA_20)
}

/// Three straight lines: `0.17 U (Sc/600)^-⅔` to 3.6 m s⁻¹, `(2.85 U - 9.65) (Sc/600)^-½` to 13, `(5.9 U - 49.3) (Sc/600)^-½` above.
///
/// Of winds at an instant: it is not linear, so that the mean of k over varying winds is not k of their mean.
/// Source: Liss and Merlivat (1986, of a meeting of 1983), doi:10.1007/978-94-009-4738-2_5.
pub fn liss_merlivat1986(wind_m_s: f64, schmidt: f64) -> f64 {
    /// Where a smooth surface becomes a rough one, m s⁻¹.
    const ROUGH_M_S: f64 = 3.6;
    /// Where waves begin to break, m s⁻¹.
    const BREAKING_M_S: f64 = 13.0;
    if wind_m_s <= ROUGH_M_S {
        0.17 * wind_m_s * CM_H * (FRESH_20 / schmidt).powf(2.0 / 3.0)
    } else if wind_m_s <= BREAKING_M_S {
        scaled(2.85 * wind_m_s - 9.65, schmidt, FRESH_20)
    } else {
        scaled(5.9 * wind_m_s - 49.3, schmidt, FRESH_20)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn is(k_m_s: f64, cm_h: f64) {
        assert!(
            (k_m_s * 3.6e5 - cm_h).abs() < 1e-9,
            "{} {cm_h}",
            k_m_s * 3.6e5
        );
    }

    /// Values by hand, in the units of the papers, of a steady wind of 7 m s⁻¹ and where Sc is that of the paper.
    #[test]
    fn of_seven_metres_a_second() {
        let (u, u2, u3) = (7.0, 49.0, 343.0);
        is(wanninkhof2014(u2, 660.0), 12.299);
        is(wanninkhof1992(u2, 660.0), 15.19);
        is(wanninkhof_mcgillis1999(u3, 660.0), 9.7069);
        is(nightingale2000(u, u2, 600.0), 13.209);
        is(mcgillis2001(u3, 660.0), 12.218);
        is(ho2006(u2, 600.0), 13.034);
        is(sweeney2007(u2, 660.0), 13.23);
        is(takahashi2009(u2, 660.0), 12.74);
        is(wanninkhof2009(u, u2, u3, 660.0), 10.609);
        is(liss_merlivat1986(u, 600.0), 10.3);
        is(liss_merlivat1986(3.0, 600.0), 0.51);
        is(liss_merlivat1986(15.0, 600.0), 39.2);
    }

    /// At 70 m² s⁻², about the mean of the world's ocean; Wanninkhof (2014) states 20 % for its own.
    #[test]
    fn the_quadratic_ones_agree_within_their_uncertainty_of_a_fifth() {
        let middle = wanninkhof2014(70.0, 660.0);
        for k in [
            ho2006(70.0, 660.0),
            sweeney2007(70.0, 660.0),
            takahashi2009(70.0, 660.0),
            nightingale2000(7.4, 70.0, 660.0),
        ] {
            assert!((k / middle - 1.0).abs() < 0.2, "{k} {middle}");
        }
    }

    #[test]
    fn four_times_the_schmidt_number_is_half_the_velocity_and_less_where_the_surface_is_smooth() {
        is(wanninkhof2014(49.0, 4.0 * 660.0), 12.299 / 2.0);
        is(liss_merlivat1986(3.0, 8.0 * 600.0), 0.51 / 4.0);
        assert!(nightingale2000(f64::NAN, 49.0, 660.0).is_nan());
        assert!(liss_merlivat1986(f64::NAN, 660.0).is_nan());
    }

    /// FluxEngine 4.2.1, `core/rate_parameterisation.py`, `k_Wanninkhof2014` and the like at a Schmidt number that none is scaled to;
    /// 2009 of Takahashi by its `k_generic` with the coefficients of its `takahashi09_verification.conf`. A steady wind of 12 m s⁻¹.
    #[test]
    fn at_another_schmidt_number_they_are_those_of_another_program() {
        let (u, u2, u3) = (12.0, 144.0, 1728.0);
        is(wanninkhof2014(u2, 1000.0), 29.363_524_409_716_213);
        is(wanninkhof1992(u2, 1000.0), 36.265_707_438_294_925);
        is(nightingale2000(u, u2, 1000.0), 27.857_594_612_600_707);
        is(mcgillis2001(u3, 1000.0), 39.180_612_417_878_31);
        is(ho2006(u2, 1000.0), 29.670_150_818_625_782);
        is(takahashi2009(u2, 1000.0), 30.416_399_786_957_033);
    }

    /// `pyseaflux` 2.2.1, `gas_transfer_velocity.py`, `k_Sw07` and the like of 7 m s⁻¹ at 20 °C, where its Schmidt number is 668.344.
    #[test]
    fn those_that_one_program_lacks_are_those_of_a_second() {
        let (u, u2, u3, schmidt) = (7.0, 49.0, 343.0, 668.344);
        is(sweeney2007(u2, schmidt), 13.147_155_061_893_306);
        is(wanninkhof2009(u, u2, u3, schmidt), 10.542_567_502_012_554);
        // It takes 600 for the paper's Schmidt number of 660.
        let at_600 = 9.197_211_082_751_176;
        is(
            wanninkhof_mcgillis1999(u3, schmidt),
            at_600 * (660.0f64 / 600.0).sqrt(),
        );
    }

    /// `pyseaflux` 2.2.1, `k_Li86`, of 3 m s⁻¹ at 0 °C, 7 at 10 °C and 15 at 30 °C. It writes the upper two lines `2.8 (U - 3.4)` and
    /// `5.9 (U - 8.4)`, ours are `2.85 (U - 3.386)` and `5.9 (U - 8.356)`: 2.2 and 0.7 percent more.
    #[test]
    fn liss_and_merlivat_are_near_those_of_another_program() {
        is(liss_merlivat1986(3.0, 2116.8), 0.220_065_075_488_680_57);
        let rough = liss_merlivat1986(7.0, 1143.078) / CM_H / 7.302_948_266_791_492;
        let breaking = liss_merlivat1986(15.0, 410.736) / CM_H / 47.064_146_548_961_716;
        // By hand, of the two lines alone: 10.3 / 10.08 and 39.2 / 38.94.
        assert!((rough - 10.3 / 10.08).abs() < 1e-9, "{rough}");
        assert!((breaking - 39.2 / 38.94).abs() < 1e-9, "{breaking}");
    }
}
