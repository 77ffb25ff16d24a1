//! A trend: the values that it is drawn through, two lines and their bands.

use anyhow::Result;
use contract::analysis::{SeriesAnalysis, Trend};
use contract::time::TimeMs;
use plotters::prelude::{Color as _, LineSeries, PathElement, Polygon, RGBColor};

use super::chart::{Point, axis_of, below_legend, chart, label, legend, lines, period, place};
use super::page::{self, Area, COLOURS, Failed, Words, range};

/// Of the values that a trend is drawn through: the first colour, half of it.
const PALE: RGBColor = RGBColor(128, 184, 216);
/// Places along which a band round a trend is drawn.
const BAND_PLACES: u32 = 100;

pub(super) fn of_trend(answer: &SeriesAnalysis) -> Result<String> {
    let trend = answer.trend.as_ref().expect("the caller has looked");
    let below = format!(
        "through values of step {}{}; bands are the 95 % intervals of the slopes",
        trend.step,
        match trend.parts_taken_off() {
            Some(part) => format!(", the mean of each {part} taken off"),
            None => String::new(),
        }
    );
    let words = Words::of(&answer.cited, &place(answer), below);
    page::drawn(&words, |area| drawn_trend(area, answer, trend))
}

/// A line through `at_mid` in the middle, and how steep it may be.
struct Line {
    name: String,
    at_mid: f64,
    slope: f64,
    between: Option<(f64, f64)>,
    colour: RGBColor,
}

#[expect(
    clippy::too_many_lines,
    reason = "one picture, drawn from top to bottom"
)]
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
    let values = below_legend(values, lines_of.len());
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
