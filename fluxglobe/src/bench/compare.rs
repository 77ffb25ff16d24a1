//! `fluxglobe bench compare`: two PNG files in, how far they are apart out. For pictures of two adapters, workers or
//! versions.

use std::io::BufReader;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
use image::{ImageFormat, ImageReader, Limits};
use render::Image;
use render_proof::{Difference, Picture, difference};
use serde::Serialize;

use crate::cli::BenchCompare;
use crate::progress;

/// Longest side of a picture, pixels.
const MOST_SIDE_PX: u32 = 16_384;
/// Most bytes of one decoded picture and what decoding takes.
const MOST_BYTES: u64 = 1 << 30;

/// What is printed.
#[derive(Debug, Serialize)]
struct Comparison {
    width_px: u32,
    height_px: u32,
    differing_bytes: usize,
    #[serde(flatten)]
    difference: Difference,
}

pub(crate) fn run(options: &BenchCompare) -> Result<()> {
    let (a, b) = (opened(&options.a)?, opened(&options.b)?);
    if (a.width, a.height) != (b.width, b.height) {
        bail!(
            "{} is {} x {} pixels, {} is {} x {}",
            options.a.display(),
            a.width,
            a.height,
            options.b.display(),
            b.width,
            b.height
        );
    }
    let difference = Difference::of(&Picture::from(&a), &Picture::from(&b))
        .context("pictures without pixels cannot be compared")?;
    let comparison = Comparison {
        width_px: a.width,
        height_px: a.height,
        differing_bytes: difference::differing_bytes(&a, &b),
        difference,
    };
    if options.json {
        progress::result(&serde_json::to_string_pretty(&comparison)?)?;
    } else {
        progress::result(&lines(&comparison))?;
    }
    if let Some(least) = options.least_within
        && difference.within_one_level_percent < least
    {
        bail!(
            "{:.4} % of the pixels lie within one level, {least} % are wanted",
            difference.within_one_level_percent
        );
    }
    Ok(())
}

fn lines(comparison: &Comparison) -> String {
    let Difference {
        psnr_db,
        mean_flip,
        most_levels,
        within_one_level_percent,
        covered,
    } = comparison.difference;
    let in_db = |db: Option<f64>| db.map_or_else(|| "equal".to_owned(), |db| format!("{db:.2} dB"));
    let psnr = in_db(psnr_db);
    let drawn = covered.map_or_else(String::new, |covered| {
        format!(
            "\nof drawn pixels         {:.2} % of all: PSNR {}, mean FLIP {:.5}",
            covered.percent,
            in_db(covered.psnr_db),
            covered.mean_flip
        )
    });
    format!(
        "size                    {} x {} pixels\n\
         bytes that differ       {} of {}\n\
         within one level        {within_one_level_percent:.4} % of pixels\n\
         largest difference      {most_levels:.2} levels\n\
         PSNR                    {psnr}\n\
         mean FLIP               {mean_flip:.5}{drawn}",
        comparison.width_px,
        comparison.height_px,
        comparison.differing_bytes,
        u64::from(comparison.width_px) * u64::from(comparison.height_px) * 4,
    )
}

/// A PNG file decoded under limits.
fn opened(path: &Path) -> Result<Image> {
    let shown = path.display();
    let file = std::fs::File::open(path).with_context(|| format!("cannot open {shown}"))?;
    decoded(BufReader::new(file)).with_context(|| format!("{shown} cannot be read as PNG"))
}

fn decoded(input: impl std::io::BufRead + std::io::Seek) -> Result<Image> {
    let mut reader = ImageReader::with_format(input, ImageFormat::Png);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MOST_SIDE_PX);
    limits.max_image_height = Some(MOST_SIDE_PX);
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let picture = reader.decode()?.into_rgba8();
    Ok(Image {
        width: picture.width(),
        height: picture.height(),
        rgba8: picture.into_raw(),
    })
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn picture(change: impl Fn(usize) -> u8) -> Image {
        Image {
            width: 8,
            height: 4,
            rgba8: (0..8 * 4 * 4)
                .map(|i| if i % 4 == 3 { 255 } else { change(i) })
                .collect(),
        }
    }

    #[test]
    fn a_picture_written_and_read_again_is_equal_and_another_is_told_apart_by_its_levels() {
        let plain = picture(|i| (i * 3 % 200) as u8);
        let again = decoded(Cursor::new(plain.encode_png().unwrap())).unwrap();
        assert_eq!(again, plain);
        let equal = Difference::of(&Picture::from(&plain), &Picture::from(&again)).unwrap();
        assert_eq!((equal.psnr_db, equal.most_levels), (None, 0.0));

        // Three bytes a level up in one pixel, one byte 40 levels up in another.
        let mut other = plain.clone();
        for byte in &mut other.rgba8[0..3] {
            *byte += 1;
        }
        other.rgba8[4 * 9] += 40;
        let apart = Difference::of(&Picture::from(&plain), &Picture::from(&other)).unwrap();
        assert_eq!(difference::differing_bytes(&plain, &other), 4);
        assert!((apart.most_levels - 40.0).abs() < 1e-9);
        assert!((apart.within_one_level_percent - 100.0 * 31.0 / 32.0).abs() < 1e-9);
        let mean_square = (3.0 + 1600.0) / (255.0 * 255.0) / 128.0;
        assert!((apart.psnr_db.unwrap() + 10.0 * f64::log10(mean_square)).abs() < 1e-9);
    }

    #[test]
    fn what_is_no_picture_or_too_large_a_one_is_refused() {
        assert!(decoded(Cursor::new(b"no picture")).is_err());
        // The header of a picture of 2^31 - 1 pixels a side, with its check sum.
        let mut huge = picture(|_| 0).encode_png().unwrap().to_vec();
        huge[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
        assert!(decoded(Cursor::new(huge)).is_err());
    }
}
