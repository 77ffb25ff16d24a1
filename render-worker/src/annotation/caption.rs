//! The line of source along the lower edge.

use contract::annotation::Label;
use legend::LegendError;

use super::page::Page;
use super::text::{self, Anchor, Ink, Text};

/// Size of its letters.
const SIZE_EM: f64 = 0.72;

pub(super) fn draw(page: &mut Page, source: &Label) -> Result<(), LegendError> {
    let (em, margin) = (page.em(), page.margin());
    let size = SIZE_EM * em;
    let room = page.size()[0] - 2.0 * margin;
    let Some(line) = text::fitted(source.as_str(), size, Ink::Ground, room)? else {
        return Ok(());
    };
    let top = page.take_foot(2.0 * em);
    page.label(&Text {
        text: &line,
        x: margin,
        y: top + 1.25 * em,
        size,
        anchor: Anchor::Start,
        ink: Ink::Ground,
    });
    Ok(())
}
