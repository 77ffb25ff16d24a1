//! A translucent panel, on which light text can be read whatever is below it.

use super::page::{Area, Page};
use super::text::{Anchor, Ink, Text};

/// Its colour: that of the night sky, and how much of the picture it hides.
const GROUND: &str = "fill=\"#0b1421\" fill-opacity=\"0.72\"";
/// Radius of its corners, letters.
const ROUND_EM: f64 = 0.4;

/// Inside of a panel, from its left upper corner.
pub(super) struct Panel {
    area: Area,
    svg: String,
}

impl Panel {
    pub(super) fn over(area: Area, em: f64) -> Self {
        let Area {
            left,
            top,
            right,
            bottom,
        } = area;
        let svg = format!(
            "<rect x=\"{left:.2}\" y=\"{top:.2}\" width=\"{:.2}\" height=\"{:.2}\" rx=\"{:.2}\" {GROUND}/>",
            right - left,
            bottom - top,
            ROUND_EM * em
        );
        Self { area, svg }
    }

    /// Writes a text at a place inside.
    pub(super) fn write(
        &mut self,
        text: &str,
        [x, y]: [f64; 2],
        size: f64,
        anchor: Anchor,
        ink: Ink,
    ) {
        let line = Text {
            words: text,
            x: self.area.left + x,
            y: self.area.top + y,
            size,
            anchor,
            ink,
        };
        self.svg.push_str(&line.svg());
    }

    /// Draws a line from one place inside to another.
    pub(super) fn stroke(&mut self, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], width: f64) {
        let (left, top) = (self.area.left, self.area.top);
        let svg = format!(
            "<path d=\"M{:.2} {:.2}L{:.2} {:.2}\" stroke=\"#f4f7fb\" stroke-width=\"{width:.2}\" fill=\"none\"/>",
            left + x0,
            top + y0,
            left + x1,
            top + y1
        );
        self.svg.push_str(&svg);
    }

    /// The place of the picture that a place inside is.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.area.left + x, self.area.top + y]
    }

    /// Takes any other drawing.
    pub(super) fn push(&mut self, svg: &str) {
        self.svg.push_str(svg);
    }

    pub(super) fn put(self, page: &mut Page) {
        page.panel(&self.svg);
    }
}
