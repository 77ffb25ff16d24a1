//! How far two pictures are apart: two pictures in, decibels, levels, pixels and FLIP out.

use glam::DVec3;
use render::Image;
use serde::Serialize;

use super::flip::{self, Screen};
use super::reference::Picture;

/// What lies behind translucent pictures when they are seen: the dark sea of the globe.
const BACKGROUND: [f64; 3] = [0.035, 0.075, 0.14];

/// Measures of two pictures of one size, over premultiplied colours and alpha.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Difference {
    /// Peak signal-to-noise ratio, decibels; none for equal pictures.
    pub psnr_db: Option<f64>,
    /// Mean FLIP over the dark sea, 0 to 1.
    pub mean_flip: f64,
    /// Largest difference of a channel, levels of 8 bits.
    pub most_levels: f64,
    /// Pixels no channel of which differs by more than a level, of a hundred.
    pub within_one_level_percent: f64,
}

impl Difference {
    /// Measures; none for pictures of two sizes, or of none.
    pub fn of(a: &Picture, b: &Picture) -> Option<Self> {
        if (a.width, a.height) != (b.width, b.height) || a.rgba.is_empty() {
            return None;
        }
        let (mut squares, mut most, mut within) = (0.0, 0.0, 0usize);
        for (a, b) in a.rgba.iter().zip(&b.rgba) {
            let apart = [0, 1, 2, 3].map(|i| (a[i] - b[i]).abs());
            squares += apart.iter().map(|d| d * d).sum::<f64>();
            let levels = 255.0 * apart.into_iter().fold(0.0, f64::max);
            most = f64::max(most, levels);
            // Bytes divided by 255 and multiplied again are whole only nearly.
            within += usize::from(levels <= 1.0 + 1e-9);
        }
        let mean_square = squares / (4 * a.rgba.len()) as f64;
        let [one, other] = [a, b].map(over_the_sea);
        let [one, other] = [&one, &other].map(|srgb| Screen {
            width: a.width as usize,
            srgb,
        });
        Some(Self {
            psnr_db: (mean_square > 0.0).then(|| -10.0 * mean_square.log10()),
            mean_flip: flip::mean(&one, &other),
            most_levels: most,
            within_one_level_percent: 100.0 * within as f64 / a.rgba.len() as f64,
        })
    }
}

/// Bytes of two pictures that differ.
pub fn differing_bytes(a: &Image, b: &Image) -> usize {
    let common = a.rgba8.iter().zip(&b.rgba8);
    common.filter(|(a, b)| a != b).count() + a.rgba8.len().abs_diff(b.rgba8.len())
}

fn over_the_sea(picture: &Picture) -> Vec<DVec3> {
    let sea = DVec3::from_array(BACKGROUND);
    let pixels = picture.rgba.iter();
    pixels
        .map(|&[r, g, b, alpha]| {
            (DVec3::new(r, g, b) + sea * (1.0 - alpha)).clamp(DVec3::ZERO, DVec3::ONE)
        })
        .collect()
}
