//! Lines along the lower edge, the lowest first: the source, and what trails are of.

use contract::annotation::Label;
use legend::LegendError;

use super::page::{Area, Page};
use super::panel::Panel;
use super::text::{self, Anchor, Ink};

/// Size of its letters.
const SIZE_EM: f64 = 0.72;
/// Height of the line, and what is free below and above it.
const LINE_EM: f64 = 1.3;
const GAP_EM: f64 = 0.45;
/// In pictures of a shorter side, pixels, the room is left to the panels.
const LEAST_SIDE_PX: f64 = 320.0;

pub(super) fn draw(page: &mut Page, label: &Label) -> Result<(), LegendError> {
    let (em, margin) = (page.em(), page.margin());
    let [across, down] = page.size();
    let (size, padding) = (SIZE_EM * em, 0.5 * em);
    let room = across - 2.0 * (margin + padding);
    if across.min(down) < LEAST_SIDE_PX {
        return Ok(());
    }
    let Some(line) = text::fitted(label.as_str(), size, Ink::Soft, room)? else {
        return Ok(());
    };
    let top = page.take_foot((LINE_EM + 2.0 * GAP_EM) * em) + GAP_EM * em;
    let area = Area {
        left: margin,
        top,
        right: margin + 2.0 * padding + text::width(&line, size, Ink::Soft)?,
        bottom: top + LINE_EM * em,
    };
    let mut panel = Panel::over(area, em);
    panel.write(&line, [padding, 0.92 * em], size, Anchor::Start, Ink::Soft);
    panel.put(page);
    Ok(())
}
