//! Colours as the eye takes them in: sRGB to opponent colours, blurred as far as the eye cannot resolve them, and the
//! distance of two colours.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::PIXELS_PER_DEGREE;
use super::window::{Plane, weights};

/// Weight and width of the bells that make up the eye's sensitivity in each of lightness, red-green and blue-yellow.
///
/// Source: Andersson et al. (2020), table 1, after Johnson and Fairchild (2003).
const BELLS: [&[(f64, f64)]; 3] = [
    &[(1.0, 0.0047)],
    &[(1.0, 0.0053)],
    &[(34.1, 0.04), (13.5, 0.025)],
];
/// The widest of them, which sets the size of the windows.
const WIDEST: f64 = 0.04;

/// Linear sRGB to XYZ for the white of daylight D65, from the chromaticities of IEC 61966-2-1.
fn xyz_from_rgb() -> DMat3 {
    DMat3::from_cols(
        DVec3::new(
            10_135_552.0 / 24_577_794.0,
            2_613_072.0 / 12_288_897.0,
            1_425_312.0 / 73_733_382.0,
        ),
        DVec3::new(
            8_788_810.0 / 24_577_794.0,
            8_788_810.0 / 12_288_897.0,
            8_788_810.0 / 73_733_382.0,
        ),
        DVec3::new(
            4_435_075.0 / 24_577_794.0,
            887_015.0 / 12_288_897.0,
            70_074_185.0 / 73_733_382.0,
        ),
    )
}

fn linear(srgb: f64) -> f64 {
    if srgb <= 0.04045 {
        srgb / 12.92
    } else {
        ((srgb + 0.055) / 1.055).powf(2.4)
    }
}

/// A picture in lightness, red-green and blue-yellow (`YCxCz`), one plane each.
pub(super) struct Opponents([Plane; 3]);

impl Opponents {
    pub(super) fn of(width: usize, srgb: &[DVec3]) -> Self {
        let xyz_from_rgb = xyz_from_rgb();
        let white = xyz_from_rgb * DVec3::ONE;
        let pixels: Vec<DVec3> = srgb
            .iter()
            .map(|colour| {
                let xyz = xyz_from_rgb * DVec3::from_array(colour.to_array().map(linear)) / white;
                DVec3::new(
                    116.0 * xyz.y - 16.0,
                    500.0 * (xyz.x - xyz.y),
                    200.0 * (xyz.y - xyz.z),
                )
            })
            .collect();
        Self([0, 1, 2].map(|channel| Plane {
            width,
            values: pixels.iter().map(|pixel| pixel[channel]).collect(),
        }))
    }

    /// Lightness from 0 to 1.
    pub(super) fn lightness(&self) -> Plane {
        Plane {
            width: self.0[0].width,
            values: self.0[0]
                .values
                .iter()
                .map(|y| (y + 16.0) / 116.0)
                .collect(),
        }
    }

    /// Every pixel as the eye resolves it, in lightness and the two colour axes of L*a*b*, the latter weaker where it
    /// is dark (after Hunt).
    pub(super) fn as_seen(&self) -> Vec<DVec3> {
        let [y, x, z] = [0, 1, 2].map(|channel| blurred(&self.0[channel], BELLS[channel]));
        let xyz_from_rgb = xyz_from_rgb();
        let white = xyz_from_rgb * DVec3::ONE;
        let rgb_from_xyz = xyz_from_rgb.inverse();
        let pixels = y.into_iter().zip(x).zip(z);
        pixels
            .map(|((y, x), z)| {
                let y = (y + 16.0) / 116.0;
                let xyz = DVec3::new(y + x / 500.0, y, y - z / 200.0) * white;
                let rgb = (rgb_from_xyz * xyz).clamp(DVec3::ZERO, DVec3::ONE);
                lab(xyz_from_rgb * rgb / white)
            })
            .collect()
    }
}

fn blurred(plane: &Plane, bells: &[(f64, f64)]) -> Vec<f64> {
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as usize;
    let (mut sums, mut whole) = (vec![0.0; plane.values.len()], 0.0);
    for (weight, width) in bells {
        let bell = weights(radius, |x_px| {
            let x_deg = x_px / PIXELS_PER_DEGREE;
            (-PI * PI * x_deg * x_deg / width).exp()
        });
        let weight = weight * (PI / width).sqrt();
        whole += weight * bell.iter().sum::<f64>().powi(2);
        for (sum, own) in sums.iter_mut().zip(plane.weighed(&bell, &bell).values) {
            *sum += weight * own;
        }
    }
    sums.into_iter().map(|sum| sum / whole).collect()
}

/// L*a*b* of a colour given as shares of white's XYZ, the colour axes times a hundredth of the lightness.
fn lab(xyz: DVec3) -> DVec3 {
    const KNEE: f64 = 6.0 / 29.0;
    let root = xyz.to_array().map(|share| {
        if share > KNEE.powi(3) {
            share.cbrt()
        } else {
            share / (3.0 * KNEE * KNEE) + 4.0 / 29.0
        }
    });
    let lightness = 116.0 * root[1] - 16.0;
    DVec3::new(
        lightness,
        0.01 * lightness * 500.0 * (root[0] - root[1]),
        0.01 * lightness * 200.0 * (root[1] - root[2]),
    )
}

/// Distance of two colours: of lightness plus of the colour plane (`HyAB`), which stays right for large ones.
///
/// Source: Abasi, Tehran, Fairchild (2020), Distance metrics for very large color differences.
pub(super) fn distance(a: DVec3, b: DVec3) -> f64 {
    let apart = a - b;
    apart.x.abs() + apart.y.hypot(apart.z)
}

/// The largest distance of two colours of a screen: pure green from pure blue.
pub(super) fn largest_distance() -> f64 {
    let xyz_from_rgb = xyz_from_rgb();
    let white = xyz_from_rgb * DVec3::ONE;
    let [green, blue] = [DVec3::Y, DVec3::Z].map(|rgb| lab(xyz_from_rgb * rgb / white));
    distance(green, blue)
}
