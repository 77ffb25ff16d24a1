//! How far two results are apart, and pictures that must be alike or must differ.

use render::Image;

/// Worst distance in units of the allowed one: `absolute + relative * |b|`. Above 1 is too far; NaN is a difference.
pub(crate) fn worst(a: &[f32], b: &[f32], absolute: f32, relative: f32) -> f32 {
    assert_eq!(a.len(), b.len(), "two results of different length");
    let distance = |(a, b): (&f32, &f32)| {
        let units = (a - b).abs() / (absolute + relative * b.abs());
        if units.is_nan() { f32::INFINITY } else { units }
    };
    a.iter().zip(b).map(distance).fold(0.0, f32::max)
}

/// Largest difference of a channel, and the number of pixels that differ by more than one.
pub(crate) fn distance(a: &Image, b: &Image) -> (u8, usize) {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let pixels = a.rgba8.chunks_exact(4).zip(b.rgba8.chunks_exact(4));
    let worst = |(a, b): (&[u8], &[u8])| {
        // The colour of a pixel counts as far as it can be seen.
        let seen = u16::from(a[3].max(b[3]));
        let channel = |i: usize| {
            let apart = u16::from(a[i].abs_diff(b[i]));
            if i == 3 { apart } else { apart * seen / 255 }
        };
        (0..4).map(channel).max().unwrap_or(0) as u8
    };
    let apart: Vec<u8> = pixels.map(worst).collect();
    (
        apart.iter().copied().max().unwrap_or(0),
        apart.iter().filter(|&&d| d > 1).count(),
    )
}

/// Fails if two pictures are alike.
pub(crate) fn assert_images_differ(a: &Image, b: &Image) {
    let (most, pixels) = distance(a, b);
    let all = a.rgba8.len() / 4;
    assert!(
        most > 16 && pixels > all / 20,
        "pictures that should differ: at most by {most}, in {pixels} of {all} pixels"
    );
}
