//! Plots of series and of what is made of them: an answer in, SVG or PNG out. The same answer is always the same bytes.

mod chart;
mod climatology;
mod hovmoller;
mod lines;
mod marked;
mod page;
mod profile;
mod rows;
mod time_axis;
mod trend;

use anyhow::{Context as _, Result, bail};
use contract::analysis::{Hovmoller, SeriesAnalysis};
use contract::series::{PointSeries, RegionSeries};
use contract::statistics::StatisticsAnswer;
use contract::time::Period;

use crate::cli::{PlotFile, PlotForm};

/// Writes a drawing to a file.
pub(crate) fn write(file: &PlotFile, svg: &str) -> Result<()> {
    let bytes = match file.form {
        PlotForm::Svg => svg.as_bytes().to_vec(),
        PlotForm::Png => legend::raster::png(svg)?,
    };
    let written = std::fs::write(&file.path, bytes);
    written.with_context(|| format!("the plot cannot be written to {}", file.path.display()))
}

/// The series of a cell.
pub(crate) fn of_point(answer: &PointSeries) -> Result<String> {
    lines::of_point(answer)
}

/// The means over a region.
pub(crate) fn of_region(answer: &RegionSeries) -> Result<String> {
    lines::of_region(answer)
}

/// Statistics by rows: the mean in a band of its standard deviation, and other ones of its unit.
pub(crate) fn of_statistics(answer: &StatisticsAnswer) -> Result<String> {
    rows::of_statistics(answer)
}

/// Climatology, anomalies and trend, those that there are, one below the other.
pub(crate) fn of_analysis(answer: &SeriesAnalysis) -> Result<String> {
    let mut drawn = vec![];
    if let Some(made) = &answer.climatology {
        drawn.push(climatology::drawn(answer, made)?);
    }
    if let Some(made) = &answer.anomaly {
        drawn.push(lines::of_anomalies(answer, made)?);
    }
    if answer.trend.is_some() {
        drawn.push(trend::of_trend(answer)?);
    }
    if !drawn.is_empty() {
        return Ok(page::stacked(drawn));
    }
    let reasons: Vec<&str> = answer
        .refused
        .iter()
        .map(|one| one.reason.as_str())
        .collect();
    if reasons.is_empty() {
        bail!("there is a plot of a climatology, of anomalies and of a trend: ask for one of them");
    }
    bail!("there is nothing to plot: {}", reasons.join("; "))
}

/// Latitude or longitude against time, as far as there are data; of the whole period in one row its profile.
pub(crate) fn of_hovmoller(answer: &Hovmoller, data: Period) -> Result<String> {
    match answer.rows.as_slice() {
        [row] if !row.stds.is_empty() => profile::drawn(answer, row),
        _ => hovmoller::drawn(answer, data),
    }
}

#[cfg(test)]
mod tests;
