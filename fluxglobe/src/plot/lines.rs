//! Series, anomalies and trends as lines against time.

use anyhow::{Result, bail};
use contract::analysis::{Anomalies, Cited, SeriesAnalysis, Trend};
use contract::series::{PointSeries, RegionSeries};
use contract::statistics::{Statistic, StatisticsAnswer, StatisticsRow};
use contract::time::{Period, TimeMs};
use plotters::chart::ChartContext;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::{
    BLACK, Cartesian2d, ChartBuilder, Circle, Color as _, LineSeries, PathElement, Polygon,
    RGBColor, Rectangle, SVGBackend, SeriesLabelPosition, WHITE,
};

use super::marked::Marked;
use super::page::{self, Area, COLOURS, Failed, Words, range, with_unit};
use super::time_axis::TimeAxis;

/// Steps up to which each is marked by a dot.
const DOTS_UP_TO: usize = 400;
/// Of the values that a trend is drawn through: the first colour, half of it.
const PALE: RGBColor = RGBColor(128, 184, 216);
/// Places along which a band round a trend is drawn.
const BAND_PLACES: u32 = 100;

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Marked, RangedCoordf64>>;

/// A value in the middle of a step; none where there is a gap.
type Point = (Period, Option<f64>);

pub(super) fn of_point(answer: &PointSeries) -> Result<String> {
    let cited = Cited {
        product: answer.product.clone(),
        manifest: answer.manifest.clone(),
        title: answer.title.clone(),
        source: answer.source.clone(),
        synthetic: answer.synthetic,
        quantity: answer.quantity,
        unit: answer.unit.clone(),
    };
    let points: Vec<Point> = answer
        .series
        .iter()
        .map(|step| (period(step.start, step.end), step.value))
        .collect();
    let place = format!(
        "cell around {:.4}, {:.4}",
        answer.cell.lon_deg, answer.cell.lat_deg
    );
    series(&cited, &place, &points)
}

pub(super) fn of_region(answer: &RegionSeries) -> Result<String> {
    let cited = Cited {
        product: answer.product.clone(),
        manifest: answer.manifest.clone(),
        title: answer.title.clone(),
        source: answer.source.clone(),
        synthetic: answer.synthetic,
        quantity: answer.quantity,
        unit: answer.unit.clone(),
    };
    let points: Vec<Point> = answer
        .series
        .iter()
        .map(|step| (period(step.start, step.end), step.mean))
        .collect();
    series(
        &cited,
        &format!("mean over {}", named(&answer.region)),
        &points,
    )
}

pub(super) fn of_statistics(answer: &StatisticsAnswer) -> Result<String> {
    let cited = Cited {
        product: answer.product.clone(),
        manifest: answer.manifest.clone(),
        title: answer.title.clone(),
        source: answer.source.clone(),
        synthetic: answer.synthetic,
        quantity: answer.quantity,
        unit: answer.unit.clone(),
    };
    let is_spread = |name: &str| name == Statistic::Std.to_string();
    let all = answer.statistics.iter();
    let names: Vec<&str> = all
        .filter(|one| one.unit == answer.unit && !is_spread(&one.name))
        .map(|one| one.name.as_str())
        .take(COLOURS.len())
        .collect();
    if names.is_empty() {
        bail!(
            "a plot is of statistics in the product's unit: ask for mean, min, max, median or percentiles"
        );
    }
    let of_name = |name: &str| -> Vec<Point> {
        let value = |row: &StatisticsRow| row.values.get(name).copied().flatten();
        let rows = answer.rows.iter();
        rows.map(|row| (period(row.start, row.end), value(row)))
            .collect()
    };
    let (mean, spread) = (
        of_name(&Statistic::Mean.to_string()),
        of_name(&Statistic::Std.to_string()),
    );
    let ends = |sign: f64| -> Vec<Point> {
        let both = mean.iter().zip(&spread);
        both.map(|((period, mean), (_, spread))| {
            (
                *period,
                mean.zip(*spread).map(|(mean, spread)| mean + sign * spread),
            )
        })
        .collect()
    };
    let (low, high) = (ends(-1.0), ends(1.0));
    let has_band = low.iter().any(|(_, value)| value.is_some());
    let below = format!(
        "{} of {}, a row a {}{}",
        names.join(", "),
        answer.kind,
        answer.step,
        if has_band {
            "; band: mean and one standard deviation on either side"
        } else {
            ""
        }
    );
    let words = Words::of(&cited, &named(&answer.geometry), below);
    let drawn: Vec<(&str, Vec<Point>)> = names.iter().map(|name| (*name, of_name(name))).collect();
    page::drawn(&words, |area| {
        let axis = axis_of(&mean);
        let lines_of = drawn.iter().map(|(_, points)| points).chain([&low, &high]);
        let values = range(lines_of.flatten().filter_map(|(_, value)| *value));
        let mut chart = chart(area, &axis, values, &label(&cited))?;
        band(&mut chart, &axis, &low, &high)?;
        for ((name, points), colour) in drawn.iter().zip(COLOURS) {
            lines(&mut chart, &axis, points, colour)?;
            let nothing = LineSeries::new(std::iter::empty(), colour.stroke_width(2));
            let drawn = chart.draw_series(nothing)?;
            drawn.label(*name).legend(move |(x, y)| {
                PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2))
            });
        }
        legend(&mut chart)
    })
}

/// What lies between two lines, broken where either has a gap.
fn band(
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

/// What the lines are, in the upper left corner.
fn legend(chart: &mut Chart<'_, '_>) -> Result<(), Failed> {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.85))
        .label_font(("sans-serif", 14))
        .draw()?;
    Ok(())
}

fn period(start: TimeMs, end: TimeMs) -> Period {
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
        "anomaly from the {} climatology of {}; above it red, below it blue",
        made.bins, made.base
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
            let value = (*value)?;
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

pub(super) fn of_trend(answer: &SeriesAnalysis) -> Result<String> {
    let trend = answer.trend.as_ref().expect("the caller has looked");
    let below = format!(
        "through values of step {}{}; bands are the 95 % intervals of the slopes",
        trend.step,
        if trend.deseasonalised {
            ", the mean of each calendar month taken off"
        } else {
            ""
        }
    );
    let words = Words::of(&answer.cited, &place(answer), below);
    page::drawn(&words, |area| drawn_trend(area, answer, trend))
}

/// Where a series is taken, for people.
pub(super) fn place(answer: &SeriesAnalysis) -> String {
    match (&answer.place.region, &answer.place.cell) {
        (Some(region), _) => format!("mean over {}", named(region)),
        (None, Some(cell)) => format!("cell around {:.4}, {:.4}", cell.lon_deg, cell.lat_deg),
        (None, None) => String::new(),
    }
}

/// A line through `at_mid` in the middle, and how steep it may be.
struct Line {
    name: String,
    at_mid: f64,
    slope: f64,
    between: Option<(f64, f64)>,
    colour: RGBColor,
}

fn drawn_trend(area: &Area<'_>, answer: &SeriesAnalysis, trend: &Trend) -> Result<(), Failed> {
    let points: Vec<Point> = trend
        .values
        .iter()
        .map(|value| (period(value.start, value.end), Some(value.value)))
        .collect();
    let axis = axis_of(&points);
    let decades =
        |time: TimeMs| (time.ms() - trend.mid.ms()) as f64 / (10.0 * 365.25 * 86_400_000.0);
    let chance = |p: f64| {
        if p < 1e-4 {
            "p < 0.0001".to_owned()
        } else {
            format!("p = {p:.4}")
        }
    };
    let (squares, pairs) = (&trend.least_squares, &trend.theil_sen);
    let p_squares = squares
        .p_value
        .map_or_else(|| "p unknown".to_owned(), chance);
    let lines_of = [
        Line {
            name: format!(
                "Theil-Sen {:+.4} {}, {}",
                pairs.slope_per_decade,
                trend.slope_unit,
                chance(trend.mann_kendall.p_value)
            ),
            at_mid: pairs.at_mid,
            slope: pairs.slope_per_decade,
            between: Some((pairs.lower_per_decade, pairs.upper_per_decade)),
            colour: COLOURS[1],
        },
        Line {
            name: format!(
                "least squares {:+.4} {}, {p_squares}",
                squares.slope_per_decade, trend.slope_unit
            ),
            at_mid: trend.mean,
            slope: squares.slope_per_decade,
            between: squares.lower_per_decade.zip(squares.upper_per_decade),
            colour: COLOURS[2],
        },
    ];
    let values = range(points.iter().filter_map(|(_, value)| *value));
    let mut chart = chart(area, &axis, values, &label(&answer.cited))?;
    lines(&mut chart, &axis, &points, PALE)?;
    let (first, last) = (points[0].0.mid(), points[points.len() - 1].0.mid());
    let times: Vec<TimeMs> = (0..=BAND_PLACES)
        .filter_map(|i| {
            let share = f64::from(i) / f64::from(BAND_PLACES);
            TimeMs::new(first.ms() + ((last.ms() - first.ms()) as f64 * share) as i64).ok()
        })
        .collect();
    for line in lines_of {
        let colour = line.colour;
        let at_mid = line.at_mid;
        let at = |slope: f64| -> Vec<(f64, f64)> {
            let of = |time: &TimeMs| (axis.at(*time), at_mid + slope * decades(*time));
            times.iter().map(of).collect()
        };
        if let Some((low, high)) = line.between {
            let mut edge = at(low);
            edge.extend(at(high).into_iter().rev());
            chart.draw_series([Polygon::new(edge, colour.mix(0.18).filled())])?;
        }
        let drawn = chart.draw_series(LineSeries::new(at(line.slope), colour.stroke_width(2)))?;
        drawn.label(line.name).legend(move |(x, y)| {
            PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2))
        });
    }
    legend(&mut chart)
}

fn label(cited: &Cited) -> String {
    with_unit(cited.quantity.title(), &cited.unit)
}

fn axis_of(points: &[Point]) -> TimeAxis {
    let (first, last) = (points[0].0, points[points.len() - 1].0);
    TimeAxis::over(first.start, last.end)
}

/// A chart with its axes.
fn chart<'a, 'b>(
    area: &'a Area<'b>,
    axis: &TimeAxis,
    values: std::ops::Range<f64>,
    label: &str,
) -> Result<Chart<'a, 'b>, Failed> {
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(34)
        .x_label_area_size(34)
        .y_label_area_size(76)
        .build_cartesian_2d(Marked::new(axis.range.clone(), axis.marks.clone()), values)?;
    chart
        .configure_mesh()
        .x_label_formatter(&|place| axis.text(place))
        .y_desc(label)
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    Ok(chart)
}

/// A line through the middles of steps, broken where there is a gap; single steps are dots.
fn lines(
    chart: &mut Chart<'_, '_>,
    axis: &TimeAxis,
    points: &[Point],
    colour: RGBColor,
) -> Result<(), Failed> {
    let at = |(period, value): &Point| value.map(|value| (axis.at(period.mid()), value));
    for run in points.chunk_by(|a, b| a.1.is_some() && b.1.is_some()) {
        let run: Vec<(f64, f64)> = run.iter().filter_map(at).collect();
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

#[cfg(test)]
mod tests;
