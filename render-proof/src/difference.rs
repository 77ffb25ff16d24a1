//! How far two pictures are apart: two pictures in, decibels, levels, pixels and FLIP out, over the whole picture and over
//! what is drawn in it.

use glam::DVec3;
use render::Image;
use serde::Serialize;

use super::flip::{self, Screen};
use super::reference::Picture;

/// What lies behind translucent pictures when they are seen: the dark sea of the globe.
const BACKGROUND: [f64; 3] = [0.035, 0.075, 0.14];
/// Alpha from which on a pixel is covered: what rounds to a byte above 0.
const LEAST_ALPHA: f64 = 0.5 / 255.0;

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
    /// The same measures over what is drawn; none where nothing is.
    pub covered: Option<Covered>,
}

/// Measures over the pixels that are not empty in at least one of the two pictures. In a picture of the sea whose rest is
/// empty, empty pixels agree whatever the sea looks like: means over all of them say how much of the picture is sea.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Covered {
    /// These pixels, of a hundred.
    pub percent: f64,
    /// Peak signal-to-noise ratio, decibels; none where the pictures are equal.
    pub psnr_db: Option<f64>,
    /// Mean FLIP over the dark sea, 0 to 1; what lies around these pixels is part of what the eye sees of them.
    pub mean_flip: f64,
}

impl Difference {
    /// Measures; none for pictures of two sizes, or of none.
    pub fn of(a: &Picture, b: &Picture) -> Option<Self> {
        if (a.width, a.height) != (b.width, b.height) || a.rgba.is_empty() {
            return None;
        }
        let (mut most, mut within) = (0.0, 0usize);
        let mut squares = Vec::with_capacity(a.rgba.len());
        for (a, b) in a.rgba.iter().zip(&b.rgba) {
            let apart = [0, 1, 2, 3].map(|i| (a[i] - b[i]).abs());
            squares.push(apart.iter().map(|d| d * d).sum::<f64>());
            let levels = 255.0 * apart.into_iter().fold(0.0, f64::max);
            most = f64::max(most, levels);
            // Bytes divided by 255 and multiplied again are whole only nearly.
            within += usize::from(levels <= 1.0 + 1e-9);
        }
        let [one, other] = [a, b].map(over_the_sea);
        let [one, other] = [&one, &other].map(|srgb| Screen {
            width: a.width as usize,
            srgb,
        });
        let flips = flip::flip(&one, &other);
        let alphas = a.rgba.iter().zip(&b.rgba);
        let is_covered: Vec<bool> = alphas.map(|(a, b)| a[3].max(b[3]) >= LEAST_ALPHA).collect();
        let (all, drawn) = (
            Mean::over(&squares, &flips, |_| true),
            Mean::over(&squares, &flips, |pixel| is_covered[pixel]),
        );
        Some(Self {
            psnr_db: all.psnr_db(),
            mean_flip: all.flip,
            most_levels: most,
            within_one_level_percent: 100.0 * within as f64 / a.rgba.len() as f64,
            covered: (drawn.pixels > 0).then(|| Covered {
                percent: 100.0 * drawn.pixels as f64 / a.rgba.len() as f64,
                psnr_db: drawn.psnr_db(),
                mean_flip: drawn.flip,
            }),
        })
    }
}

/// What is summed up over some of the pixels.
struct Mean {
    pixels: usize,
    /// Mean square of a channel.
    square: f64,
    flip: f64,
}

impl Mean {
    /// `squares` are those of the four channels of a pixel, added.
    fn over(squares: &[f64], flips: &[f64], is_asked: impl Fn(usize) -> bool) -> Self {
        let (mut pixels, mut square, mut flip) = (0, 0.0, 0.0);
        for pixel in (0..squares.len()).filter(|pixel| is_asked(*pixel)) {
            pixels += 1;
            square += squares[pixel];
            flip += flips[pixel];
        }
        let count = pixels.max(1) as f64;
        Self {
            pixels,
            square: square / (4.0 * count),
            flip: flip / count,
        }
    }

    fn psnr_db(&self) -> Option<f64> {
        (self.square > 0.0).then(|| -10.0 * self.square.log10())
    }
}

/// Bytes of two pictures that differ.
pub fn differing_bytes(a: &Image, b: &Image) -> usize {
    let common = a.rgba8.iter().zip(&b.rgba8);
    common.filter(|(a, b)| a != b).count() + a.rgba8.len().abs_diff(b.rgba8.len())
}

/// A translucent picture as it is seen, red, green and blue from 0 to 1.
pub(crate) fn over_the_sea(picture: &Picture) -> Vec<DVec3> {
    let sea = DVec3::from_array(BACKGROUND);
    let pixels = picture.rgba.iter();
    pixels
        .map(|&[r, g, b, alpha]| {
            (DVec3::new(r, g, b) + sea * (1.0 - alpha)).clamp(DVec3::ZERO, DVec3::ONE)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture whose left quarter is drawn, in one premultiplied colour.
    fn quarter(colour: [f64; 4]) -> Picture {
        let (width, height) = (32u32, 16u32);
        let pixel = |at: u32| {
            if at % width < width / 4 {
                colour
            } else {
                [0.0; 4]
            }
        };
        Picture {
            width,
            height,
            rgba: (0..width * height).map(pixel).collect(),
        }
    }

    #[test]
    fn what_differs_in_the_drawn_quarter_is_not_thinned_out_by_the_empty_rest() {
        let step = 10.0 / 255.0;
        let one = quarter([0.4, 0.3, 0.2, 0.8]);
        let other = quarter([0.4 + step, 0.3 + step, 0.2 + step, 0.8 + step]);
        let apart = Difference::of(&one, &other).unwrap();
        let covered = apart.covered.unwrap();
        assert!((covered.percent - 25.0).abs() < 1e-9, "{covered:?}");
        // Every channel of what is drawn is ten levels off; of the whole picture a quarter is.
        let exact_db = -20.0 * step.log10();
        assert!((covered.psnr_db.unwrap() - exact_db).abs() < 1e-9);
        assert!((apart.psnr_db.unwrap() - exact_db - 10.0 * 4.0f64.log10()).abs() < 1e-9);
        assert!(covered.mean_flip > 2.0 * apart.mean_flip, "{apart:?}");
    }

    #[test]
    fn pixels_drawn_in_one_of_the_pictures_count_and_those_in_neither_do_not() {
        let (empty, drawn) = (quarter([0.0; 4]), quarter([0.1, 0.1, 0.1, 0.3]));
        for (a, b) in [(&empty, &drawn), (&drawn, &empty)] {
            let covered = Difference::of(a, b).unwrap().covered.unwrap();
            assert!((covered.percent - 25.0).abs() < 1e-9, "{covered:?}");
            let square: f64 = (3.0 * 0.01 + 0.09) / 4.0;
            assert!((covered.psnr_db.unwrap() + 10.0 * square.log10()).abs() < 1e-9);
        }
        assert_eq!(Difference::of(&empty, &empty).unwrap().covered, None);
        // Less than rounds to a byte is nothing drawn.
        let faint = quarter([0.0, 0.0, 0.0, 0.4 / 255.0]);
        assert_eq!(Difference::of(&empty, &faint).unwrap().covered, None);
    }
}
