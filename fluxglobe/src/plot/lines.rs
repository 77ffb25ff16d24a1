//! Series as lines and anomalies as bars against time.

use anyhow::Result;
use contract::analysis::{Anomalies, SeriesAnalysis};
use contract::cited::Cited;
use contract::series::{PointSeries, RegionSeries};
use plotters::prelude::{BLACK, Color as _, LineSeries, Rectangle};

use crate::figures::middle;

use super::chart::{Point, axis_of, chart, label, lines, named, period, place, years_of};
use super::page::{self, COLOURS, Words, range, with_unit};

pub(super) fn of_point(answer: &PointSeries) -> Result<String> {
    let points: Vec<Point> = answer
        .series
        .iter()
        .map(|step| (period(step.start, step.end), step.value))
        .collect();
    let place = format!("cell around {}", middle(&answer.cell));
    series(&answer.cited, &place, &points)
}

pub(super) fn of_region(answer: &RegionSeries) -> Result<String> {
    let points: Vec<Point> = answer
        .series
        .iter()
        .map(|step| (period(step.start, step.end), step.mean))
        .collect();
    series(
        &answer.cited,
        &format!("mean over {}", named(&answer.region)),
        &points,
    )
}

fn series(cited: &Cited, place: &str, points: &[Point]) -> Result<String> {
    let with_data = points.iter().filter(|(_, value)| value.is_some()).count();
    let below = format!("{with_data} of {} steps hold data", points.len());
    let words = Words::of(cited, place, below);
    page::drawn(&words, |area| {
        let axis = axis_of(points);
        let values = range(points.iter().filter_map(|(_, value)| *value));
        let mut chart = chart(area, &axis, values, &label(cited))?;
        lines(&mut chart, &axis, points, COLOURS[0])
    })
}

pub(super) fn of_anomalies(answer: &SeriesAnalysis, made: &Anomalies) -> Result<String> {
    let below = format!(
        "anomaly from the {} climatology of {}; above it orange, below it blue",
        made.bins,
        years_of(answer, made.base)
    );
    let words = Words::of(&answer.cited, &place(answer), below);
    let points: Vec<Point> = made
        .rows
        .iter()
        .map(|row| (period(row.start, row.end), row.anomaly))
        .collect();
    page::drawn(&words, |area| {
        let axis = axis_of(&points);
        let values = range(points.iter().filter_map(|(_, value)| *value).chain([0.0]));
        let unit = &answer.cited.unit;
        let mut chart = chart(area, &axis, values, &with_unit("anomaly", unit))?;
        let bars = points.iter().filter_map(|(period, value)| {
            // What is zero has no bar.
            let value = (*value).filter(|value| *value != 0.0)?;
            let colour = if value < 0.0 { COLOURS[0] } else { COLOURS[1] };
            let corners = [(axis.at(period.start), 0.0), (axis.at(period.end), value)];
            Some(Rectangle::new(corners, colour.filled()))
        });
        chart.draw_series(bars)?;
        let zero = [(axis.range.start, 0.0), (axis.range.end, 0.0)];
        chart.draw_series(LineSeries::new(zero, BLACK.stroke_width(1)))?;
        Ok(())
    })
}

#[cfg(test)]
mod tests;
