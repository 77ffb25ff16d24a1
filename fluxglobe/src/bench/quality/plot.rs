//! Error against the number of slices as a picture: decibels on the left, mean FLIP on the right, both over what is drawn, a
//! line a scene, SVG.

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::{
    BLACK, ChartBuilder, Circle, Color as _, DashedLineSeries, DrawingArea, IntoDrawingArea as _,
    IntoLogRange as _, LineSeries, PathElement, RGBColor, SVGBackend, SeriesLabelPosition, WHITE,
};

use super::Measured;

/// Width and height, pixels.
const SIZE: (u32, u32) = (1100, 480);
/// What is aimed at.
const WANTED_DB: f64 = 40.0;
/// What is aimed at.
const WANTED_FLIP: f64 = 0.02;
/// Colours that are told apart by all (Okabe and Ito 2008).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A measure of every scene.
struct Panel<'a> {
    title: &'a str,
    wanted: f64,
    lines: Vec<(&'a str, Vec<(f64, f64)>)>,
}

pub(super) fn svg(scenes: &[Measured]) -> Result<String> {
    let mut text = String::new();
    // Plot errors borrow from the drawing; their words are what matters.
    draw(scenes, &mut text).map_err(|error| anyhow!("the plot cannot be drawn: {error}"))?;
    Ok(text)
}

fn draw(scenes: &[Measured], text: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::with_string(text, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let (left, right) = area.split_horizontally(SIZE.0 / 2);
    let lines = |value: fn(&render_proof::Covered) -> Option<f64>| {
        let line = |scene: &Measured| {
            let points = scene.rows.iter();
            points
                .filter_map(|row| Some((f64::from(row.slices), value(&row.difference.covered?)?)))
                .collect()
        };
        scenes
            .iter()
            .map(|scene| (scene.name.as_str(), line(scene)))
            .collect()
    };
    panel(
        &left,
        &Panel {
            title: "PSNR of what is drawn, dB",
            wanted: WANTED_DB,
            lines: lines(|d| d.psnr_db),
        },
        true,
    )?;
    panel(
        &right,
        &Panel {
            title: "mean FLIP of what is drawn",
            wanted: WANTED_FLIP,
            lines: lines(|d| Some(d.mean_flip)),
        },
        false,
    )?;
    area.present()?;
    Ok(())
}

fn panel(
    area: &Area<'_>,
    panel: &Panel<'_>,
    has_legend: bool,
) -> Result<(), Box<dyn std::error::Error>> {
    let points = || {
        panel
            .lines
            .iter()
            .flat_map(|(_, line)| line.iter().copied())
    };
    let slices = points().fold([16.0, 17.0], |[low, high]: [f64; 2], (x, _)| {
        [low.min(x), high.max(x)]
    });
    let values = points().fold([panel.wanted; 2], |[low, high]: [f64; 2], (_, y)| {
        [low.min(y), high.max(y)]
    });
    let room = 0.08 * (values[1] - values[0]).max(1e-3);
    let mut chart = ChartBuilder::on(area)
        .caption(panel.title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(56)
        .build_cartesian_2d(
            (slices[0] * 0.9..slices[1] * 1.1).log_scale().base(2.0),
            values[0] - room..values[1] + room,
        )?;
    chart
        .configure_mesh()
        .x_desc("slices")
        .x_label_formatter(&|x| format!("{x:.0}"))
        .draw()?;
    let wanted = [
        (slices[0] * 0.9, panel.wanted),
        (slices[1] * 1.1, panel.wanted),
    ];
    chart.draw_series(DashedLineSeries::new(wanted, 6, 4, BLACK.stroke_width(1)))?;
    for ((name, line), colour) in panel.lines.iter().zip(COLOURS.iter().cycle()) {
        let drawn = chart.draw_series(LineSeries::new(
            line.iter().copied(),
            colour.stroke_width(2),
        ))?;
        if has_legend {
            drawn.label(*name).legend(move |(x, y)| {
                PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2))
            });
        }
        chart.draw_series(line.iter().map(|&at| Circle::new(at, 3, colour.filled())))?;
    }
    if has_legend {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.8))
            .label_font(("sans-serif", 12))
            .draw()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use render_proof::{Difference, QualityRow};

    use super::*;

    #[test]
    fn every_scene_is_a_line_with_its_name_and_a_dot_a_number_of_slices() {
        let row = |slices: u32| QualityRow {
            slices,
            difference: Difference {
                psnr_db: Some(f64::from(slices).log2() * 6.0),
                mean_flip: 1.0 / f64::from(slices),
                most_levels: 3.0,
                within_one_level_percent: 90.0,
                covered: Some(render_proof::Covered {
                    percent: 80.0,
                    psnr_db: Some(f64::from(slices).log2() * 5.0),
                    mean_flip: 2.0 / f64::from(slices),
                }),
            },
        };
        let scene = |name: &str| Measured {
            name: name.to_owned(),
            rows: [16, 64, 256].map(row).to_vec(),
        };
        let svg = svg(&[scene("one <sea>"), scene("another sea")]).unwrap();
        assert_eq!(svg.matches("<circle").count(), 2 * 2 * 3);
        assert!(
            svg.contains("another sea") && !svg.contains("<sea>"),
            "{svg}"
        );
    }
}
