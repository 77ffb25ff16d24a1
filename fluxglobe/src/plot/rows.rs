//! Statistics by rows: the mean in a band of its standard deviation, and other statistics of its unit.

use anyhow::{Result, bail};
use contract::statistics::{Statistic, StatisticsAnswer, StatisticsRow};
use plotters::prelude::{Color as _, LineSeries, PathElement};

use super::chart::{
    Point, axis_of, band, below_legend, chart, label, legend, lines, named, period,
};
use super::page::{self, COLOURS, Words, range};

pub(super) fn of_statistics(answer: &StatisticsAnswer) -> Result<String> {
    let cited = &answer.cited;
    let Split { names, others } = split(answer)?;
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
    let taken = match answer.kind.as_str() {
        "area" => "of the region",
        "line" => "along the line",
        _ => "at the place",
    };
    let below = format!(
        "{} {taken}, over each {}{}{}",
        names.join(", "),
        page::of_a_row(answer.step),
        if has_band {
            "; band: mean and one standard deviation on either side"
        } else {
            ""
        },
        if others.is_empty() {
            String::new()
        } else {
            format!("; not drawn, of another unit: {}", others.join(", "))
        }
    );
    let words = Words::of(cited, &named(&answer.geometry), below);
    let drawn: Vec<(&str, Vec<Point>)> = names.iter().map(|name| (*name, of_name(name))).collect();
    page::drawn(&words, |area| {
        let axis = axis_of(&mean);
        let lines_of = drawn.iter().map(|(_, points)| points).chain([&low, &high]);
        let values = range(lines_of.flatten().filter_map(|(_, value)| *value));
        let values = below_legend(values, drawn.len());
        let mut chart = chart(area, &axis, values, &label(cited))?;
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

/// Names of statistics.
struct Split<'a> {
    /// Those that have lines.
    names: Vec<&'a str>,
    /// Those that are drawn in no way: they have another unit.
    others: Vec<&'a str>,
}

/// What is drawn: the standard deviation is the band of a mean that is asked for, else a line.
fn split(answer: &StatisticsAnswer) -> Result<Split<'_>> {
    let (mean, spread) = (Statistic::Mean.to_string(), Statistic::Std.to_string());
    let has_mean = answer.statistics.iter().any(|one| one.name == mean);
    let all = answer.statistics.iter();
    let (own, others): (Vec<_>, Vec<_>) = all
        .filter(|one| !(has_mean && one.name == spread))
        .partition(|one| one.unit == answer.cited.unit);
    let names: Vec<&str> = own.into_iter().map(|one| one.name.as_str()).collect();
    if names.is_empty() {
        bail!(
            "a plot is of statistics in the product's unit: ask for mean, min, max, median or percentiles"
        );
    }
    if names.len() > COLOURS.len() {
        bail!(
            "a plot has colours for {} statistics, and {} were asked for: {}; leave some out",
            COLOURS.len(),
            names.len(),
            names.join(", ")
        );
    }
    let others = others.into_iter().map(|one| one.name.as_str()).collect();
    Ok(Split { names, others })
}
