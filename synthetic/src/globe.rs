//! The flux and clouds of the whole sea, without a coast: whoever makes a map knows where land is.
//!
//! Source along the equator, strongest in the east of the Pacific; sinks of the middle latitudes, stronger in their winter;
//! a weak source of the Southern Ocean in winter; eddies everywhere. Magnitudes are of the order that is published
//! (a few mmol m⁻² d⁻¹); no value here is a measurement.

use std::f64::consts::{PI, TAU};

use crate::noise::Noise;

/// Waves of the longest eddies round the earth's radius: some 600 km.
const EDDIES_PER_RADIUS: f64 = 10.0;
/// The same of banks of cloud: some 2000 km.
const CLOUDS_PER_RADIUS: f64 = 3.0;
/// Octaves of both.
const OCTAVES: u32 = 5;
/// How far the field of noise moves in a month, in waves: from month to month half of an eddy is left.
const DRIFT_PER_MONTH: f64 = 0.5;
/// Clouds of a month are others than those of the month before.
const CLOUD_DRIFT_PER_MONTH: f64 = 7.0;

/// Flux of CO2 at a place, degrees, in a month (0 for a January), mmol m⁻² d⁻¹, positive out of the sea.
pub fn flux_mmol_m2_d(lon: f64, lat: f64, month: usize, noise: Noise) -> f64 {
    let drift = month as f64 * DRIFT_PER_MONTH;
    let strength = 1.5 + 1.5 * bell(lat.abs(), 42.0, 14.0);
    mean_mmol_m2_d(lon, lat, month)
        + strength * on_sphere(lon, lat, EDDIES_PER_RADIUS, drift, noise)
}

/// The same without eddies.
fn mean_mmol_m2_d(lon: f64, lat: f64, month: usize) -> f64 {
    // 1 in the middle of the northern winter, 0 in that of the northern summer.
    let northern = 0.5 + 0.5 * (2.0 * PI * (month % 12) as f64 / 12.0 - PI / 6.0).cos();
    let winter = if lat >= 0.0 { northern } else { 1.0 - northern };
    let east_pacific = bell(from_meridian(lon, -110.0), 0.0, 45.0);
    let equator = (1.2 + 3.0 * east_pacific) * bell(lat, 0.0, 8.0);
    let middle = -(1.5 + 3.5 * winter) * bell(lat.abs(), 42.0, 13.0);
    let southern = (0.5 + 1.5 * winter) * bell(lat, -62.0, 5.0);
    equator + middle + southern
}

/// How cloudy a place is in a month, without unit; only its order matters.
pub fn cloudiness(lon: f64, lat: f64, month: usize, noise: Noise) -> f32 {
    let drift = 1000.0 + month as f64 * CLOUD_DRIFT_PER_MONTH;
    on_sphere(lon, lat, CLOUDS_PER_RADIUS, drift, noise) as f32
}

/// Noise over the sphere: without a seam at the date line or a pole. `drift` moves the sphere through the noise.
fn on_sphere(lon: f64, lat: f64, waves: f64, drift: f64, noise: Noise) -> f64 {
    let ((sin_lon, cos_lon), (sin_lat, cos_lat)) =
        (lon.to_radians().sin_cos(), lat.to_radians().sin_cos());
    noise.fractal(
        waves * cos_lat * cos_lon,
        waves * cos_lat * sin_lon,
        waves * sin_lat + drift,
        OCTAVES,
    )
}

/// 1 at the middle, 1/e a width away from it.
fn bell(at: f64, middle: f64, width: f64) -> f64 {
    (-((at - middle) / width).powi(2)).exp()
}

/// Degrees of longitude from a meridian, 0 to 180.
fn from_meridian(lon: f64, meridian: f64) -> f64 {
    let around = (lon - meridian).to_radians().rem_euclid(TAU);
    around.min(TAU - around).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_equator_gives_off_and_the_middle_latitudes_take_up_in_their_winter() {
        let noise = Noise::new(1);
        let mean = |lat: f64, month| {
            let round = (0..360).map(|lon| flux_mmol_m2_d(f64::from(lon), lat, month, noise));
            round.sum::<f64>() / 360.0
        };
        assert!(mean(0.0, 3) > 1.0);
        assert!(mean(42.0, 1) < -4.0 && mean(-42.0, 7) < -4.0);
        assert!(mean(42.0, 7) > mean(42.0, 1) + 2.0);
        assert!(mean(-42.0, 1) > mean(-42.0, 7) + 2.0);
    }

    #[test]
    fn there_is_no_seam_at_the_date_line_or_a_pole() {
        let noise = Noise::new(1);
        for lat in [-70.0, 0.0, 55.0] {
            let [west, east] = [-180.0, 180.0].map(|lon| flux_mmol_m2_d(lon, lat, 5, noise));
            assert!((west - east).abs() < 1e-9, "{lat}");
        }
        let pole = |lon| flux_mmol_m2_d(lon, 90.0, 5, noise);
        // The mean knows meridians, but not at a pole's latitude.
        assert!((pole(0.0) - pole(137.0)).abs() < 1e-9);
    }
}
