//! The panel of rulers: how long a kilometre is and how high and deep columns go, both in the middle of the picture.

mod heights;

use contract::annotation::Annotations;
use contract::grid::LonLatDeg;
use contract::job::RenderJob;
use legend::LegendError;
use render::plan::Projection;

use super::lifted::Lifted;
use super::page::{Corner, Page};
use super::panel::Panel;
use super::text::{Anchor, Ink, width};
use heights::Heights;

const PADDING_EM: f64 = 0.8;
/// Longest scale bar.
const SCALE_EM: f64 = 11.0;
const SMALL_EM: f64 = 0.8;
const LINE_EM: f64 = 1.25;
/// Where a scale holds: perspective makes others elsewhere.
const AT_CENTRE: &str = "at the centre";

/// A length of ground.
struct Scale {
    text: String,
    px: f64,
}

pub(super) fn draw(
    page: &mut Page,
    job: &RenderJob,
    lifted: &Lifted,
    annotations: &Annotations,
    projection: &Projection,
) -> Result<(), LegendError> {
    let em = page.em();
    let middle = page.size().map(|side| side / 2.0);
    let Some(ground) = projection.ground_at(middle) else {
        // In the middle is the sky.
        return Ok(());
    };
    let scale = annotations
        .scale
        .then(|| scale(projection, ground, SCALE_EM * em));
    let heights = annotations.height.and_then(|height| {
        let since = height.since.day_in_words();
        let middle = (projection, ground);
        Heights::of(job, lifted, middle, em, &since)
    });
    let rulers = Rulers {
        scale: scale.flatten(),
        heights,
    };
    rulers.draw(page)
}

/// The longest round length of ground of at most so many pixels.
fn scale(projection: &Projection, ground: LonLatDeg, most_px: f64) -> Option<Scale> {
    let [px_per_m, _away] = projection.px_per_m(ground)?;
    let most_m = most_px / px_per_m;
    let power = 10f64.powf(most_m.log10().floor());
    let round = [5.0, 2.0, 1.0].map(|factor| factor * power);
    let length_m = round.into_iter().find(|length| *length <= most_m)?;
    let text = if length_m >= 1000.0 {
        format!("{} km", length_m / 1000.0)
    } else {
        format!("{length_m} m")
    };
    let px = length_m * px_per_m;
    px.is_finite().then_some(Scale { text, px })
}

struct Rulers {
    scale: Option<Scale>,
    heights: Option<Heights>,
}

impl Rulers {
    /// Both in one panel; the scale alone where that has no room.
    fn draw(self, page: &mut Page) -> Result<(), LegendError> {
        if self.scale.is_none() && self.heights.is_none() {
            return Ok(());
        }
        let em = page.em();
        let padding = PADDING_EM * em;
        let size = self.size(em)?;
        let corners = [
            Corner::BottomRight,
            Corner::TopRight,
            Corner::BottomLeft,
            Corner::TopLeft,
        ];
        let Some(area) = page.take_corner(size, &corners) else {
            return match self {
                Self {
                    scale: Some(scale),
                    heights: Some(_),
                } => Self {
                    scale: Some(scale),
                    heights: None,
                }
                .draw(page),
                Self { .. } => Ok(()),
            };
        };
        let mut panel = Panel::over(area, em);
        let mut y = padding;
        if let Some(heights) = &self.heights {
            y = heights.draw(&mut panel, y, em);
        }
        if let Some(scale) = &self.scale {
            scale.draw(&mut panel, y, size[0] - padding, em);
        }
        panel.put(page);
        Ok(())
    }

    fn size(&self, em: f64) -> Result<[f64; 2], LegendError> {
        let small = SMALL_EM * em;
        let (mut across, mut down) = (0.0f64, 2.0 * PADDING_EM * em);
        if let Some(heights) = &self.heights {
            let size = heights.size(em)?;
            across = across.max(size[0]);
            down += size[1];
        }
        if let Some(scale) = &self.scale {
            let words =
                width(&scale.text, small, Ink::Panel)? + width(AT_CENTRE, small, Ink::Soft)?;
            across = across.max(scale.px).max(words + em);
            down += (LINE_EM + 0.64) * em;
        }
        if self.scale.is_some() && self.heights.is_some() {
            down += 0.5 * em;
        }
        Ok([across + 2.0 * PADDING_EM * em, down])
    }
}

impl Scale {
    /// The bar below its length; what it is of ends at `right`.
    fn draw(&self, panel: &mut Panel, y: f64, right: f64, em: f64) {
        let (padding, small) = (PADDING_EM * em, SMALL_EM * em);
        let base = y + 0.8 * em;
        panel.write(
            &self.text,
            [padding, base],
            small,
            Anchor::Start,
            Ink::Panel,
        );
        panel.write(AT_CENTRE, [right, base], small, Anchor::End, Ink::Soft);
        let top = y + LINE_EM * em;
        let (line, tick) = (0.12 * em, 0.32 * em);
        let ends = [padding, padding + self.px];
        panel.stroke([ends[0], top + tick], [ends[1], top + tick], line);
        for x in ends {
            panel.stroke([x, top], [x, top + 2.0 * tick], line);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::camera::CameraAngles;
    use contract::job::View;

    fn above(height_m: f64) -> Projection {
        let view = View::Globe {
            lon_deg: 10.0,
            lat_deg: 20.0,
            height_m,
            width_px: 1600,
            height_px: 900,
            angles: CameraAngles::NADIR,
        };
        Projection::of(&view).unwrap()
    }

    #[test]
    fn a_scale_is_as_long_as_it_says() {
        let focal = 450.0 / 22.5f64.to_radians().tan();
        for (height_m, text, length_m) in [
            (1e6, "100 km", 1e5),
            (1.5e7, "2000 km", 2e6),
            (2e3, "200 m", 200.0),
        ] {
            let projection = above(height_m);
            let middle = projection.ground_at([800.0, 450.0]).unwrap();
            let scale = scale(&projection, middle, 176.0).unwrap();
            assert_eq!(scale.text, text);
            assert!((scale.px / (length_m * focal / height_m) - 1.0).abs() < 1e-3);
            assert!(scale.px <= 176.0 && scale.px > 60.0, "{}", scale.px);
        }
    }
}
