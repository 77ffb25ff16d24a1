//! SVG in, pixels out, with fonts that are part of this program, so that every machine draws the same.

use std::sync::{Arc, LazyLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Source};
use resvg::usvg::{Node, Options, Rect, Tree};

use crate::LegendError;

/// What other texts than names of seas are written in: every sign that units are written with is in it.
pub const SANS: &str = "DejaVu Sans";
/// What names of seas are written in, in italics as on maps.
pub const SERIF: &str = "DejaVu Serif";

/// These fonts for texts of any family.
static OPTIONS: LazyLock<Options<'static>> = LazyLock::new(|| {
    let mut fonts = Database::new();
    for font in [dejavu::sans::regular(), dejavu::serif_condensed::italic()] {
        fonts.load_font_source(Source::Binary(Arc::new(font)));
    }
    fonts.set_sans_serif_family(SANS);
    fonts.set_serif_family(SERIF);
    Options {
        font_family: SANS.to_owned(),
        fontdb: Arc::new(fonts),
        ..Options::default()
    }
});

/// Pixels of a drawing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pixels {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Red, green and blue, each times alpha, and alpha; row by row from the top.
    pub premultiplied_rgba8: Vec<u8>,
}

/// The pixels of a drawing at its own size; the same drawing is always the same pixels.
///
/// # Errors
/// A text that is no SVG.
pub fn pixels(svg: &str) -> Result<Pixels, LegendError> {
    let pixels = pixmap(svg)?;
    Ok(Pixels {
        width: pixels.width(),
        height: pixels.height(),
        premultiplied_rgba8: pixels.take(),
    })
}

/// Where the texts of a drawing are that lie in no group: left, top, right and bottom of each, pixels.
///
/// # Errors
/// A text that is no SVG.
pub fn text_boxes(svg: &str) -> Result<Vec<[f64; 4]>, LegendError> {
    let of = |text: &Rect| [text.left(), text.top(), text.right(), text.bottom()].map(f64::from);
    Ok(texts(&tree(svg)?).iter().map(of).collect())
}

/// The pixels of a drawing as PNG.
///
/// # Errors
/// A text that is no SVG.
pub fn png(svg: &str) -> Result<Vec<u8>, LegendError> {
    let encoded = pixmap(svg)?.encode_png();
    encoded.map_err(|error| LegendError::Raster(error.to_string()))
}

fn pixmap(svg: &str) -> Result<Pixmap, LegendError> {
    let tree = tree(svg)?;
    let size = tree.size().to_int_size();
    let pixels = Pixmap::new(size.width(), size.height());
    let mut pixels = pixels.ok_or_else(|| LegendError::Raster("it has no room".to_owned()))?;
    resvg::render(&tree, Transform::identity(), &mut pixels.as_mut());
    Ok(pixels)
}

fn tree(svg: &str) -> Result<Tree, LegendError> {
    Tree::from_str(svg, &OPTIONS).map_err(|error| LegendError::Raster(error.to_string()))
}

fn texts(tree: &Tree) -> Vec<Rect> {
    let of = |node: &Node| match node {
        Node::Text(text) => Some(text.abs_bounding_box()),
        _ => None,
    };
    tree.root().children().iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Legend, MARGIN_PX, svg};
    use contract::colour::TransferOptions;
    use contract::quantity::Quantity;

    const PAPER: [u8; 3] = [255; 3];

    fn svg(quantity: Quantity, options: &TransferOptions) -> String {
        svg::drawn(&Legend::of(quantity, &options.over(quantity).unwrap()))
    }

    fn at(pixels: &Pixmap, x: u32, y: u32) -> [u8; 3] {
        let colour = pixels.pixel(x, y).unwrap();
        assert!(colour.is_opaque());
        [colour.red(), colour.green(), colour.blue()]
    }

    #[test]
    fn the_bar_shows_the_colours_and_the_text_is_there() {
        let legend = svg(Quantity::CarbonFlux, &TransferOptions::default());
        let file = png(&legend).unwrap();
        let legend = Pixmap::decode_png(&file).unwrap();
        assert_eq!((legend.width(), legend.height()), (512, 84));
        let near = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 3);
        assert!(near(at(&legend, MARGIN_PX, 40), [17, 56, 127]));
        assert!(near(at(&legend, 512 / 2, 40), [240, 240, 238]));
        assert!(near(at(&legend, 512 - MARGIN_PX - 1, 40), [118, 14, 36]));
        assert_eq!(at(&legend, MARGIN_PX - 1, 40), PAPER);
        let ink = |ys: std::ops::Range<u32>| {
            let places = ys.flat_map(|y| (0..512).map(move |x| (x, y)));
            let dark = places.filter(|(x, y)| at(&legend, *x, *y)[0] < 128);
            dark.count()
        };
        let ink = [0..30, 52..54, 59..80].map(ink);
        let enough = [300, 10, 80];
        assert!(
            ink.iter().zip(enough).all(|(ink, enough)| *ink >= enough),
            "{ink:?}"
        );
    }

    #[test]
    fn every_letter_of_titles_units_and_numbers_is_in_the_font() {
        let drawn = |letter: char| {
            let text = format!("<text y=\"20\" font-family=\"sans-serif\">{letter}</text>");
            let svg = format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"30\" height=\"30\">{text}</svg>"
            );
            pixmap(&svg).unwrap().take()
        };
        let unknown = drawn('\u{10fffd}');
        let titles =
            Quantity::ALL.map(|quantity| quantity.title().to_owned() + quantity.display().unit);
        let letters = titles.concat() + "0123456789−.e";
        for letter in letters.chars().filter(|letter| *letter != ' ') {
            let letter_drawn = drawn(letter);
            assert!(letter_drawn.iter().any(|byte| *byte > 0), "{letter:?}");
            assert!(letter_drawn != unknown, "{letter:?}");
        }
    }

    fn texts_of(svg: &str) -> Vec<Rect> {
        texts(&tree(svg).unwrap())
    }

    #[test]
    fn texts_stay_within_the_drawing_and_apart() {
        let is_within = |text: &Rect| text.left() >= 0.0 && text.right() <= 512.0;
        for quantity in Quantity::ALL {
            let texts = texts_of(&svg(quantity, &TransferOptions::default()));
            assert!(texts.len() >= 4 && texts.iter().all(is_within), "{texts:?}");
            for (i, text) in texts.iter().enumerate() {
                let is_apart = |other: &Rect| text.intersect(other).is_none();
                assert!(texts[..i].iter().all(is_apart), "{quantity:?} {texts:?}");
            }
        }
        for long in ["-1e-7:1e-7", "-2.5e8:-2.4999e8"] {
            let options = TransferOptions {
                range: Some(long.parse().unwrap()),
                ..TransferOptions::default()
            };
            let texts = texts_of(&svg(Quantity::WindSpeed, &options));
            assert!(texts.iter().all(is_within), "{long}: {texts:?}");
        }
    }

    #[test]
    fn what_is_transparent_shows_the_squares_below_and_sizes_are_discs() {
        let options = TransferOptions {
            opacity: "0:0,15:1".parse().unwrap(),
            size: "0:0.2,15:1".parse().unwrap(),
            ..TransferOptions::default()
        };
        let legend = pixmap(&svg(Quantity::WindSpeed, &options)).unwrap();
        let left: Vec<_> = (0..12).map(|i| at(&legend, MARGIN_PX + i, 40)).collect();
        assert!(left.iter().any(|c| c[0] > 240) && left.iter().any(|c| c[0] < 210));
        let dark = |xs: std::ops::Range<u32>| {
            let places = xs.flat_map(|x| (80..108).map(move |y| (x, y)));
            places.filter(|(x, y)| at(&legend, *x, *y)[0] < 120).count()
        };
        assert!(dark(440..500) > 3 * dark(12..72) && dark(12..72) > 10);
    }
}
