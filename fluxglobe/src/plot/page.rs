//! What every plot has round it: a title, what was read in which version, from whom, and axes.

use anyhow::{Result, anyhow};
use contract::cited::Cited;
use contract::time::TimeStep;
use plotters::coord::Shift;
use plotters::prelude::{
    Color as _, DrawingArea, IntoDrawingArea as _, IntoFont as _, RGBColor, SVGBackend, Text,
    TextStyle, WHITE,
};

/// Width and height, pixels.
pub(super) const SIZE: (u32, u32) = (1100, 620);
/// Room above the chart, pixels.
const HEAD_PX: u32 = 84;
/// Letters of a line at the foot.
const LETTERS: usize = 150;
/// Lines at the foot at most.
const FOOT_LINES: usize = 4;
/// Height of a line at the foot, pixels.
const FOOT_LINE_PX: u32 = 16;
/// Left and right of texts, pixels.
const MARGIN_PX: i32 = 24;
const INK: RGBColor = RGBColor(34, 34, 34);
const QUIET: RGBColor = RGBColor(90, 90, 90);
/// Colours that are told apart by all (Okabe and Ito 2008), their eight: blue, vermilion, green, purple, orange, sky blue, black, yellow.
pub(super) const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
    RGBColor(240, 228, 66),
];

/// What cannot be drawn: it borrows from the drawing, and its words are what matters.
pub(super) type Failed = Box<dyn std::error::Error>;
/// A part of a drawing.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Texts round a chart.
#[derive(Debug, Clone)]
pub(super) struct Words {
    /// What is drawn.
    pub(super) title: String,
    /// Where, and what the lines are.
    pub(super) below: String,
    /// Version and source.
    foot: Vec<String>,
}

impl Words {
    /// Those of a product.
    pub(super) fn of(cited: &Cited, what: &str, below: String) -> Self {
        let made_up = if cited.synthetic { " (synthetic)" } else { "" };
        let title = format!("{}, {what}{made_up}", cited.quantity.title());
        let mut foot = vec![format!("{}: {}", cited.manifest, plain(&cited.title))];
        foot.extend(wrapped(&plain(&cited.source)));
        foot.truncate(FOOT_LINES);
        Self { title, below, foot }
    }
}

/// A whole drawing: texts, and in the room between them what `chart` draws.
pub(super) fn drawn(
    words: &Words,
    chart: impl FnOnce(&Area<'_>) -> Result<(), Failed>,
) -> Result<String> {
    let mut svg = String::new();
    let failed = |error: Failed| anyhow!("the plot cannot be drawn: {error}");
    on_page(words, chart, &mut svg).map_err(failed)?;
    Ok(svg)
}

/// Drawings one below the other, in one.
pub(super) fn stacked(mut drawn: Vec<String>) -> String {
    if drawn.len() == 1 {
        return drawn.remove(0);
    }
    let (width, height) = SIZE;
    let all = height as usize * drawn.len();
    let mut svg = format!(
        "<svg width=\"{width}\" height=\"{all}\" viewBox=\"0 0 {width} {all}\" xmlns=\"http://www.w3.org/2000/svg\">\n"
    );
    for (place, one) in drawn.iter().enumerate() {
        let top = height as usize * place;
        svg.push_str(&one.replacen("<svg ", &format!("<svg y=\"{top}\" "), 1));
    }
    svg.push_str("</svg>\n");
    svg
}

fn on_page(
    words: &Words,
    chart: impl FnOnce(&Area<'_>) -> Result<(), Failed>,
    svg: &mut String,
) -> Result<(), Failed> {
    let page = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    page.fill(&WHITE)?;
    let (head, rest) = page.split_vertically(HEAD_PX);
    let foot_px = FOOT_LINE_PX * words.foot.len() as u32 + 12;
    let (middle, foot) = rest.split_vertically(SIZE.1 - HEAD_PX - foot_px);
    head.draw(&Text::new(
        words.title.clone(),
        (MARGIN_PX, 18),
        style(22, &INK),
    ))?;
    head.draw(&Text::new(
        words.below.clone(),
        (MARGIN_PX, 52),
        style(15, &QUIET),
    ))?;
    for (line, text) in words.foot.iter().enumerate() {
        let top = 2 + i32::try_from(line)? * FOOT_LINE_PX as i32;
        foot.draw(&Text::new(
            text.clone(),
            (MARGIN_PX, top),
            style(12, &QUIET),
        ))?;
    }
    chart(&middle)?;
    page.present()?;
    Ok(())
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "colours of plotters are borrowed"
)]
fn style(size: i32, colour: &RGBColor) -> TextStyle<'static> {
    TextStyle {
        color: colour.to_backend_color(),
        ..TextStyle::from(("sans-serif", size).into_font())
    }
}

/// What one value is of.
pub(super) fn of_a_row(step: TimeStep) -> &'static str {
    match step {
        TimeStep::Native => "step",
        other => other.as_str(),
    }
}

/// Quantity and unit of an axis.
pub(super) fn with_unit(what: &str, unit: &str) -> String {
    if unit.is_empty() {
        what.to_owned()
    } else {
        format!("{what} ({unit})")
    }
}

/// The range of an axis of values with room around it; never empty.
pub(super) fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let finite = values.filter(|value| value.is_finite());
    let (low, high) = finite.fold(start, |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    let room = ((high - low) * 0.06).max(low.abs().max(high.abs()).max(1e-12) * 1e-3);
    low - room..high + room
}

/// Text from outside without control characters; the drawing library escapes what means something in SVG.
fn plain(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(600).collect()
}

/// A text in lines that fit.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines = vec![];
    let mut line = String::new();
    for word in text.split_whitespace() {
        let letters = line.chars().count() + word.chars().count() + 1;
        if !line.is_empty() && letters > LETTERS {
            lines.push(std::mem::take(&mut line));
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines.push(line);
    lines.retain(|line| !line.is_empty());
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_wrapped_and_axes_are_never_empty() {
        let lines = wrapped(&"word ".repeat(100));
        assert!(lines.len() == 4 && lines.iter().all(|line| line.len() <= LETTERS));
        assert_eq!(range([].into_iter()), 0.0..1.0);
        let constant = range([5.0, f64::NAN, 5.0].into_iter());
        assert!(constant.start < 5.0 && constant.end > 5.0);
        assert_eq!(with_unit("Salinity", ""), "Salinity");
    }
}
