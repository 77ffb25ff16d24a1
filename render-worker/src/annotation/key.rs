//! The panels that say what is shown and when: the legend's bar of colours, and the date.

use contract::annotation::DateLabel;
use contract::colour::TransferFunction;
use contract::job::RenderJob;
use contract::quantity::Quantity;
use legend::svg::{Bar, write_bar};
use legend::{Legend, LegendError};

use super::page::{Corner, Page};
use super::panel::Panel;
use super::text::{Anchor, Ink, width};

/// Between a panel's edge and what is in it, letters.
const PADDING_EM: f64 = 0.8;
/// Width of the bar of colours: a share of the picture within limits in letters.
const BAR_SHARE: f64 = 0.22;
const BAR_LIMITS_EM: [f64; 2] = [15.0, 24.0];
/// Sizes of the lines of a panel, letters.
const TITLE_EM: f64 = 1.0;
const SMALL_EM: f64 = 0.8;
const DATE_EM: f64 = 1.45;

/// The legend of a job's colours.
pub(super) fn draw(
    page: &mut Page,
    job: &RenderJob,
    quantity: Quantity,
) -> Result<(), LegendError> {
    let em = page.em();
    let (padding, title, small) = (PADDING_EM * em, TITLE_EM * em, SMALL_EM * em);
    let transfer = &job.style.transfer;
    let legend = Legend::of_mode(job.mode, quantity, transfer);
    let label_width = width(legend.label(), title, Ink::Panel)?;
    let unit_width = width(legend.unit(), small, Ink::Soft)?;
    let [least, most] = BAR_LIMITS_EM.map(|limit| limit * em);
    let wanted = (page.size()[0] * BAR_SHARE).clamp(least, most);
    let across = wanted.max(label_width + 1.5 * em + unit_width);
    let ends = quantity
        .ends()
        .filter(|_| transfer.low < 0.0 || transfer.high > 0.0);
    let (bar_top, bar_height) = (padding + 1.75 * em, 0.8 * em);
    let foot = bar_top + bar_height;
    let height = foot + 1.3 * em + if ends.is_some() { 1.25 * em } else { 0.0 } + 0.75 * padding;
    let corners = [
        Corner::BottomLeft,
        Corner::BottomRight,
        Corner::TopLeft,
        Corner::TopRight,
    ];
    let Some(area) = page.take_corner([across + 2.0 * padding, height], &corners) else {
        return Ok(());
    };
    let mut panel = Panel::over(area, em);
    let right = padding + across;
    let base = padding + 0.95 * em;
    panel.write(
        legend.label(),
        [padding, base],
        title,
        Anchor::Start,
        Ink::Panel,
    );
    panel.write(legend.unit(), [right, base], small, Anchor::End, Ink::Soft);
    let [x, y] = panel.at([padding, bar_top]);
    let bar = Bar {
        x,
        y,
        width: across,
        height: bar_height,
    };
    let mut colours = String::new();
    write_bar(&legend, bar, &mut colours).expect("a string takes any text");
    panel.push(&colours);
    write_marks(&mut panel, &legend, [padding, foot], across, em)?;
    if let Some(ends) = ends {
        let y = foot + 2.45 * em;
        write_ends(&mut panel, transfer, ends, [padding, right], y, small);
    }
    panel.put(page);
    Ok(())
}

/// Round values below a bar that begins at a place of the panel.
fn write_marks(
    panel: &mut Panel,
    legend: &Legend,
    [left, foot]: [f64; 2],
    across: f64,
    em: f64,
) -> Result<(), LegendError> {
    let small = SMALL_EM * em;
    for (place, text) in legend.marks() {
        let x = left + place * across;
        panel.stroke([x, foot], [x, foot + 0.3 * em], 0.07 * em);
        let half = 0.5 * width(&text, small, Ink::Panel)?;
        // Long numbers at the ends stay in the panel.
        let edge = 0.3 * em + half;
        let middle = x.clamp(edge, (across + 2.0 * left - edge).max(edge));
        panel.write(
            &text,
            [middle, foot + 1.2 * em],
            small,
            Anchor::Middle,
            Ink::Panel,
        );
    }
    Ok(())
}

/// What values below and above zero mean, where the range has such.
fn write_ends(
    panel: &mut Panel,
    transfer: &TransferFunction,
    [low, high]: [&str; 2],
    [left, right]: [f64; 2],
    y: f64,
    size: f64,
) {
    if transfer.low < 0.0 {
        panel.write(
            &format!("◂ {low}"),
            [left, y],
            size,
            Anchor::Start,
            Ink::Panel,
        );
    }
    if transfer.high > 0.0 {
        panel.write(
            &format!("{high} ▸"),
            [right, y],
            size,
            Anchor::End,
            Ink::Panel,
        );
    }
}

/// The date.
pub(super) fn draw_date(page: &mut Page, date: &DateLabel) -> Result<(), LegendError> {
    let em = page.em();
    let (padding, small, large) = (PADDING_EM * em, SMALL_EM * em, DATE_EM * em);
    let shown = date.shown.as_str();
    let note = date.note.as_ref().map_or("", |note| note.as_str());
    let across = width(shown, large, Ink::Panel)?.max(width(note, small, Ink::Soft)?);
    let height = 2.0 * padding + 1.2 * em + if note.is_empty() { 0.0 } else { 1.25 * em };
    let corners = [Corner::TopLeft, Corner::TopRight, Corner::BottomRight];
    let Some(area) = page.take_corner([across + 2.0 * padding, height], &corners) else {
        return Ok(());
    };
    let mut panel = Panel::over(area, em);
    panel.write(
        shown,
        [padding, padding + 1.15 * em],
        large,
        Anchor::Start,
        Ink::Panel,
    );
    panel.write(
        note,
        [padding, padding + 2.4 * em],
        small,
        Anchor::Start,
        Ink::Soft,
    );
    panel.put(page);
    Ok(())
}
