//! The made-up flux and clouds: a place and a month in, numbers out that follow what is known of these seas.
//!
//! Winter sink on the cold northern shelves, weak source in the warm south, sinks in the summer plumes of the great
//! rivers, sources in their mouths and in upwelling, a winter sink along the Kuroshio, and eddies. Magnitudes are of the
//! order that is published for these seas (a few mmol m⁻² d⁻¹); no value here is a measurement.

use crate::noise::Noise;

/// A patch of flux around a place.
struct Patch {
    lon: f64,
    lat: f64,
    /// Distance at which it has fallen to 1/e, degrees.
    radius_deg: f64,
    /// Strength in the middle of winter and of summer, mmol m⁻² d⁻¹.
    winter: f64,
    summer: f64,
}

const PATCHES: [Patch; 9] = [
    // Changjiang: source in the mouth, strong sink in the summer plume.
    Patch {
        lon: 121.9,
        lat: 31.2,
        radius_deg: 0.35,
        winter: 10.0,
        summer: 16.0,
    },
    Patch {
        lon: 123.2,
        lat: 31.4,
        radius_deg: 1.4,
        winter: -1.0,
        summer: -12.0,
    },
    // Huanghe.
    Patch {
        lon: 119.3,
        lat: 37.8,
        radius_deg: 0.7,
        winter: 2.0,
        summer: 4.0,
    },
    // Zhujiang (Pearl River): mouth and plume.
    Patch {
        lon: 113.7,
        lat: 22.2,
        radius_deg: 0.3,
        winter: 8.0,
        summer: 14.0,
    },
    Patch {
        lon: 114.8,
        lat: 21.5,
        radius_deg: 1.1,
        winter: -1.0,
        summer: -6.0,
    },
    // Mekong plume.
    Patch {
        lon: 107.2,
        lat: 9.4,
        radius_deg: 1.2,
        winter: -0.5,
        summer: -5.0,
    },
    // Summer upwelling off Vietnam, winter upwelling off Luzon.
    Patch {
        lon: 109.9,
        lat: 11.8,
        radius_deg: 1.3,
        winter: 0.0,
        summer: 5.0,
    },
    Patch {
        lon: 119.8,
        lat: 18.7,
        radius_deg: 1.2,
        winter: 4.0,
        summer: 0.0,
    },
    // Chao Phraya in the Gulf of Thailand.
    Patch {
        lon: 100.5,
        lat: 13.0,
        radius_deg: 0.6,
        winter: 3.0,
        summer: 6.0,
    },
];

/// The way of the Kuroshio: longitude and latitude, degrees.
const KUROSHIO: [(f64, f64); 6] = [
    (122.3, 21.0),
    (122.4, 23.5),
    (123.6, 25.6),
    (126.2, 27.6),
    (128.3, 29.6),
    (130.2, 30.2),
];

/// 1 in the middle of February, -1 in the middle of August; `month` is 0 to 11.
fn winterness(month: usize) -> f64 {
    (2.0 * std::f64::consts::PI * (month as f64 - 1.0) / 12.0).cos()
}

/// Flux of CO2 at a place, degrees, in a month (0 to 11), mmol m⁻² d⁻¹, positive out of the sea.
pub fn flux_mmol_m2_d(lon: f64, lat: f64, month: usize, noise: Noise) -> f64 {
    let winter = 0.5 * (1.0 + winterness(month));
    // Eddies live for weeks: from month to month half of each is left.
    let eddies = noise.fractal(lon / 1.6, lat / 1.6, month as f64 * 0.5, 5);
    smooth_flux_mmol_m2_d(lon, lat, month) + (3.0 + 2.0 * winter * north_of(lat)) * eddies
}

/// 0 in the tropics, 1 north of the Changjiang.
fn north_of(lat: f64) -> f64 {
    1.0 / (1.0 + (-(lat - 25.5) / 2.2).exp())
}

/// The same without eddies: what is known of a place from far around it, as where a gap under a cloud is filled.
pub fn smooth_flux_mmol_m2_d(lon: f64, lat: f64, month: usize) -> f64 {
    let winter = 0.5 * (1.0 + winterness(month));
    let summer = 1.0 - winter;
    let north = north_of(lat);
    let shelf = -7.5 * winter + 1.2 * summer;
    let basin = 0.4 * winter + 2.4 * summer + 0.6;
    let mut flux = north * shelf + (1.0 - north) * basin;
    for patch in &PATCHES {
        let dx = (lon - patch.lon) * patch.lat.to_radians().cos();
        let far = (dx * dx + (lat - patch.lat).powi(2)) / (patch.radius_deg * patch.radius_deg);
        if far < 20.0 {
            flux += (patch.winter * winter + patch.summer * summer) * (-far).exp();
        }
    }
    let stream = distance_deg(lon, lat, &KUROSHIO) / 0.8;
    flux + (-4.5 * winter + 0.8 * summer) * (-stream * stream).exp()
}

/// How cloudy a place is, without unit; only its order matters. Each month has clouds of its own.
pub fn cloudiness(lon: f64, lat: f64, month: usize, noise: Noise) -> f32 {
    // Cloud bands lie from west-south-west to east-north-east.
    let (along, across) = (0.94 * lon + 0.34 * lat, -0.34 * lon + 0.94 * lat);
    noise.fractal(
        along / 5.0 + 100.0,
        across / 3.0 + 100.0,
        1000.0 + 7.0 * month as f64,
        5,
    ) as f32
}

/// Distance from a broken line, degrees, without regard to the earth's curvature.
fn distance_deg(lon: f64, lat: f64, line: &[(f64, f64)]) -> f64 {
    let to_segment = |pair: &[(f64, f64)]| {
        let ((ax, ay), (bx, by)) = (pair[0], pair[1]);
        let (dx, dy) = (bx - ax, by - ay);
        let along = (((lon - ax) * dx + (lat - ay) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        (lon - ax - along * dx).hypot(lat - ay - along * dy)
    };
    line.windows(2)
        .map(to_segment)
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_north_takes_up_in_winter_and_the_south_gives_off_in_summer() {
        let noise = Noise::new(1);
        let mean = |lon: f64, lat: f64, month| {
            let around = (0..100).map(|i| {
                flux_mmol_m2_d(
                    lon + f64::from(i % 10) * 0.2,
                    lat + f64::from(i / 10) * 0.2,
                    month,
                    noise,
                )
            });
            around.sum::<f64>() / 100.0
        };
        assert!(mean(123.0, 34.0, 1) < -4.0, "Yellow Sea in February");
        assert!(mean(113.0, 14.0, 7) > 1.0, "South China Sea in August");
        assert!(
            mean(122.8, 31.0, 7) < -2.0,
            "plume of the Changjiang in August"
        );
        assert!(mean(123.0, 34.0, 7) > mean(123.0, 34.0, 1));
    }
}
