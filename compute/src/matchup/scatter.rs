//! A match-up as a picture: gridded over observed values with the line where both are equal, as SVG.

use plotters::data::float::FloatPrettyPrinter;
use plotters::prelude::{
    BLACK, ChartBuilder, Circle, Color as _, IntoDrawingArea as _, IntoFont as _, LineSeries,
    RGBColor, SVGBackend, Text, TextStyle, WHITE,
};

use super::Matchup;
use crate::ComputeError;

/// Width and height, pixels.
const SIZE: (u32, u32) = (720, 780);
/// Most points that are drawn: a picture of more would not show more.
const MAX_POINTS: usize = 20_000;
/// Share of the range that is left free around the points.
const MARGIN: f64 = 0.05;
const POINT: RGBColor = RGBColor(0, 90, 156);
/// Room above the chart, pixels: what stands there hides no point.
const HEAD_PX: u32 = 76;
/// Left of what stands there, pixels.
const LEFT_PX: i32 = 80;

/// The picture. Of more than 20 000 pairs every n-th is drawn, and the picture says so.
pub fn scatter_svg(matchup: &Matchup) -> Result<String, ComputeError> {
    let mut svg = String::new();
    draw(matchup, &mut svg).map_err(|e| ComputeError::inconsistent("a scatter plot", e))?;
    Ok(svg)
}

fn draw(matchup: &Matchup, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let every = matchup.rows.len().div_ceil(MAX_POINTS).max(1);
    let points = || {
        let drawn = matchup.rows.iter().step_by(every);
        drawn.map(|row| (row.observed, row.gridded))
    };
    let (low, high) = range(points().flat_map(|(a, b)| [a, b]));
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let synthetic = if matchup.synthetic {
        " (synthetic)"
    } else {
        ""
    };
    let caption = format!("{}{synthetic}", plain(&matchup.title));
    let (head, rest) = area.split_vertically(HEAD_PX);
    let legend = legend(matchup, every).join(", ");
    for (text, size, top) in [(caption, 20, 14), (legend, 15, 46)] {
        let style = TextStyle::from(("sans-serif", size).into_font());
        head.draw(&Text::new(text, (LEFT_PX, top), style))?;
    }
    let mut chart = ChartBuilder::on(&rest)
        .margin(16)
        .margin_top(0)
        .x_label_area_size(48)
        .y_label_area_size(64)
        .build_cartesian_2d(low..high, low..high)?;
    let unit = if matchup.unit.is_empty() {
        String::new()
    } else {
        format!(" ({})", matchup.unit)
    };
    let printer = FloatPrettyPrinter {
        allow_scientific: false,
        min_decimal: 1,
        max_decimal: 5,
    };
    // A mark at zero is beside it by rounding, from below as well: its text would be "-0.0".
    let nothing = (high - low) * 1e-9;
    let mark = |place: &f64| printer.print(if place.abs() < nothing { 0.0 } else { *place });
    chart
        .configure_mesh()
        .x_label_formatter(&mark)
        .y_label_formatter(&mark)
        .x_desc(format!("{} observed{unit}", plain(&matchup.property)))
        .y_desc(format!("{}{unit}", matchup.manifest))
        .axis_desc_style(("sans-serif", 16))
        .draw()?;
    chart.draw_series(LineSeries::new([(low, low), (high, high)], &BLACK))?;
    chart.draw_series(points().map(|point| Circle::new(point, 2, POINT.mix(0.5).filled())))?;
    area.present()?;
    Ok(())
}

/// What is said above the chart.
fn legend(matchup: &Matchup, every: usize) -> Vec<String> {
    let s = &matchup.statistics;
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
    let mut lines = vec![
        format!("N = {}", s.count),
        format!("bias = {} {}", number(s.bias), matchup.unit),
        format!("RMSE = {} {}", number(s.rmse), matchup.unit),
        format!("r = {}", number(s.correlation)),
    ];
    if every > 1 {
        lines.push(format!("one pair in {every} is drawn"));
    }
    lines
}

/// The range of both axes, with room around it; never empty.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.fold(start, |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    let room = ((high - low) * MARGIN).max(low.abs().max(1.0) * 1e-3);
    (low - room, high + room)
}

/// Text from outside without control characters; the drawing library escapes what means something in SVG.
fn plain(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(120).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matchup::statistics::Statistics;
    use crate::matchup::{LeftOut, MatchRow, TimeMatch};

    fn matchup(count: usize, title: &str) -> Matchup {
        let row = |i: usize| MatchRow {
            dataset: "d".parse().unwrap(),
            platform: "p".to_owned(),
            time: "2010-01-01".parse().unwrap(),
            lon_deg: 0.0,
            lat_deg: 0.0,
            depth_m: 0.0,
            observed: i as f64,
            gridded: i as f64 + 1.0,
            distance_km: 1.0,
            hours: 0.0,
        };
        let rows: Vec<MatchRow> = (0..count).map(row).collect();
        Matchup {
            product: "sst".parse().unwrap(),
            manifest: "sst@1-00000000".parse().unwrap(),
            title: title.to_owned(),
            source: String::new(),
            synthetic: true,
            property: "sea_surface_temperature".to_owned(),
            unit: "°C".to_owned(),
            time_match: TimeMatch::Nearest,
            statistics: Statistics::of(&rows.iter().map(|r| (r.observed, r.gridded))),
            left_out: LeftOut::default(),
            fit: None,
            rows,
        }
    }

    #[test]
    fn the_picture_has_points_line_labels_and_units() {
        let svg = scatter_svg(&matchup(3, "Sea <b>& sky")).unwrap();
        assert_eq!(svg.matches("<circle").count(), 3);
        for text in [
            "observed (°C)",
            "sst@1-00000000",
            "N = 3",
            "bias = 1.000",
            "(synthetic)",
        ] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        assert!(!svg.contains("<b>"), "a title is text, not markup");
        assert_eq!(svg, scatter_svg(&matchup(3, "Sea <b>& sky")).unwrap());
    }

    /// The highest point is the first one, in the corner at the left.
    #[test]
    fn what_is_said_hides_no_point() {
        let mut made = matchup(20, "");
        made.rows[0].gridded = 100.0;
        let svg = scatter_svg(&made).unwrap();
        let number = |line: &str, name: &str| -> f64 {
            let (_, rest) = line.split_once(&format!(" {name}=\"")).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        let points = svg.lines().filter(|line| line.starts_with("<circle"));
        let highest = points.map(|at| number(at, "cy")).fold(f64::MAX, f64::min);
        let (before, _said) = svg.split_once("N = 20").unwrap();
        let said = before.lines().rfind(|line| line.starts_with("<text"));
        // The place of a text is its foot or its head: it is 15 pixels high.
        assert!(number(said.unwrap(), "y") + 15.0 < highest, "{highest}");
        for row in &mut made.rows {
            row.observed -= 10.0;
            row.gridded -= 10.0;
        }
        let around_zero = scatter_svg(&made).unwrap();
        assert!(around_zero.contains("\n0.0\n") && !around_zero.contains("-0.0"));
    }

    #[test]
    fn nothing_and_very_much_can_be_drawn() {
        assert!(scatter_svg(&matchup(0, "")).unwrap().contains("N = 0"));
        let svg = scatter_svg(&matchup(MAX_POINTS + 1, "")).unwrap();
        assert!(
            svg.contains("one pair in 2 is drawn") && svg.matches("<circle").count() <= MAX_POINTS
        );
    }
}
