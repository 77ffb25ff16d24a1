//! A legend as PNG: its SVG, drawn with a font that is part of this program, so that every machine draws the same.

use std::sync::{Arc, LazyLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Source};
use resvg::usvg::{Options, Tree};

/// One font for texts of any family, which has every sign that units are written with.
static OPTIONS: LazyLock<Options<'static>> = LazyLock::new(|| {
    let mut fonts = Database::new();
    fonts.load_font_source(Source::Binary(Arc::new(dejavu::sans::regular())));
    fonts.set_sans_serif_family("DejaVu Sans");
    Options {
        fontdb: Arc::new(fonts),
        ..Options::default()
    }
});

/// The pixels of a drawing.
pub(super) fn drawn(svg: &str) -> Result<Vec<u8>, String> {
    pixels(svg)?.encode_png().map_err(|e| e.to_string())
}

fn pixels(svg: &str) -> Result<Pixmap, String> {
    let tree = Tree::from_str(svg, &OPTIONS).map_err(|e| e.to_string())?;
    let size = tree.size().to_int_size();
    let mut pixels = Pixmap::new(size.width(), size.height()).ok_or("it has no room")?;
    resvg::render(&tree, Transform::identity(), &mut pixels.as_mut());
    Ok(pixels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::legend::{Legend, MARGIN_PX, svg};
    use contract::colour::TransferOptions;
    use contract::quantity::Quantity;
    use resvg::usvg::{Node, Rect};

    const PAPER: [u8; 3] = [255; 3];

    fn svg(quantity: Quantity, options: &TransferOptions) -> String {
        svg::drawn(&Legend::of(quantity, &options.over(quantity).unwrap()))
    }

    fn at(pixels: &Pixmap, x: u32, y: u32) -> [u8; 3] {
        let color = pixels.pixel(x, y).unwrap();
        assert!(color.is_opaque());
        [color.red(), color.green(), color.blue()]
    }

    #[test]
    fn the_bar_shows_the_colours_and_the_text_is_there() {
        let legend = svg(Quantity::CarbonFlux, &TransferOptions::default());
        let file = drawn(&legend).unwrap();
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
            pixels(&svg).unwrap().take()
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

    /// Where the texts of a drawing are.
    fn texts(svg: &str) -> Vec<Rect> {
        let tree = Tree::from_str(svg, &OPTIONS).unwrap();
        let of = |node: &Node| match node {
            Node::Text(text) => Some(text.abs_bounding_box()),
            _ => None,
        };
        tree.root().children().iter().filter_map(of).collect()
    }

    #[test]
    fn texts_stay_within_the_drawing_and_apart() {
        let is_within = |text: &Rect| text.left() >= 0.0 && text.right() <= 512.0;
        for quantity in Quantity::ALL {
            let texts = texts(&svg(quantity, &TransferOptions::default()));
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
            let texts = texts(&svg(Quantity::WindSpeed, &options));
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
        let legend = pixels(&svg(Quantity::WindSpeed, &options)).unwrap();
        let left: Vec<_> = (0..12).map(|i| at(&legend, MARGIN_PX + i, 40)).collect();
        assert!(left.iter().any(|c| c[0] > 240) && left.iter().any(|c| c[0] < 210));
        let dark = |xs: std::ops::Range<u32>| {
            let places = xs.flat_map(|x| (80..108).map(move |y| (x, y)));
            places.filter(|(x, y)| at(&legend, *x, *y)[0] < 120).count()
        };
        assert!(dark(440..500) > 3 * dark(12..72) && dark(12..72) > 10);
    }
}
