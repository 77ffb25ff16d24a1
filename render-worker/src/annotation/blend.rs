//! A drawing over a finished picture.

use legend::raster::Pixels;
use render::Image;

/// The drawing over the picture (Porter and Duff's `over`, 1984) in the values that are stored: whole numbers, so that the
/// same two are always the same picture. Pixels that the drawing leaves alone keep their bytes. Both have one size.
pub(super) fn over(mut image: Image, drawing: &Pixels) -> Image {
    debug_assert_eq!((image.width, image.height), (drawing.width, drawing.height));
    let pixels = image.rgba8.chunks_exact_mut(4);
    for (below, above) in pixels.zip(drawing.premultiplied_rgba8.chunks_exact(4)) {
        let above_alpha = u32::from(above[3]);
        if above_alpha == 0 {
            continue;
        }
        // In parts of 255 x 255.
        let below_weight = u32::from(below[3]) * (255 - above_alpha);
        let alpha = 255 * above_alpha + below_weight;
        for channel in 0..3 {
            let sum =
                255 * 255 * u32::from(above[channel]) + below_weight * u32::from(below[channel]);
            below[channel] = ((sum + alpha / 2) / alpha).min(255) as u8;
        }
        below[3] = ((alpha + 127) / 255) as u8;
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blended(below: [u8; 4], above: [u8; 4]) -> [u8; 4] {
        let image = Image {
            width: 1,
            height: 1,
            rgba8: below.to_vec(),
        };
        let drawing = Pixels {
            width: 1,
            height: 1,
            premultiplied_rgba8: above.to_vec(),
        };
        over(image, &drawing).pixel(0, 0)
    }

    #[test]
    fn what_is_not_drawn_on_keeps_its_bytes() {
        for below in [[1, 2, 3, 0], [9, 8, 7, 255], [200, 100, 50, 77]] {
            assert_eq!(blended(below, [0; 4]), below);
        }
    }

    #[test]
    fn a_drawing_lies_over_the_picture() {
        assert_eq!(
            blended([10, 20, 30, 255], [200, 150, 100, 255]),
            [200, 150, 100, 255]
        );
        assert_eq!(
            blended([10, 20, 30, 0], [60, 30, 0, 128]),
            [120, 60, 0, 128]
        );
        // Half white over opaque black, and over half-transparent black.
        assert_eq!(
            blended([0, 0, 0, 255], [128, 128, 128, 128]),
            [128, 128, 128, 255]
        );
        assert_eq!(
            blended([0, 0, 0, 128], [128, 128, 128, 128]),
            [170, 170, 170, 192]
        );
    }

    #[test]
    fn no_pixel_is_brighter_than_its_parts() {
        for alpha in 0..=255u8 {
            for below in [0, 1, 127, 254, 255] {
                let [red, _, _, _] = blended([255, 0, 0, below], [alpha, 0, 0, alpha]);
                assert!(alpha == 0 || red == 255, "{alpha} over {below}: {red}");
            }
        }
    }
}
