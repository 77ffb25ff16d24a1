//! Schmidt number of CO2 in sea water of salinity 35: viscosity over diffusivity, dimensionless.

use super::ZERO_CELSIUS_K;

/// Degrees that [`wanninkhof1992`] was fitted over, K.
pub const RANGE_1992_K: [f64; 2] = [273.15, 303.15];
/// Degrees that [`wanninkhof2014`] was fitted over, K.
pub const RANGE_2014_K: [f64; 2] = [271.15, 313.15];

/// Cubic fit from 0 to 30 °C.
///
/// Source: Wanninkhof (1992), doi:10.1029/92JC00188, table A1, sea water.
pub fn wanninkhof1992(sst_k: f64) -> f64 {
    let t = sst_k - ZERO_CELSIUS_K;
    2073.1 - t * (125.62 - t * (3.6276 - t * 0.043_219))
}

/// Quartic fit from -2 to 40 °C.
///
/// Source: Wanninkhof (2014), doi:10.4319/lom.2014.12.351, table 1, sea water.
pub fn wanninkhof2014(sst_k: f64) -> f64 {
    let t = sst_k - ZERO_CELSIUS_K;
    2116.8 - t * (136.25 - t * (4.7353 - t * (0.092_307 - t * 0.000_755_5)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 1 of Wanninkhof (2014) prints 668 for 20 °C; the text of both papers 660.
    #[test]
    fn at_twenty_degrees_they_have_the_printed_value() {
        assert_eq!(wanninkhof2014(293.15).round() as i32, 668);
        assert!((wanninkhof1992(293.15) / 660.0 - 1.0).abs() < 0.01);
    }

    #[test]
    fn both_fits_agree_where_both_hold_and_warm_water_has_less() {
        for celsius in 0..=30 {
            let sst_k = f64::from(celsius) + ZERO_CELSIUS_K;
            let (old, new) = (wanninkhof1992(sst_k), wanninkhof2014(sst_k));
            assert!((old / new - 1.0).abs() < 0.035, "{celsius} {old} {new}");
            assert!(wanninkhof2014(sst_k + 1.0) < new);
        }
        assert!(wanninkhof2014(f64::NAN).is_nan());
    }

    /// FluxEngine 4.2.1, `core/fe_core.py`, `schmidt_Wanninkhof1992` and `schmidt_Wanninkhof2014` of CO2, °C.
    #[test]
    fn they_are_those_of_another_program() {
        for (celsius, old, new) in [
            (0.0, 2073.1, 2116.8),
            (5.0, 1_530.287_625_000_000_2, 1_542.866_312_5),
            (10.0, 1_136.440_999_999_999_8, 1_143.078_000_000_000_2),
            (20.0, 665.987_999_999_999_8, 668.344),
            (25.0, 524.553_124_999_999_9, 522.932_812_499_999_7),
            (30.0, 402.426_999_999_999_7, 410.735_999_999_999_54),
        ] {
            let sst_k = celsius + ZERO_CELSIUS_K;
            let (ours_1992, ours_2014) = (wanninkhof1992(sst_k), wanninkhof2014(sst_k));
            assert!(
                (ours_1992 / old - 1.0).abs() < 1e-12,
                "{celsius} {ours_1992}"
            );
            assert!(
                (ours_2014 / new - 1.0).abs() < 1e-12,
                "{celsius} {ours_2014}"
            );
        }
    }
}
