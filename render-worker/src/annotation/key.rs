//! The panels that say what is shown and when: the legend's bar of colours, and the date.

use contract::annotation::DateLabel;
use contract::colour::TransferFunction;
use contract::isolines::Isolines;
use contract::job::RenderJob;
use contract::quantity::{Display, Quantity};
use legend::svg::{Bar, write_bar};
use legend::{Legend, LegendError, ticks};

use super::page::{Corner, Page};
use super::panel::Panel;
use super::text::{Anchor, Ink, width};

/// Between a panel's edge and what is in it, letters.
const PADDING_EM: f64 = 0.8;
/// Width of the bar of colours: a share of the picture within limits in letters.
const BAR_SHARE: f64 = 0.22;
const BAR_LIMITS_EM: [f64; 2] = [15.0, 24.0];
/// Sizes of the lines of a panel, letters.
const TITLE_EM: f64 = 1.0;
const SMALL_EM: f64 = 0.8;
const DATE_EM: f64 = 1.45;
/// Height of a line of small text below the marks of a bar, letters.
const ROW_EM: f64 = 1.25;

/// The legend of a job's colours, and of its isolines.
pub(super) fn draw(
    page: &mut Page,
    job: &RenderJob,
    quantity: Quantity,
) -> Result<(), LegendError> {
    let em = page.em();
    let (padding, title, small) = (PADDING_EM * em, TITLE_EM * em, SMALL_EM * em);
    let transfer = &job.style.transfer;
    let legend = Legend::of_mode(job.mode, quantity, transfer);
    let label_width = width(legend.label(), title, Ink::Panel)?;
    let unit_width = width(legend.unit(), small, Ink::Soft)?;
    let [least, most] = BAR_LIMITS_EM.map(|limit| limit * em);
    let wanted = (page.size()[0] * BAR_SHARE).clamp(least, most);
    let isolines = job.style.context.isolines;
    let isolines = isolines.map(|lines| isolines_in_words(lines, quantity.display()));
    let isolines_width = width(isolines.as_deref().unwrap_or_default(), small, Ink::Panel)?;
    let across = wanted
        .max(label_width + 1.5 * em + unit_width)
        .max(isolines_width);
    let ends = quantity
        .ends()
        .filter(|_| transfer.low < 0.0 || transfer.high > 0.0);
    let (bar_top, bar_height) = (padding + 1.75 * em, 0.8 * em);
    let foot = bar_top + bar_height;
    let rows = f64::from(u8::from(ends.is_some()) + u8::from(isolines.is_some()));
    let height = foot + 1.3 * em + ROW_EM * em * rows + 0.75 * padding;
    let corners = [
        Corner::BottomLeft,
        Corner::BottomRight,
        Corner::TopLeft,
        Corner::TopRight,
    ];
    let Some(area) = page.take_corner([across + 2.0 * padding, height], &corners) else {
        return Ok(());
    };
    let mut panel = Panel::over(area, em);
    let right = padding + across;
    let base = padding + 0.95 * em;
    panel.write(
        legend.label(),
        [padding, base],
        title,
        Anchor::Start,
        Ink::Panel,
    );
    panel.write(legend.unit(), [right, base], small, Anchor::End, Ink::Soft);
    let [x, y] = panel.at([padding, bar_top]);
    let bar = Bar {
        x,
        y,
        width: across,
        height: bar_height,
    };
    let mut colours = String::new();
    write_bar(&legend, bar, &mut colours).expect("a string takes any text");
    panel.push(&colours);
    write_marks(&mut panel, &legend, [padding, foot], across, em)?;
    let mut y = foot + 2.45 * em;
    if let Some(ends) = ends {
        write_ends(&mut panel, transfer, ends, [padding, right], y, small);
        y += ROW_EM * em;
    }
    if let Some(isolines) = &isolines {
        panel.write(isolines, [padding, y], small, Anchor::Start, Ink::Panel);
    }
    panel.put(page);
    Ok(())
}

/// Which values have a line, in the unit of the legend.
fn isolines_in_words(isolines: Isolines, display: Display) -> String {
    match isolines {
        Isolines::Every { step, .. } => {
            let step = ticks::texts(&[step * display.factor.abs()]).concat();
            let words = format!("Isolines every {step} {}", display.unit);
            words.trim_end().to_owned()
        }
        Isolines::Decades { .. } => "Isolines at 1 and 3 of every power of ten".to_owned(),
    }
}

/// Round values below a bar that begins at a place of the panel.
fn write_marks(
    panel: &mut Panel,
    legend: &Legend,
    [left, foot]: [f64; 2],
    across: f64,
    em: f64,
) -> Result<(), LegendError> {
    let small = SMALL_EM * em;
    for (place, text) in legend.marks() {
        let x = left + place * across;
        panel.stroke([x, foot], [x, foot + 0.3 * em], 0.07 * em);
        let half = 0.5 * width(&text, small, Ink::Panel)?;
        // Long numbers at the ends stay in the panel.
        let edge = 0.3 * em + half;
        let middle = x.clamp(edge, (across + 2.0 * left - edge).max(edge));
        panel.write(
            &text,
            [middle, foot + 1.2 * em],
            small,
            Anchor::Middle,
            Ink::Panel,
        );
    }
    Ok(())
}

/// What values below and above zero mean, where the range has such.
fn write_ends(
    panel: &mut Panel,
    transfer: &TransferFunction,
    [low, high]: [&str; 2],
    [left, right]: [f64; 2],
    y: f64,
    size: f64,
) {
    if transfer.low < 0.0 {
        panel.write(
            &format!("◂ {low}"),
            [left, y],
            size,
            Anchor::Start,
            Ink::Panel,
        );
    }
    if transfer.high > 0.0 {
        panel.write(
            &format!("{high} ▸"),
            [right, y],
            size,
            Anchor::End,
            Ink::Panel,
        );
    }
}

/// The date.
pub(super) fn draw_date(page: &mut Page, date: &DateLabel) -> Result<(), LegendError> {
    let em = page.em();
    let (padding, small, large) = (PADDING_EM * em, SMALL_EM * em, DATE_EM * em);
    let shown = date.shown.as_str();
    let note = date.note.as_ref().map_or("", |note| note.as_str());
    let across = width(shown, large, Ink::Panel)?.max(width(note, small, Ink::Soft)?);
    let height = 2.0 * padding + 1.2 * em + if note.is_empty() { 0.0 } else { 1.25 * em };
    let corners = [Corner::TopLeft, Corner::TopRight, Corner::BottomRight];
    let Some(area) = page.take_corner([across + 2.0 * padding, height], &corners) else {
        return Ok(());
    };
    let mut panel = Panel::over(area, em);
    panel.write(
        shown,
        [padding, padding + 1.15 * em],
        large,
        Anchor::Start,
        Ink::Panel,
    );
    panel.write(
        note,
        [padding, padding + 2.4 * em],
        small,
        Anchor::Start,
        Ink::Soft,
    );
    panel.put(page);
    Ok(())
}

#[cfg(test)]
mod tests {
    use contract::annotation::Annotations;
    use contract::camera::CameraAngles;
    use contract::isolines::IsolineWish;
    use contract::job::View;
    use legend::raster;
    use render_proof::ocean;

    use super::*;

    /// The key of a quantity in its usual colours, with isolines as they are asked for.
    fn key(quantity: Quantity, isolines: Option<&str>, [width_px, height_px]: [u32; 2]) -> String {
        let view = View::Globe {
            lon_deg: -150.0,
            lat_deg: 10.0,
            height_m: 1.5e7,
            width_px,
            height_px,
            angles: CameraAngles::NADIR,
        };
        let mut job = ocean::job(view);
        job.style.transfer = TransferFunction::default_for(quantity);
        job.style.context.isolines = isolines.map(|wish| {
            let wish: IsolineWish = wish.parse().unwrap();
            wish.within(quantity, &job.style.transfer).unwrap()
        });
        job.annotations = Some(Annotations {
            legend: Some(quantity),
            ..Annotations::none()
        });
        job.validate().unwrap();
        let mut page = Page::new([width_px, height_px]);
        draw(&mut page, &job, quantity).unwrap();
        page.into_svg()
    }

    #[test]
    fn isolines_are_told_in_the_words_and_the_unit_of_the_legend() {
        let told = |quantity, isolines| {
            let svg = key(quantity, Some(isolines), [1600, 900]);
            let (_, told) = svg.split_once(">Isolines ").unwrap();
            told.split_once('<').unwrap().0.to_owned()
        };
        assert_eq!(told(Quantity::Pco2, "20"), "every 20 µatm");
        assert_eq!(told(Quantity::CarbonFlux, "10"), "every 10 g C m⁻² yr⁻¹");
        assert_eq!(told(Quantity::CarbonFlux, "auto"), "every 10 g C m⁻² yr⁻¹");
        assert_eq!(told(Quantity::SeaSurfaceTemperature, "2.5"), "every 2.5 °C");
        assert_eq!(told(Quantity::Salinity, "0.5"), "every 0.5");
        assert_eq!(
            told(Quantity::Chlorophyll, "auto"),
            "at 1 and 3 of every power of ten"
        );
        for quantity in Quantity::ALL {
            assert!(!key(quantity, None, [1600, 900]).contains("Isolines"));
        }
    }

    #[test]
    fn what_is_told_of_isolines_has_a_line_of_its_own_in_the_panel() {
        for quantity in [Quantity::CarbonFlux, Quantity::Chlorophyll] {
            for size in [[1600, 900], [640, 360], [4096, 4096]] {
                let svg = key(quantity, Some("auto"), size);
                // The panel is the first rectangle, what is told of isolines the last text.
                let (_, panel) = svg.split_once("<rect ").unwrap();
                let number = |name: &str| -> f64 {
                    let (_, rest) = panel.split_once(&format!("{name}=\"")).unwrap();
                    rest.split('"').next().unwrap().parse().unwrap()
                };
                let (right, bottom) = (
                    number("x") + number("width"),
                    number("y") + number("height"),
                );
                let boxes = raster::text_boxes(&svg).unwrap();
                let ([left, top, own_right, own_bottom], others) = boxes.split_last().unwrap();
                assert!(
                    *left >= number("x") && *own_right <= right && *own_bottom <= bottom,
                    "{svg}"
                );
                // Boxes are as high as the highest letters of a font.
                let core = top + 0.3 * (own_bottom - top);
                assert!(others.iter().all(|other| other[3] <= core), "{svg}");
            }
        }
    }
}
