//! Pictures of proofs made visible: premultiplied colours in, opaque pictures for people out.

use render::Image;

use super::difference::over_the_sea;
use super::reference::Picture;

/// Levels of grey that a level of difference is drawn as.
const GAIN: f64 = 8.0;
/// Grey where two pictures agree.
const AGREED: f64 = 128.0;

/// A picture over the dark sea, as FLIP sees it.
pub fn seen(picture: &Picture) -> Image {
    let colours = over_the_sea(picture);
    let levels = colours.iter().map(|colour| (*colour * 255.0).to_array());
    opaque(picture, levels)
}

/// Where `ours` is brighter than `truth` and where darker, each channel for itself: grey where they agree, eight levels
/// lighter for a level brighter. None for pictures of two sizes.
pub fn apart(ours: &Picture, truth: &Picture) -> Option<Image> {
    if (ours.width, ours.height) != (truth.width, truth.height) {
        return None;
    }
    let [one, other] = [ours, truth].map(over_the_sea);
    let pairs = one.iter().zip(&other);
    let levels = pairs.map(|(one, other)| {
        let apart = (*one - *other).to_array();
        apart.map(|channel| AGREED + GAIN * 255.0 * channel)
    });
    Some(opaque(ours, levels))
}

fn opaque(size_of: &Picture, levels: impl Iterator<Item = [f64; 3]>) -> Image {
    let byte = |level: f64| level.round().clamp(0.0, 255.0) as u8;
    Image {
        width: size_of.width,
        height: size_of.height,
        rgba8: levels
            .flat_map(|[r, g, b]| [byte(r), byte(g), byte(b), 255])
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(pixels: &[[f64; 4]]) -> Picture {
        Picture {
            width: pixels.len() as u32,
            height: 1,
            rgba: pixels.to_vec(),
        }
    }

    #[test]
    fn a_difference_says_which_picture_is_brighter_and_by_how_much() {
        let truth = picture(&[[0.4, 0.4, 0.4, 1.0]; 3]);
        let level = 1.0 / 255.0;
        let ours = picture(&[
            [0.4, 0.4, 0.4, 1.0],
            [0.4 + 2.0 * level, 0.4, 0.4, 1.0],
            [0.4, 0.4 - 3.0 * level, 0.4, 1.0],
        ]);
        let image = apart(&ours, &truth).unwrap();
        let agreed = [128, 128, 128, 255];
        assert_eq!(image.rgba8[..4], agreed);
        assert_eq!(image.rgba8[4..8], [144, 128, 128, 255]);
        assert_eq!(image.rgba8[8..], [128, 104, 128, 255]);
        assert!(apart(&ours, &picture(&[[0.0; 4]])).is_none());
    }

    #[test]
    fn what_is_empty_shows_the_sea_and_what_is_opaque_does_not() {
        let image = seen(&picture(&[[0.0; 4], [0.0, 1.0, 0.0, 1.0]]));
        assert_eq!(image.rgba8, [9, 19, 36, 255, 0, 255, 0, 255]);
    }
}
