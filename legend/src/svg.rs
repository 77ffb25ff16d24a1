//! A legend as SVG: text stays text, and the drawing has any size.

use std::fmt::Write as _;

use super::{BAR_HEIGHT_PX, BAR_TOP_PX, CHECK_PX, HEIGHT_PX, Legend, MARGIN_PX};

/// Where a bar of colours is drawn, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// Of its left edge.
    pub x: f64,
    /// Of its upper edge.
    pub y: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

/// Half of what a sign of a number takes of a line, in wide fonts, pixels.
const HALF_SIGN_PX: f64 = 4.8;
/// What is drawn under transparent colours.
const CHECKS: &str = "<pattern id=\"checks\" width=\"{2}\" height=\"{2}\" patternUnits=\"userSpaceOnUse\">\
<rect width=\"{2}\" height=\"{2}\" fill=\"#fff\"/><path d=\"M0 0h{1}v{1}h-{1}zM{1} {1}h{1}v{1}h-{1}z\" fill=\"#ccc\"/></pattern>";

/// The drawing.
pub(super) fn drawn(legend: &Legend) -> String {
    let mut text = String::new();
    write(legend, &mut text).expect("a string takes any text");
    text
}

fn write(legend: &Legend, to: &mut String) -> std::fmt::Result {
    let [width, height] = legend.size_px();
    // Files state them in any letters.
    let title = escaped(&legend.title());
    let [label, unit] = [legend.label, legend.unit].map(escaped);
    write!(
        to,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" font-size=\"14\" fill=\"#222\">\
         <title>{title}</title>\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\
         <text x=\"{MARGIN_PX}\" y=\"21\">{label}</text><text x=\"{}\" y=\"21\" text-anchor=\"end\">{unit}</text>",
        width - MARGIN_PX,
    )?;
    let bar = Bar {
        x: f64::from(MARGIN_PX),
        y: f64::from(BAR_TOP_PX),
        width: f64::from(width - 2 * MARGIN_PX),
        height: f64::from(BAR_HEIGHT_PX),
    };
    write_bar(legend, bar, to)?;
    let foot = BAR_TOP_PX + BAR_HEIGHT_PX;
    for (place, text) in legend.marks() {
        let x = Legend::x_px(place);
        // Long numbers at the ends of the bar stay in the drawing.
        let half = text.chars().count() as f64 * HALF_SIGN_PX;
        let middle = x.clamp(half, f64::from(width) - half);
        write!(
            to,
            "<path d=\"M{x:.2} {foot}v6\" stroke=\"#222\" shape-rendering=\"crispEdges\"/><text x=\"{middle:.2}\" y=\"{}\" text-anchor=\"middle\" font-size=\"13\">{text}</text>",
            foot + 21
        )?;
    }
    for (place, radius) in legend.dots() {
        let x = Legend::x_px(place);
        write!(
            to,
            "<circle cx=\"{x:.2}\" cy=\"{}\" r=\"{radius:.2}\" fill=\"#555\"/>",
            HEIGHT_PX + 6
        )?;
    }
    to.push_str("</svg>\n");
    Ok(())
}

/// Text as XML has it; anything else in it is no markup.
pub fn escaped(text: &str) -> String {
    let mut to = String::with_capacity(text.len());
    for sign in text.chars() {
        match sign {
            '&' => to.push_str("&amp;"),
            '<' => to.push_str("&lt;"),
            '>' => to.push_str("&gt;"),
            '"' => to.push_str("&quot;"),
            '\'' => to.push_str("&apos;"),
            // XML has no place for these, escaped or not.
            sign if sign.is_control() || matches!(sign, '\u{fffe}' | '\u{ffff}') => to.push(' '),
            sign => to.push(sign),
        }
    }
    to
}

/// The colours of a legend from its low to its high end. A drawing has one such bar: it defines what it refers to.
///
/// # Errors
/// Those of what is written to.
pub fn write_bar(legend: &Legend, bar: Bar, to: &mut String) -> std::fmt::Result {
    let Bar {
        x,
        y,
        width,
        height,
    } = bar;
    to.push_str("<defs><linearGradient id=\"colors\">");
    for (place, colour) in &legend.stops {
        write!(to, "<stop offset=\"{place:.6}\" stop-color=\"{colour}\"/>")?;
    }
    to.push_str("</linearGradient>");
    let bar = format!("x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"");
    let is_transparent = !legend.opacity.is_empty();
    if is_transparent {
        let checks = CHECKS.replace("{1}", &CHECK_PX.to_string());
        to.push_str(&checks.replace("{2}", &(2 * CHECK_PX).to_string()));
        to.push_str("<linearGradient id=\"shares\">");
        for (place, share) in &legend.opacity {
            write!(
                to,
                "<stop offset=\"{place:.6}\" stop-color=\"#fff\" stop-opacity=\"{share:.4}\"/>"
            )?;
        }
        write!(
            to,
            "</linearGradient><mask id=\"seen\"><rect {bar} fill=\"url(#shares)\"/></mask>"
        )?;
    }
    to.push_str("</defs>");
    if is_transparent {
        write!(to, "<rect {bar} fill=\"url(#checks)\"/>")?;
        write!(
            to,
            "<rect {bar} fill=\"url(#colors)\" mask=\"url(#seen)\"/>"
        )?;
    } else {
        write!(to, "<rect {bar} fill=\"url(#colors)\"/>")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Form;
    use contract::colour::TransferOptions;
    use contract::quantity::Quantity;

    fn svg(quantity: Quantity, options: &TransferOptions) -> String {
        drawn(&Legend::of(quantity, &options.over(quantity).unwrap()))
    }

    #[test]
    fn every_quantity_is_drawn_with_its_title_unit_and_ticks() {
        for quantity in Quantity::ALL {
            let svg = svg(quantity, &TransferOptions::default());
            assert!(
                svg.contains(&format!(">{}</text>", quantity.title())),
                "{svg}"
            );
            assert!(svg.contains(&format!(">{}</text>", quantity.display().unit)));
            assert!(svg.matches("text-anchor=\"middle\"").count() >= 2);
            assert!(!svg.contains("mask") && !svg.contains("circle"));
            assert!(!svg.contains('&'), "nothing needs escaping: {svg}");
        }
    }

    #[test]
    fn words_of_files_are_text_and_no_markup() {
        let named = Quantity::open(
            "chlorophyll_and_phaeopigments",
            "mg m-3 <dry>",
            "Chlorophyll & \"phaeopigments\"",
        );
        let quantity = named.unwrap().over([0.0, 5.0]).unwrap();
        let transfer = TransferOptions::default().over(quantity).unwrap();
        let legend = Legend::of(quantity, &transfer);
        let svg = drawn(&legend);
        let title = "Chlorophyll &amp; &quot;phaeopigments&quot;";
        assert!(svg.contains(&format!("<title>{title}, mg ")), "{svg}");
        assert!(svg.contains(&format!(">{title}</text>")), "{svg}");
        assert!(svg.contains("&lt;dry&gt;</text>"), "{svg}");
        legend.encoded(Form::Png).unwrap();
    }

    #[test]
    fn opacity_and_sizes_are_drawn_where_users_gave_any() {
        let options = TransferOptions {
            opacity: "0:0,15:1".parse().unwrap(),
            size: "0:0.2,15:1".parse().unwrap(),
            ..TransferOptions::default()
        };
        let svg = svg(Quantity::WindSpeed, &options);
        assert!(svg.contains("stop-opacity=\"0.0000\"") && svg.contains("url(#checks)"));
        assert_eq!(svg.matches("<circle").count(), 17);
    }
}
