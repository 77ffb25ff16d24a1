//! A line of text: escaped, in one of the inks, as long as its font makes it.

use std::fmt::Write as _;

use legend::LegendError;
use legend::raster::{self, SANS, SERIF};
use legend::svg::escaped;

/// What most text is written in over panels.
const LIGHT: &str = "#f4f7fb";
/// What says less.
const SOFT: &str = "#b9c6d6";
/// What surrounds text on the ground, light or dark.
const HALO: &str = "#0a121e";

/// How a text looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ink {
    /// On a panel.
    Panel,
    /// On a panel, and less important.
    Soft,
    /// On the ground or the sky.
    Ground,
    /// Name of an ocean.
    Ocean,
    /// Name of a sea.
    Sea,
}

/// Which of its places a text is written from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A line of text at a place of the picture, pixels; `y` is that of its base line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Text<'a> {
    pub(super) words: &'a str,
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) size: f64,
    pub(super) anchor: Anchor,
    pub(super) ink: Ink,
}

impl Text<'_> {
    /// As an element of SVG.
    pub(super) fn svg(&self) -> String {
        let anchor = match self.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let mut svg = format!(
            "<text x=\"{:.2}\" y=\"{:.2}\" font-size=\"{:.2}\" text-anchor=\"{anchor}\"{}>",
            self.x,
            self.y,
            self.size,
            self.ink.attributes(self.size)
        );
        svg.push_str(&escaped(self.words));
        svg.push_str("</text>");
        svg
    }
}

impl Ink {
    fn attributes(self, size: f64) -> String {
        let halo = |share: f64, opacity: f64| {
            let width = share * size;
            format!(
                " stroke=\"{HALO}\" stroke-width=\"{width:.2}\" stroke-opacity=\"{opacity}\" stroke-linejoin=\"round\" paint-order=\"stroke\""
            )
        };
        match self {
            Self::Panel => format!(" fill=\"{LIGHT}\""),
            Self::Soft => format!(" fill=\"{SOFT}\""),
            Self::Ground => format!(" fill=\"{LIGHT}\"{}", halo(0.26, 0.7)),
            Self::Ocean | Self::Sea => {
                let spacing = self.spacing(size);
                format!(
                    " fill=\"{LIGHT}\" fill-opacity=\"0.92\" font-family=\"{SERIF}\" font-stretch=\"condensed\" font-style=\"italic\" letter-spacing=\"{spacing:.2}\"{}",
                    halo(0.2, 0.5)
                )
            }
        }
    }

    /// Between letters, pixels.
    fn spacing(self, size: f64) -> f64 {
        match self {
            Self::Ocean => 0.16 * size,
            Self::Sea => 0.04 * size,
            Self::Panel | Self::Soft | Self::Ground => 0.0,
        }
    }
}

/// How long a text is, pixels; 0 where no letter of it is in the font.
pub(super) fn width(text: &str, size: f64, ink: Ink) -> Result<f64, LegendError> {
    let line = Text {
        words: text,
        x: 0.0,
        y: size,
        size,
        anchor: Anchor::Start,
        ink,
    };
    let svg = format!("{}{}</svg>", opening([1.0, 1.0]), line.svg());
    let boxes = raster::text_boxes(&svg)?;
    let lengths = boxes.iter().map(|[left, _, right, _]| right - left);
    Ok(lengths.fold(0.0, |sum, length| sum + length))
}

/// Begins a drawing of a size in pixels.
pub(super) fn opening([width, height]: [f64; 2]) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" font-family=\"{SANS}\">"
    )
}

/// As much of a text as fits into a length, with an ellipsis where something is missing; none where nothing fits.
pub(super) fn fitted(
    text: &str,
    size: f64,
    ink: Ink,
    most_px: f64,
) -> Result<Option<String>, LegendError> {
    if width(text, size, ink)? <= most_px {
        return Ok(Some(text.to_owned()));
    }
    let signs: Vec<char> = text.chars().collect();
    let (mut fits, mut too_many) = (0, signs.len());
    while too_many - fits > 1 {
        let count = usize::midpoint(fits, too_many);
        let mut part: String = signs[..count].iter().collect();
        part.truncate(part.trim_end().len());
        write!(part, "…").expect("a string takes any text");
        if width(&part, size, ink)? <= most_px {
            fits = count;
        } else {
            too_many = count;
        }
    }
    let mut part: String = signs[..fits].iter().collect();
    part.truncate(part.trim_end().len());
    Ok((!part.is_empty()).then(|| part + "…"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_looks_like_markup_is_text() {
        let hostile = "</text><script>alert('1')</script> & \"x\" ]]>\u{0}\u{ffff}";
        let text = Text {
            words: hostile,
            x: 1.0,
            y: 2.0,
            size: 10.0,
            anchor: Anchor::Start,
            ink: Ink::Panel,
        };
        let svg = text.svg();
        assert_eq!(svg.matches('<').count(), 2, "{svg}");
        assert_eq!(svg.matches("]]>").count(), 0, "{svg}");
        assert!(svg.contains("&lt;script&gt;alert(&apos;1&apos;)"), "{svg}");
        assert!(width(hostile, 10.0, Ink::Panel).unwrap() > 100.0);
    }

    #[test]
    fn a_text_is_as_long_as_its_font_makes_it() {
        let one = width("Sea", 20.0, Ink::Panel).unwrap();
        let twice = width("Sea", 40.0, Ink::Panel).unwrap();
        assert!((twice / one - 2.0).abs() < 0.02, "{one} {twice}");
        let spaced = width("Sea", 20.0, Ink::Ocean).unwrap();
        let plain = width("Sea", 20.0, Ink::Sea).unwrap();
        assert!(spaced > plain + 4.0, "{spaced} {plain}");
        assert!(width("", 20.0, Ink::Panel).unwrap().abs() < 1e-9);
    }

    #[test]
    fn what_is_too_long_is_cut() {
        let text = "Takahashi et al. (2009), Deep-Sea Research";
        let all = width(text, 12.0, Ink::Soft).unwrap();
        let cut = |most| fitted(text, 12.0, Ink::Soft, most).unwrap();
        assert_eq!(cut(all + 1.0).as_deref(), Some(text));
        let half = cut(all / 2.0).unwrap();
        assert!(half.ends_with('…') && text.starts_with(half.trim_end_matches('…')));
        let length = width(&half, 12.0, Ink::Soft).unwrap();
        assert!(length <= all / 2.0 && length > all / 2.0 - 20.0, "{half}");
        assert_eq!(cut(3.0), None);
    }
}
