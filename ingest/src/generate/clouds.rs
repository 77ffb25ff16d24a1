//! How cloudy a place must be to be under a cloud, from the share of the sea that clouds cover.

use std::f64::consts::PI;

/// Share of the sea under cloud, averaged over the year.
pub(super) const CLOUD_SHARE: f64 = 0.2;

/// The cloudiness that the share of a month is above; cloudier in the northern winter and at the onset of the monsoon.
/// `of_sea` are cloudinesses of places at sea.
pub(super) fn threshold(mut of_sea: Vec<f32>, month: usize) -> f32 {
    let season = (2.0 * PI * (month as f64 - 0.5) / 6.0).cos();
    let share = CLOUD_SHARE * (1.0 + 0.3 * season);
    if of_sea.is_empty() {
        return f32::INFINITY;
    }
    let index = (((1.0 - share) * of_sea.len() as f64) as usize).min(of_sea.len() - 1);
    *of_sea.select_nth_unstable_by(index, f32::total_cmp).1
}
