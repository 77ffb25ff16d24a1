//! A profile of bands: the mean of each over the whole period with its spread, against latitude or longitude.

use anyhow::Result;
use contract::analysis::{Along, Hovmoller, HovmollerRow};
use plotters::prelude::{BLACK, ChartBuilder, Circle, Color as _, LineSeries, Polygon};

use super::chart::shares_of;
use super::marked::Marks;
use super::page::{self, Area, COLOURS, Failed, Words, range, with_unit};

/// Bands up to which each is marked by a dot.
const DOTS_UP_TO: usize = 90;

/// The middle of a band, its mean and its standard deviation.
type Place = (f64, f64, f64);

pub(super) fn drawn(answer: &Hovmoller, row: &HovmollerRow) -> Result<String> {
    let what = match answer.along {
        Along::Lat => "profile of latitude",
        Along::Lon => "profile of longitude",
    };
    let [west, south, east, north] = answer.bounds_deg;
    let below = format!(
        "bands of {} degrees{}, {west} to {east} degrees east, {south} to {north} degrees north: mean, and one standard deviation by area \
         and time on either side",
        answer.band_deg,
        shares_of(answer)
    );
    let words = Words::of(&answer.cited, what, below);
    page::drawn(&words, |area| on(area, answer, row))
}

fn on(area: &Area<'_>, answer: &Hovmoller, row: &HovmollerRow) -> Result<(), Failed> {
    let bands = answer.bands.iter().zip(row.means.iter().zip(&row.stds));
    let places: Vec<Option<Place>> = bands
        .map(|(band, (mean, std))| Some((0.5 * (band.low_deg + band.high_deg), (*mean)?, (*std)?)))
        .collect();
    let ends = |(_, mean, std): &Place| [mean - std, mean + std];
    let values = range(places.iter().flatten().flat_map(ends));
    let across = answer.bands[0].low_deg..answer.bands[answer.bands.len() - 1].high_deg;
    let (across_marks, value_marks) = (Marks::round(&across), Marks::round(&values));
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(34)
        .x_label_area_size(54)
        .y_label_area_size(76)
        .build_cartesian_2d(across_marks.over(across), value_marks.over(values))?;
    let cited = &answer.cited;
    chart
        .configure_mesh()
        .x_label_formatter(&|place| across_marks.text(place))
        .y_label_formatter(&|place| value_marks.text(place))
        .x_desc(match answer.along {
            Along::Lat => "degrees north",
            Along::Lon => "degrees east",
        })
        .y_desc(with_unit(cited.quantity.title(), &cited.unit))
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    let colour = COLOURS[0];
    // Bands without data break the line.
    for run in places.split(Option::is_none).filter(|run| !run.is_empty()) {
        let line = |factor: f64| {
            let own = run.iter().flatten();
            own.map(move |(middle, mean, std)| (*middle, mean + factor * std))
        };
        let mut edge: Vec<(f64, f64)> = line(1.0).collect();
        let other: Vec<(f64, f64)> = line(-1.0).collect();
        edge.extend(other.into_iter().rev());
        chart.draw_series([Polygon::new(edge, colour.mix(0.2).filled())])?;
        if run.len() > 1 {
            chart.draw_series(LineSeries::new(line(0.0), colour.stroke_width(2)))?;
        }
    }
    if places.len() <= DOTS_UP_TO {
        let dots = places.iter().flatten();
        let dots = dots.map(|(middle, mean, _)| Circle::new((*middle, *mean), 3, colour.filled()));
        chart.draw_series(dots)?;
    }
    Ok(())
}
