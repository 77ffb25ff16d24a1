//! FLIP: how large people find the difference of two pictures when one takes the place of the other, 0 to 1 a pixel.
//!
//! Source: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild (2020), FLIP: A Difference Evaluator for
//! Alternating Images, doi:10.1145/3406183, with its erratum (luminance is divided by 116). Pictures are opaque sRGB.

mod colour;
mod features;
mod window;

use glam::DVec3;

use colour::Opponents;

/// Pixels in a degree of the eye's view: 0.7 m before a screen of 3840 pixels on 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 / 0.7 * 0.7 * std::f64::consts::PI / 180.0;

/// Exponent that compresses distances of colours.
const COLOUR_EXPONENT: f64 = 0.7;
/// Distances below this share of the largest ...
const LOW_SHARE: f64 = 0.4;
/// ... take up this share of the scale: large differences are all alike.
const LOW_SCALE: f64 = 0.95;
/// Exponent that stretches differences of features.
const FEATURE_EXPONENT: f64 = 0.5;

/// What is seen at every pixel: row by row, sRGB values 0 to 1.
pub struct Screen<'a> {
    /// Pixels across.
    pub width: usize,
    /// Colours.
    pub srgb: &'a [DVec3],
}

/// FLIP of every pixel; their mean is the one number to give, as its authors advise.
///
/// # Panics
/// Never for two pictures of one size, whole rows each; the caller compares sizes.
pub fn flip(a: &Screen<'_>, b: &Screen<'_>) -> Vec<f64> {
    assert_eq!(
        (a.width, a.srgb.len()),
        (b.width, b.srgb.len()),
        "pictures of one size"
    );
    let [one, other] = [a, b].map(|screen| Opponents::of(screen.width, screen.srgb));
    let features = features::difference(&one.lightness(), &other.lightness());
    let [one, other] = [one, other].map(|opponents| opponents.as_seen());
    let largest = colour::largest_distance().powf(COLOUR_EXPONENT);
    let pixels = one.iter().zip(&other).zip(features);
    pixels
        .map(|((one, other), feature)| {
            let power = colour::distance(*one, *other).powf(COLOUR_EXPONENT);
            scaled(power, largest).powf(1.0 - feature.powf(FEATURE_EXPONENT))
        })
        .collect()
}

/// A compressed distance on a scale from 0 to 1.
fn scaled(power: f64, largest: f64) -> f64 {
    let low = LOW_SHARE * largest;
    if power < low {
        power / low * LOW_SCALE
    } else {
        LOW_SCALE + (power - low) / (largest - low) * (1.0 - LOW_SCALE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [96, 64];

    fn screen(colour: impl Fn(u32, u32) -> [u32; 3]) -> Vec<DVec3> {
        let [width, height] = SIZE;
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        places
            .map(|(x, y)| DVec3::from_array(colour(x, y).map(|byte| f64::from(byte) / 255.0)))
            .collect()
    }

    fn pattern(x: u32, y: u32) -> [u32; 3] {
        [x * 5 % 256, (y * 7 + x) % 256, x * y % 256]
    }

    fn noisy(x: u32, y: u32) -> [u32; 3] {
        let [r, g, b] = pattern(x, y);
        [
            (r + (x * 37 + y * 11) % 23).min(255),
            g.saturating_sub((x * 13 + y * 29) % 31),
            b,
        ]
    }

    fn edge(at: u32) -> impl Fn(u32, u32) -> [u32; 3] {
        move |x, _| if x < at { [200, 60, 40] } else { [30, 90, 160] }
    }

    fn measured(a: &[DVec3], b: &[DVec3]) -> (f64, f64, f64) {
        let [a, b] = [a, b].map(|srgb| Screen {
            width: SIZE[0] as usize,
            srgb,
        });
        let pixels = flip(&a, &b);
        let most = pixels.iter().copied().fold(0.0, f64::max);
        let mean = pixels.iter().sum::<f64>() / pixels.len() as f64;
        (mean, most, pixels[30 * 96 + 40])
    }

    /// The values are those of the authors' own program, `flip-evaluator` 1.7, for the same pictures; it computes in
    /// single precision.
    #[test]
    fn values_agree_with_the_program_of_the_authors() {
        let flat = |_, _| [90, 120, 200];
        let dot = move |x, y| {
            if (x, y) == (40, 30) {
                [255; 3]
            } else {
                flat(x, y)
            }
        };
        let cases = [
            (
                screen(pattern),
                screen(noisy),
                [0.30705556, 0.49581453, 0.43833898],
            ),
            (
                screen(flat),
                screen(dot),
                [0.00111858, 0.42225480, 0.42225480],
            ),
            (
                screen(|_, _| [0; 3]),
                screen(|_, _| [255; 3]),
                [0.96732521, 0.96738833, 0.96738833],
            ),
            (
                screen(edge(48)),
                screen(edge(49)),
                [0.02391273, 0.33468086, 0.02894138],
            ),
            (
                screen(edge(48)),
                screen(edge(52)),
                [0.06335804, 0.71011233, 0.03942814],
            ),
        ];
        for (i, (a, b, expected)) in cases.into_iter().enumerate() {
            let (mean, most, one) = measured(&a, &b);
            for (found, expected) in [mean, most, one].into_iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 2e-4,
                    "pair {i}: {found} against {expected}"
                );
            }
        }
    }

    #[test]
    fn a_picture_does_not_differ_from_itself_and_order_does_not_matter() {
        let (a, b) = (screen(pattern), screen(noisy));
        let (mean, most, _) = measured(&a, &a);
        assert_eq!((mean, most), (0.0, 0.0));
        assert_eq!(measured(&a, &b), measured(&b, &a));
    }
}
