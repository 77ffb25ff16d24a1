//! What the gaps of a step would be: sea without data, at the mean of the sea with data beside it.

use super::bands::{BAND_COUNT, BandSum};
use super::fixed::{AREA_DECIMALS, MASS_DECIMALS};

/// What an answer says about its estimates.
pub const BASIS: &str = "sea without data at the mean flux of the region's sea with data in the same 5 degrees of latitude \
                         and the same step";

/// The estimate for one step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Gap {
    /// Mass that would leave the sea through the gaps, kg.
    pub mass_kg: f64,
    /// Area of the gaps that it stands for, m². Bands without any data have no estimate.
    pub area_m2: f64,
}

/// The gap of a step: `sea_steps` is the area of all sea of the region on the grid in every band, m² in steps of 10⁻⁶.
///
/// Nothing of it is exact, and nothing of it is ever added to a budget.
pub fn gap(sea_steps: &[i128; BAND_COUNT], held: &[BandSum]) -> Gap {
    let mut gap = Gap::default();
    for sum in held.iter().filter(|sum| sum.area_steps > 0) {
        let missing_steps = sea_steps[sum.band] - sum.area_steps;
        if missing_steps > 0 {
            let share = missing_steps as f64 / sum.area_steps as f64;
            gap.mass_kg += share * sum.mass_steps as f64 / 10f64.powi(MASS_DECIMALS as i32);
            gap.area_m2 += missing_steps as f64 / 10f64.powi(AREA_DECIMALS as i32);
        }
    }
    gap
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_hold_the_mean_of_their_own_band() {
        let m2 = 10i128.pow(AREA_DECIMALS);
        let kg = 10i128.pow(MASS_DECIMALS);
        let mut sea = [0; BAND_COUNT];
        (sea[3], sea[4], sea[5]) = (400 * m2, 100 * m2, 50 * m2);
        let held = |band, mass: i128, area: i128| BandSum {
            band,
            mass_steps: mass * kg,
            area_steps: area * m2,
        };
        // A quarter of one band is missing, nothing of the next, all of the third: for that there is no mean.
        let gap = gap(&sea, &[held(3, -30, 300), held(4, 70, 100)]);
        assert_eq!(
            gap,
            Gap {
                mass_kg: -10.0,
                area_m2: 100.0
            }
        );
    }
}
