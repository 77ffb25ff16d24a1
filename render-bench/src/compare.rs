//! How far two pictures are apart.

use render_worker::Image;
use serde::Serialize;

/// Differences of two pictures of one size.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Difference {
    /// Peak signal over noise of what is seen, the colours over black; infinite for equal pictures, dB.
    pub psnr_db: f64,
    /// Share of pixels no channel of which differs by more than one level of 255.
    pub within_one_level: f64,
    /// Largest difference of a channel, levels.
    pub most_levels: u8,
    /// Bytes that differ.
    pub bytes: usize,
}

/// Compares two pictures; none if their sizes differ.
pub fn difference(a: &Image, b: &Image) -> Option<Difference> {
    if (a.width, a.height) != (b.width, b.height) {
        return None;
    }
    let pixels = || a.rgba8.chunks_exact(4).zip(b.rgba8.chunks_exact(4));
    let levels = |(a, b): (&[u8], &[u8])| {
        let channels = seen(a).into_iter().zip(seen(b));
        let apart = channels.map(|(a, b)| (a - b).abs().round() as u8);
        apart.max().unwrap_or(0).max(a[3].abs_diff(b[3]))
    };
    let squares: f64 = pixels()
        .flat_map(|(a, b)| seen(a).into_iter().zip(seen(b)))
        .map(|(a, b)| (a - b) * (a - b))
        .sum();
    let mean = squares / (pixels().count() * 3) as f64;
    let close = pixels().filter(|pair| levels(*pair) <= 1).count();
    Some(Difference {
        psnr_db: 10.0 * (255.0 * 255.0 / mean).log10(),
        within_one_level: close as f64 / pixels().count() as f64,
        most_levels: pixels().map(levels).max().unwrap_or(0),
        bytes: a.rgba8.iter().zip(&b.rgba8).filter(|(a, b)| a != b).count(),
    })
}

/// Colour over black, 0 to 255.
fn seen(pixel: &[u8]) -> [f64; 3] {
    [0, 1, 2].map(|channel| f64::from(pixel[channel]) * f64::from(pixel[3]) / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gray(levels: [u8; 2]) -> Image {
        Image {
            width: 2,
            height: 1,
            rgba8: levels.into_iter().flat_map(|l| [l, l, l, 255]).collect(),
        }
    }

    #[test]
    fn equal_pictures_are_infinitely_alike_and_others_as_far_as_they_differ() {
        let same = difference(&gray([10, 20]), &gray([10, 20])).unwrap();
        assert!(same.psnr_db.is_infinite() && same.bytes == 0 && same.most_levels == 0);
        let apart = difference(&gray([10, 20]), &gray([10, 25])).unwrap();
        assert_eq!((apart.most_levels, apart.bytes), (5, 3));
        assert!((apart.within_one_level - 0.5).abs() < 1e-12);
        // Half the pixels differ by 5: 10 log10(255^2 / 12.5).
        assert!((apart.psnr_db - 37.16).abs() < 0.01);
        let mut wide = gray([1, 2]);
        wide.width = 1;
        assert!(difference(&wide, &gray([1, 2])).is_none());
    }
}
