//! The share of a cell's sea that gas can pass through, under ice.

/// What of the sea is open where a share of ice covers it: `1 - ice`.
pub fn open_water(ice: f64) -> f64 {
    1.0 - ice
}

/// The same with leads: ice of up to a tenth does not count, and of a closed cover a tenth is open.
///
/// Source: Takahashi et al. (2009), doi:10.1016/j.dsr2.2008.12.009 (10 % and 90 %).
pub fn open_water_takahashi2009(ice: f64) -> f64 {
    if ice.is_nan() {
        f64::NAN
    } else if ice > 0.1 {
        (1.0 - ice).max(0.1)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_is_none_and_a_closed_cover_has_leads() {
        for (ice, open) in [
            (0.0, 1.0),
            (0.1, 1.0),
            (0.15, 0.85),
            (0.5, 0.5),
            (0.95, 0.1),
            (1.0, 0.1),
        ] {
            assert!(
                (open_water_takahashi2009(ice) - open).abs() < 1e-12,
                "{ice}"
            );
        }
        assert!(open_water_takahashi2009(f64::NAN).is_nan());
        assert!((open_water(0.3) - 0.7).abs() < 1e-12);
    }
}
