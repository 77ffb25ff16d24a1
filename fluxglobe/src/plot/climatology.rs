//! A climatology: the mean of each part of the year with its spread.

use anyhow::Result;
use contract::analysis::{CalendarBins, Climatology, ClimatologyRow, SeriesAnalysis};
use plotters::prelude::{BLACK, ChartBuilder, Circle, Color as _, LineSeries, Polygon};

use super::chart::{place, years_of};
use super::marked::Marks;
use super::page::{self, Area, COLOURS, Failed, Words, range, with_unit};

/// Bins up to which each is marked by a dot.
const DOTS_UP_TO: usize = 12;
/// Letters of a month that are marked.
const LETTERS: usize = 3;

pub(super) fn drawn(answer: &SeriesAnalysis, made: &Climatology) -> Result<String> {
    let has_spread = made.rows.iter().any(|row| row.spread.is_some());
    let spread = if has_spread {
        ", and one standard deviation of its steps on either side"
    } else {
        "; no part of the year has two steps, so that there is no standard deviation"
    };
    let below = format!(
        "{} climatology of {}: mean{spread}",
        made.bins,
        years_of(answer, made.base)
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
    let marks = Marks::new(marks(made.bins));
    let value_marks = Marks::round(&values);
    let last = made.rows.len() as f64 - 0.5;
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(34)
        .x_label_area_size(34)
        .y_label_area_size(76)
        .build_cartesian_2d(marks.over(-0.5..last), value_marks.over(values))?;
    let cited = &answer.cited;
    chart
        .configure_mesh()
        .x_label_formatter(&|place| marks.text(place))
        .y_label_formatter(&|place| value_marks.text(place))
        .y_desc(with_unit(cited.quantity.title(), &cited.unit))
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    let rows: Vec<(usize, &ClimatologyRow)> = made.rows.iter().enumerate().collect();
    let colour = COLOURS[0];
    let at = |(bin, row): &(usize, &ClimatologyRow), factor: f64| {
        let aside = if factor == 0.0 {
            0.0
        } else {
            factor * row.spread?
        };
        Some((*bin as f64, row.mean? + aside))
    };
    let has = |place: &(usize, &ClimatologyRow), factor| at(place, factor).is_some();
    // The band is broken where there is no spread, the line where there is no mean.
    for run in rows.chunk_by(|a, b| has(a, 1.0) && has(b, 1.0)) {
        let mut edge: Vec<(f64, f64)> = run.iter().filter_map(|place| at(place, 1.0)).collect();
        edge.extend(run.iter().rev().filter_map(|place| at(place, -1.0)));
        if edge.len() > 2 {
            chart.draw_series([Polygon::new(edge, colour.mix(0.2).filled())])?;
        }
    }
    for run in rows.chunk_by(|a, b| has(a, 0.0) && has(b, 0.0)) {
        let line: Vec<(f64, f64)> = run.iter().filter_map(|place| at(place, 0.0)).collect();
        if line.len() > 1 {
            chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?;
        }
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
