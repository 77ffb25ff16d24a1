//! Latitude or longitude against time, in the colours that maps of the quantity have.

use anyhow::Result;
use contract::analysis::{Along, Hovmoller};
use contract::colour::{Palette, TransferFunction};
use contract::time::{Period, TimeMs};
use legend::ticks;
use plotters::prelude::{
    BLACK, ChartBuilder, Color as _, IntoFont as _, PathElement, RGBColor, Rectangle, Text,
    TextStyle,
};

use super::chart::shares_of;
use super::marked::Marks;
use super::page::{self, Area, Failed, SIZE, Words, with_unit};
use super::time_axis::TimeAxis;

/// Width of the bar of colours with its numbers, pixels.
const BAR_AREA_PX: u32 = 110;
/// Steps of the bar.
const BAR_STEPS: u32 = 128;
/// Share of means at either end that may lie beyond the colours.
const BEYOND: f64 = 0.01;
/// Of bands without data.
const NO_DATA: RGBColor = RGBColor(214, 214, 214);

/// A range of shown values and its colours.
struct Colours {
    low: f64,
    high: f64,
    transfer: TransferFunction,
}

impl Colours {
    /// The palette of the quantity over what is there, about zero where it has a middle.
    fn of(answer: &Hovmoller) -> Self {
        let palette = TransferFunction::default_for(answer.cited.quantity).palette;
        let mut means: Vec<f64> = answer
            .rows
            .iter()
            .flat_map(|row| row.means.iter().copied().flatten())
            .collect();
        means.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| {
            let rank = (share * (means.len().max(1) - 1) as f64).round() as usize;
            means.get(rank).copied().unwrap_or_default()
        };
        let (low, high) = (at(BEYOND), at(1.0 - BEYOND));
        let (low, high) = around(low, high, palette);
        Self {
            low,
            high,
            transfer: TransferFunction::linear(palette, low, high),
        }
    }

    fn of_value(&self, value: f64) -> RGBColor {
        let [r, g, b] = self
            .transfer
            .colour(value)
            .map(|share| (share * 255.0).round() as u8);
        RGBColor(r, g, b)
    }
}

/// Ends that are apart, and about zero for a palette with a middle.
fn around(low: f64, high: f64, palette: Palette) -> (f64, f64) {
    let (low, high) = if palette.is_diverging() {
        let most = low.abs().max(high.abs());
        (-most, most)
    } else {
        (low, high)
    };
    let least = low.abs().max(high.abs()).max(1e-9) * 1e-6;
    if high - low > least {
        (low, high)
    } else {
        (low - least, high + least)
    }
}

/// The axis of time ends where `data` do: the first and the last row may reach beyond them.
pub(super) fn drawn(answer: &Hovmoller, data: Period) -> Result<String> {
    let what = match answer.along {
        Along::Lat => "latitude against time",
        Along::Lon => "longitude against time",
    };
    let [west, south, east, north] = answer.bounds_deg;
    let below = format!(
        "means of bands of {} degrees{}, over each {}, {west} to {east} degrees east, {south} to {north} degrees north; gray: {}",
        answer.band_deg,
        shares_of(answer),
        page::of_a_row(answer.step),
        no_data(answer)
    );
    let words = Words::of(&answer.cited, what, below);
    let colours = Colours::of(answer);
    page::drawn(&words, |area| {
        let (left, right) = area.split_horizontally(SIZE.0 - BAR_AREA_PX);
        chart(&left, answer, data, &colours)?;
        bar(&right, answer, &colours)
    })
}

/// What a band without a mean is.
fn no_data(answer: &Hovmoller) -> String {
    if answer.left_out_count == 0 {
        return "no data".to_owned();
    }
    let least = answer.min_coverage_percent;
    format!("no data, or a coverage of less than {least} %")
}

fn chart(
    area: &Area<'_>,
    answer: &Hovmoller,
    data: Period,
    colours: &Colours,
) -> Result<(), Failed> {
    let (first, last) = (&answer.rows[0], &answer.rows[answer.rows.len() - 1]);
    let within = |time: TimeMs| time.clamp(data.start, data.end);
    let axis = TimeAxis::over(within(first.start), within(last.end));
    let (low, high) = (
        answer.bands[0].low_deg,
        answer.bands[answer.bands.len() - 1].high_deg,
    );
    let marks = Marks::round(&(low..high));
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(10)
        .x_label_area_size(34)
        .y_label_area_size(76)
        .build_cartesian_2d(axis.marks.over(axis.range.clone()), marks.over(low..high))?;
    let cells = answer.rows.iter().flat_map(|row| {
        let (from, to) = (axis.at(within(row.start)), axis.at(within(row.end)));
        row.means
            .iter()
            .zip(&answer.bands)
            .map(move |(mean, band)| {
                let colour = mean.map_or(NO_DATA, |mean| colours.of_value(mean));
                Rectangle::new([(from, band.low_deg), (to, band.high_deg)], colour.filled())
            })
    });
    chart.draw_series(cells)?;
    let label = match answer.along {
        Along::Lat => "degrees north",
        Along::Lon => "degrees east",
    };
    chart
        .configure_mesh()
        .disable_mesh()
        .x_label_formatter(&|place| axis.marks.text(place))
        .y_label_formatter(&|place| marks.text(place))
        .y_desc(label)
        .axis_desc_style(("sans-serif", 15))
        .label_style(("sans-serif", 13))
        .draw()?;
    Ok(())
}

/// The bar of colours, its round values and its unit.
fn bar(area: &Area<'_>, answer: &Hovmoller, colours: &Colours) -> Result<(), Failed> {
    let height = f64::from(area.dim_in_pixel().1) - 34.0 - 26.0;
    let y = |share: f64| (26.0 + height * (1.0 - share)).round() as i32;
    for step in 0..BAR_STEPS {
        let [from, to] = [step, step + 1].map(|step| f64::from(step) / f64::from(BAR_STEPS));
        let value = colours.low + (colours.high - colours.low) * 0.5 * (from + to);
        let corners = [(6, y(to)), (26, y(from))];
        area.draw(&Rectangle::new(corners, colours.of_value(value).filled()))?;
    }
    let style = |size: i32| TextStyle::from(("sans-serif", size).into_font());
    let marks = ticks::of(colours.low, colours.high);
    for (mark, text) in marks.iter().zip(ticks::texts(&marks)) {
        let at = y((mark - colours.low) / (colours.high - colours.low));
        area.draw(&PathElement::new(
            vec![(26, at), (31, at)],
            BLACK.stroke_width(1),
        ))?;
        area.draw(&Text::new(text, (35, at - 7), style(13)))?;
    }
    let unit = with_unit("", &answer.cited.unit);
    area.draw(&Text::new(unit.trim().to_owned(), (0, 4), style(13)))?;
    Ok(())
}
