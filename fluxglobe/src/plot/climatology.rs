//! A climatology: the mean of each part of the year with its spread.

use anyhow::Result;
use contract::analysis::{CalendarBins, Climatology, ClimatologyRow, SeriesAnalysis};
use plotters::prelude::{BLACK, ChartBuilder, Circle, Color as _, LineSeries, Polygon};

use super::chart::place;
use super::marked::Marked;
use super::page::{self, Area, COLOURS, Failed, Words, range, with_unit};

/// Bins up to which each is marked by a dot.
const DOTS_UP_TO: usize = 12;
/// Letters of a month that are marked.
const LETTERS: usize = 3;

pub(super) fn drawn(answer: &SeriesAnalysis, made: &Climatology) -> Result<String> {
    let below = format!(
        "{} climatology of {}: mean, and one standard deviation of its steps on either side",
        made.bins, made.base
    );
    let words = Words::of(&answer.cited, &place(answer), below);
    page::drawn(&words, |area| on(area, answer, made))
}

fn on(area: &Area<'_>, answer: &SeriesAnalysis, made: &Climatology) -> Result<(), Failed> {
    let ends = |row: &ClimatologyRow| {
        let spread = row.spread.unwrap_or_default();
        row.mean
            .into_iter()
            .flat_map(move |mean| [mean - spread, mean + spread])
    };
    let values = range(made.rows.iter().flat_map(ends));
    let marks = marks(made.bins);
    let places: Vec<f64> = marks.iter().map(|(place, _)| *place).collect();
    let text = |place: &f64| {
        let mark = marks.iter().find(|(at, _)| (at - place).abs() < 1e-6);
        mark.map(|(_, text)| text.clone()).unwrap_or_default()
    };
    let last = made.rows.len() as f64 - 0.5;
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(34)
        .x_label_area_size(34)
        .y_label_area_size(76)
        .build_cartesian_2d(Marked::new(-0.5..last, places), values)?;
    let cited = &answer.cited;
    chart
        .configure_mesh()
        .x_label_formatter(&text)
        .y_desc(with_unit(cited.quantity.title(), &cited.unit))
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    let rows: Vec<(usize, &ClimatologyRow)> = made.rows.iter().enumerate().collect();
    let colour = COLOURS[0];
    for run in rows.chunk_by(|a, b| a.1.mean.is_some() && b.1.mean.is_some()) {
        let line = |factor: f64| {
            run.iter().filter_map(move |(bin, row)| {
                let spread = row.spread.unwrap_or_default();
                Some((*bin as f64, row.mean? + factor * spread))
            })
        };
        let mut edge: Vec<(f64, f64)> = line(1.0).collect();
        let other: Vec<(f64, f64)> = line(-1.0).collect();
        edge.extend(other.into_iter().rev());
        chart.draw_series([Polygon::new(edge, colour.mix(0.2).filled())])?;
        chart.draw_series(LineSeries::new(line(0.0), colour.stroke_width(2)))?;
    }
    if made.rows.len() <= DOTS_UP_TO {
        let dots = rows
            .iter()
            .filter_map(|(bin, row)| Some((*bin as f64, row.mean?)));
        chart.draw_series(dots.map(|at| Circle::new(at, 4, colour.filled())))?;
    }
    Ok(())
}

/// What is marked of the year: every bin, or the first day of each month.
fn marks(bins: CalendarBins) -> Vec<(f64, String)> {
    let short = |text: String| text.chars().take(LETTERS).collect();
    match bins {
        CalendarBins::Month => (0..12).map(|m| (m as f64, short(bins.title(m)))).collect(),
        CalendarBins::Season => (0..4).map(|s| (s as f64, bins.title(s))).collect(),
        CalendarBins::Day => (0..366)
            .filter_map(|day| {
                let title = bins.title(day);
                let month = title.strip_prefix("1 ")?;
                Some((day as f64, short(month.to_owned())))
            })
            .collect(),
    }
}
