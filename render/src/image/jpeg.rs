//! A picture as JPEG in strips: each is encoded for itself, on any core that is free, and they are put together
//! with restart markers (ITU-T T.81, B.2.1 and E.1.4), after which a decoder begins anew anyway.

use std::borrow::Cow;

use bytes::Bytes;
use jpeg_encoder::{ColorType, Encoder, EncodingError, SamplingFactor};
use rayon::prelude::*;

use super::Image;

/// Pixels a side of what is encoded as one: 8 of colour, which has half the resolution.
const UNIT_PX: usize = 16;
/// Rows of a strip. Fewer cost more bytes, more leave cores without work.
const STRIP_PX: usize = 2 * UNIT_PX;

const MARKER: u8 = 0xff;
const START_OF_SCAN: u8 = 0xda;
const START_OF_FRAME: u8 = 0xc0;
const RESTART_INTERVAL: u8 = 0xdd;
const FIRST_RESTART: u8 = 0xd0;
const END: [u8; 2] = [MARKER, 0xd9];

/// A strip as a JPEG of its own, taken apart.
struct Strip {
    jpeg: Vec<u8>,
    /// Where the segment that begins the scan lies, and where the scan itself.
    header_end: usize,
    scan: usize,
}

pub(super) fn encode(image: &Image, quality: u8) -> Result<Bytes, EncodingError> {
    let (width, height) = (image.width as usize, image.height as usize);
    let strips = image.rgba8.par_chunks(width * STRIP_PX * 4);
    let encoded = strips.map(|rgba8| Strip::encode(rgba8, width, quality));
    let encoded = encoded.collect::<Result<Vec<_>, _>>()?;
    Ok(put_together(&encoded, width, height))
}

impl Strip {
    fn encode(rgba8: &[u8], width: usize, quality: u8) -> Result<Self, EncodingError> {
        let rows = rgba8.len() / 4 / width;
        let mut jpeg = Vec::with_capacity(rgba8.len() / 24 + 1024);
        let mut encoder = Encoder::new(&mut jpeg, quality);
        encoder.set_sampling_factor(SamplingFactor::F_2_2);
        // A side that is too long for a JPEG is refused by the encoder.
        let side = |px: usize| u16::try_from(px).unwrap_or(0);
        encoder.encode(&over_black(rgba8), side(width), side(rows), ColorType::Rgba)?;
        let (header_end, scan) = scan_of(&jpeg);
        Ok(Self {
            jpeg,
            header_end,
            scan,
        })
    }
}

/// The colours over black, each pixel in four bytes of which encoders pass over the last.
fn over_black(rgba8: &[u8]) -> Cow<'_, [u8]> {
    let (pixels, _rest) = rgba8.as_chunks::<4>();
    if pixels.iter().all(|pixel| pixel[3] == 255) {
        return Cow::Borrowed(rgba8);
    }
    let mut black = rgba8.to_vec();
    let (pixels, _rest) = black.as_chunks_mut::<4>();
    for pixel in pixels {
        let alpha = u16::from(pixel[3]);
        for colour in pixel {
            // Divided by 255 and rounded.
            let product = u16::from(*colour) * alpha + 128;
            *colour = ((product + (product >> 8)) >> 8) as u8;
        }
    }
    Cow::Owned(black)
}

/// Where the segment that begins the scan lies, and where the scan itself.
fn scan_of(jpeg: &[u8]) -> (usize, usize) {
    let mut at = 2;
    loop {
        let length = usize::from(u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]]));
        let next = at + 2 + length;
        if jpeg[at + 1] == START_OF_SCAN {
            return (at, next);
        }
        at = next;
    }
}

/// The header of the first strip with the height of all, then all scans.
fn put_together(strips: &[Strip], width: usize, height: usize) -> Bytes {
    let Some(first) = strips.first() else {
        return Bytes::new();
    };
    let bytes: usize = strips.iter().map(|strip| strip.jpeg.len()).sum();
    let mut jpeg = Vec::with_capacity(bytes + 16);
    jpeg.extend_from_slice(&first.jpeg[..first.header_end]);
    set_height(&mut jpeg, height);
    let units = width.div_ceil(UNIT_PX) * (STRIP_PX / UNIT_PX);
    jpeg.extend([MARKER, RESTART_INTERVAL, 0, 4]);
    jpeg.extend((units as u16).to_be_bytes());
    jpeg.extend_from_slice(&first.jpeg[first.header_end..first.scan]);
    for (number, strip) in strips.iter().enumerate() {
        if number > 0 {
            jpeg.extend([MARKER, FIRST_RESTART + ((number - 1) % 8) as u8]);
        }
        jpeg.extend_from_slice(&strip.jpeg[strip.scan..strip.jpeg.len() - END.len()]);
    }
    jpeg.extend(END);
    jpeg.into()
}

/// In the segment that begins the frame: two bytes of length and one of precision lie before it.
fn set_height(header: &mut [u8], height: usize) {
    let mut at = 2;
    while at < header.len() {
        if header[at + 1] == START_OF_FRAME {
            header[at + 5..at + 7].copy_from_slice(&(height as u16).to_be_bytes());
            return;
        }
        at += 2 + usize::from(u16::from_be_bytes([header[at + 2], header[at + 3]]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colours that change slowly, and alpha above.
    fn image(width: u32, height: u32) -> Image {
        let pixel = |at: u32| {
            let (x, y) = (at % width, at / width);
            let alpha = if y < height / 4 { x * 255 / width } else { 255 };
            [x * 255 / width, y * 255 / height, 90, alpha].map(|value| value as u8)
        };
        Image {
            width,
            height,
            rgba8: (0..width * height).flat_map(pixel).collect(),
        }
    }

    fn encoded(image: &Image, threads: usize) -> Bytes {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| encode(image, 90)).unwrap()
    }

    #[test]
    fn strips_are_one_picture_whatever_its_size() {
        for (width, height) in [(1, 1), (300, 127), (300, 128), (333, 129), (64, 1500)] {
            let image = image(width, height);
            let jpeg = encoded(&image, 3);
            let mut decoder = zune_jpeg::JpegDecoder::new(std::io::Cursor::new(&jpeg[..]));
            let rgb8 = decoder.decode().unwrap();
            assert_eq!(
                decoder.dimensions(),
                Some((width as usize, height as usize))
            );
            let black = over_black(&image.rgba8);
            let black: Vec<u8> = black
                .chunks_exact(4)
                .flat_map(|pixel| pixel[..3].to_vec())
                .collect();
            let apart = rgb8.iter().zip(&black).map(|(a, b)| a.abs_diff(*b));
            let most = apart.clone().max().unwrap();
            let mean = apart.map(f64::from).sum::<f64>() / black.len() as f64;
            assert!(most < 40 && mean < 3.0, "{width} x {height}: {most} {mean}");
        }
    }

    #[test]
    fn any_number_of_threads_makes_the_same_bytes() {
        let image = image(500, 700);
        let alone = encoded(&image, 1);
        for threads in [2, 3, 16] {
            assert_eq!(encoded(&image, threads), alone, "{threads}");
        }
    }

    #[test]
    fn what_is_too_large_for_a_jpeg_is_refused() {
        let image = image(70_000, 1);
        assert!(encode(&image, 90).is_err());
    }
}
