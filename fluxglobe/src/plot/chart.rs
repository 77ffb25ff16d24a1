//! A chart of values against time: its axes, lines that break at gaps, and bands.

use std::ops::Range;

use contract::analysis::{BasePeriod, Hovmoller, SeriesAnalysis};
use contract::cited::Cited;
use contract::time::{Period, TimeMs};
use plotters::chart::ChartContext;
use plotters::prelude::{
    BLACK, Cartesian2d, ChartBuilder, Circle, Color as _, LineSeries, Polygon, RGBColor,
    SVGBackend, SeriesLabelPosition, WHITE,
};

use crate::figures::middle;

use super::marked::{Marked, Marks};
use super::page::{Area, COLOURS, Failed, with_unit};
use super::time_axis::TimeAxis;

/// Steps up to which each is marked by a dot.
const DOTS_UP_TO: usize = 400;

/// A chart on a part of a page.
pub(super) type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Marked, Marked>>;

/// A value in the middle of a step; none where there is a gap.
pub(super) type Point = (Period, Option<f64>);

pub(super) fn period(start: TimeMs, end: TimeMs) -> Period {
    Period { start, end }
}

/// A region's name, short.
pub(super) fn named(region: &str) -> String {
    let is_long = region.chars().count() > 60;
    let short: String = region.chars().take(60).collect();
    if is_long {
        format!("{short}…")
    } else {
        short
    }
}

/// The polygons that bands are made of, for people; nothing of a box, which is told by its bounds.
pub(super) fn shares_of(answer: &Hovmoller) -> String {
    let region = answer.region.as_deref();
    region.map_or_else(String::new, |region| format!(" of {}", named(region)))
}

/// Where a series is taken, for people.
pub(super) fn place(answer: &SeriesAnalysis) -> String {
    let place = &answer.place;
    match (&place.region, &place.line, &place.cell) {
        (Some(region), _, _) => format!("mean over {}", named(region)),
        (None, Some(line), _) => format!("mean along {}", named(line)),
        (None, None, Some(cell)) => {
            format!("cell around {}", middle(cell))
        }
        (None, None, None) => String::new(),
    }
}

/// The years of a climatology, and of which of them the series has steps where these are not all.
pub(super) fn years_of(answer: &SeriesAnalysis, base: BasePeriod) -> String {
    match base.touched_by(period(answer.start, answer.end)) {
        Some(held) if held != base => format!("{base} (steps in {held} alone)"),
        _ => base.to_string(),
    }
}

pub(super) fn label(cited: &Cited) -> String {
    with_unit(cited.quantity.title(), &cited.unit)
}

pub(super) fn axis_of(points: &[Point]) -> TimeAxis {
    let (first, last) = (points[0].0, points[points.len() - 1].0);
    TimeAxis::over(first.start, last.end)
}

/// A chart with its axes.
pub(super) fn chart<'a, 'b>(
    area: &'a Area<'b>,
    axis: &TimeAxis,
    values: Range<f64>,
    label: &str,
) -> Result<Chart<'a, 'b>, Failed> {
    let marks = Marks::round(&values);
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(34)
        .x_label_area_size(34)
        .y_label_area_size(76)
        .build_cartesian_2d(axis.marks.over(axis.range.clone()), marks.over(values))?;
    chart
        .configure_mesh()
        .x_label_formatter(&|place| axis.marks.text(place))
        .y_label_formatter(&|place| marks.text(place))
        .y_desc(label)
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    Ok(chart)
}

/// A line through the middles of steps, broken where there is a gap; single steps are dots.
pub(super) fn lines(
    chart: &mut Chart<'_, '_>,
    axis: &TimeAxis,
    points: &[Point],
    colour: RGBColor,
) -> Result<(), Failed> {
    let at = |(period, value): &Point| value.map(|value| (axis.at(period.mid()), value));
    for run in points.chunk_by(|a, b| a.1.is_some() && b.1.is_some()) {
        let run: Vec<(f64, f64)> = run.iter().filter_map(at).collect();
        // A step by itself is a dot.
        if run.len() < 2 {
            continue;
        }
        chart.draw_series(LineSeries::new(run, colour.stroke_width(2)))?;
    }
    let is_alone = |i: usize| {
        let is_gap = |i: Option<usize>| i.and_then(|i| points.get(i)).is_none_or(|p| p.1.is_none());
        is_gap(i.checked_sub(1)) && is_gap(Some(i + 1))
    };
    let all = points.len() <= DOTS_UP_TO;
    let dots = points.iter().enumerate();
    let dots = dots
        .filter(|(i, _)| all || is_alone(*i))
        .filter_map(|(_, point)| at(point));
    chart.draw_series(dots.map(|at| Circle::new(at, 2, colour.filled())))?;
    Ok(())
}

/// What lies between two lines, broken where either has a gap.
pub(super) fn band(
    chart: &mut Chart<'_, '_>,
    axis: &TimeAxis,
    low: &[Point],
    high: &[Point],
) -> Result<(), Failed> {
    let at = |(period, value): &Point| value.map(|value| (axis.at(period.mid()), value));
    let both: Vec<(&Point, &Point)> = low.iter().zip(high).collect();
    for run in both.chunk_by(|a, b| a.0.1.is_some() && b.0.1.is_some()) {
        let mut edge: Vec<(f64, f64)> = run.iter().filter_map(|(low, _)| at(low)).collect();
        edge.extend(run.iter().rev().filter_map(|(_, high)| at(high)));
        if edge.len() > 2 {
            chart.draw_series([Polygon::new(edge, COLOURS[0].mix(0.2).filled())])?;
        }
    }
    Ok(())
}

/// Values with room above them for a legend of so many lines: it would hide what lies behind it.
pub(super) fn below_legend(values: Range<f64>, line_count: usize) -> Range<f64> {
    // Shares of a chart's height: a line's, of what is around all of them, and the largest.
    const LINE: f64 = 0.05;
    const AROUND: f64 = 0.04;
    const MOST: f64 = 0.5;
    let share = (AROUND + LINE * line_count as f64).min(MOST);
    let room = (values.end - values.start) * share / (1.0 - share);
    values.start..values.end + room
}

/// What the lines are, in the upper left corner.
pub(super) fn legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>) -> Result<(), Failed> {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.85))
        .label_font(("sans-serif", 14))
        .draw()?;
    Ok(())
}
