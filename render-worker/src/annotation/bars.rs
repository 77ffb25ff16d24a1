//! The panel of rulers: how long a kilometre is and how high particles are lifted, both in the middle of the picture.

use contract::annotation::Annotations;
use contract::grid::LonLatDeg;
use contract::heights::HEIGHT_LIMIT_M;
use contract::job::RenderJob;
use contract::quantity::Quantity;
use legend::{LegendError, ticks};
use render::plan::Projection;

use super::page::{Corner, Page};
use super::panel::Panel;
use super::text::{Anchor, Ink, width};

const PADDING_EM: f64 = 0.8;
/// Longest scale bar.
const SCALE_EM: f64 = 11.0;
/// Highest and lowest height bar; one that would be lower, because the camera looks down on it, is told in words.
const HEIGHT_EM: [f64; 2] = [2.4, 8.5];
/// From the left of the panel's inside to the bar and to what is written beside it.
const BAR_EM: f64 = 0.5;
const BAR_TEXT_EM: f64 = 1.3;
/// Least distance of the numbers along it.
const TICKS_EM: f64 = 1.2;
const SMALL_EM: f64 = 0.8;
const LINE_EM: f64 = 1.25;
/// Halvings of the search for the highest bar that fits.
const HALVINGS: u32 = 40;

/// Where a scale holds: perspective makes others elsewhere.
const AT_CENTRE: &str = "at the centre";

/// A length of ground.
struct Scale {
    text: String,
    px: f64,
}

/// Drawn heights, and the accumulated carbon that they stand for.
struct Heights {
    /// The bar leads down from the sea surface, as it is seen from below.
    hangs: bool,
    /// Above the ground, pixels, and what is written there; none where a bar has no length.
    marks: Vec<(f64, String)>,
    /// Does it reach the height that nothing is lifted beyond?
    has_limit: bool,
    words: Vec<String>,
}

pub(super) fn draw(
    page: &mut Page,
    job: &RenderJob,
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
        heights(job, projection, ground, em, &since)
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

fn heights(
    job: &RenderJob,
    projection: &Projection,
    ground: LonLatDeg,
    em: f64,
    since: &str,
) -> Option<Heights> {
    let m_per_kg_m2 = job.style.height_m_per_kg_m2;
    if m_per_kg_m2 <= 0.0 {
        return None;
    }
    let display = Quantity::AccumulatedCarbon.display();
    let shown = |height_m: f64| display.shown(height_m / m_per_kg_m2);
    // What hangs is measured from below, what stands from above.
    let way = if projection.is_below() { -1.0 } else { 1.0 };
    let above_px = |height_m: f64| {
        let [foot, top] = [0.0, height_m * way].map(|height| projection.seen(ground, height));
        let (foot, top) = (foot?, top?);
        Some((top.x_px - foot.x_px).hypot(top.y_px - foot.y_px))
    };
    let [least_px, most_px] = HEIGHT_EM.map(|limit| limit * em);
    let fits = |height_m: f64| above_px(height_m).is_some_and(|px| px <= most_px);
    let has_limit = fits(HEIGHT_LIMIT_M);
    let highest_m = if has_limit {
        HEIGHT_LIMIT_M
    } else {
        highest(fits)
    };
    let top_px = above_px(highest_m).unwrap_or(0.0);
    let unit = display.unit;
    let mut words = vec![
        "Height: carbon given off".to_owned(),
        "depth: carbon taken up".to_owned(),
        format!("since {since}, {unit}"),
    ];
    let hundred_km = figures(shown(1e5));
    words.push(format!("100 km drawn are {hundred_km} {unit}"));
    let marks = if top_px < least_px {
        let limit = figures(shown(HEIGHT_LIMIT_M));
        words.push(format!("more than {limit} is cut off"));
        vec![]
    } else {
        let mut values = ticks::of(0.0, shown(highest_m));
        if has_limit {
            values.push(shown(HEIGHT_LIMIT_M));
        }
        let texts = ticks::texts(&values);
        let at = |value: &f64| above_px(display.stored(*value) * m_per_kg_m2).unwrap_or(0.0);
        let places: Vec<f64> = values.iter().map(at).collect();
        apart(places.into_iter().zip(texts).collect(), TICKS_EM * em)
    };
    Some(Heights {
        hangs: projection.is_below(),
        has_limit: has_limit && !marks.is_empty(),
        marks,
        words,
    })
}

/// The highest bar that fits, m.
fn highest(fits: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, HEIGHT_LIMIT_M);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if fits(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Marks at least so far apart: the first and the last stay.
fn apart(marks: Vec<(f64, String)>, least_px: f64) -> Vec<(f64, String)> {
    let Some(last) = marks.last().cloned() else {
        return marks;
    };
    let mut kept: Vec<(f64, String)> = vec![];
    for mark in marks {
        let after = kept
            .last()
            .is_none_or(|before| mark.0 - before.0 >= least_px);
        if after && last.0 - mark.0 >= least_px {
            kept.push(mark);
        }
    }
    kept.push(last);
    kept
}

/// A number with three figures that count.
fn figures(number: f64) -> String {
    let digits = (2.0 - number.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{number:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
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
            for line in &heights.words {
                across = across.max(width(line, small, Ink::Soft)?);
            }
            for (i, (_, text)) in heights.marks.iter().enumerate() {
                let told = width(&heights.told(i, text), small, Ink::Panel)?;
                across = across.max(BAR_TEXT_EM * em + told);
            }
            down += heights.words.len() as f64 * LINE_EM * em + heights.bar_px(em);
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

impl Heights {
    /// What the bar takes of the panel's height.
    fn bar_px(&self, em: f64) -> f64 {
        self.marks.last().map_or(0.0, |(top, _)| top + 1.6 * em)
    }

    fn is_limit(&self, mark: usize) -> bool {
        self.has_limit && mark + 1 == self.marks.len()
    }

    /// What is written beside a mark.
    fn told(&self, mark: usize, text: &str) -> String {
        match mark {
            _ if self.is_limit(mark) => format!("{text} and more, cut off"),
            0 => format!("{text} sea surface"),
            _ => text.to_owned(),
        }
    }

    /// The bar and the words around it; where they end below comes back.
    fn draw(&self, panel: &mut Panel, mut y: f64, em: f64) -> f64 {
        let (padding, small) = (PADDING_EM * em, SMALL_EM * em);
        let write = |panel: &mut Panel, y: f64, line: &str, ink: Ink| {
            panel.write(line, [padding, y + 0.85 * em], small, Anchor::Start, ink);
            y + LINE_EM * em
        };
        let (above, below) = self.words.split_at(3);
        for (line, ink) in above.iter().zip([Ink::Panel, Ink::Panel, Ink::Soft]) {
            y = write(panel, y, line, ink);
        }
        y = self.draw_bar(panel, y, em);
        for line in below {
            y = write(panel, y, line, Ink::Soft);
        }
        y + 0.5 * em
    }

    /// Upwards from the ground, or down from the sea surface; where it ends below comes back.
    fn draw_bar(&self, panel: &mut Panel, y: f64, em: f64) -> f64 {
        let Some((top, _)) = self.marks.last() else {
            return y;
        };
        let small = SMALL_EM * em;
        let x = (PADDING_EM + BAR_EM) * em;
        let (ends, way) = (
            [y + 0.7 * em, y + top + 0.7 * em],
            if self.hangs { 1.0 } else { -1.0 },
        );
        let ground = if self.hangs { ends[0] } else { ends[1] };
        panel.stroke([x, ends[0]], [x, ends[1]], 0.12 * em);
        for (i, (away, text)) in self.marks.iter().enumerate() {
            let at = ground + way * away;
            let is_limit = self.is_limit(i);
            let (reach, thick) = if is_limit { (0.5, 0.2) } else { (0.32, 0.09) };
            let from = if is_limit { x - reach * em } else { x };
            panel.stroke([from, at], [x + reach * em, at], thick * em);
            let text = self.told(i, text);
            panel.write(
                &text,
                [(PADDING_EM + BAR_TEXT_EM) * em, at + 0.29 * em],
                small,
                Anchor::Start,
                Ink::Panel,
            );
        }
        ends[1] + 0.9 * em
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

    #[test]
    fn numbers_have_the_figures_that_count() {
        let texts = [12.5, 100.0, 0.125, 1234.5, 0.000_123_45, 3.0].map(figures);
        assert_eq!(texts, ["12.5", "100", "0.125", "1234", "0.000123", "3"]);
    }

    #[test]
    fn marks_keep_apart_and_their_ends() {
        let marks = |at: &[f64]| at.iter().map(|x| (*x, x.to_string())).collect::<Vec<_>>();
        let kept = apart(marks(&[0.0, 10.0, 20.0, 30.0, 34.0]), 9.0);
        let at: Vec<f64> = kept.iter().map(|mark| mark.0).collect();
        assert_eq!(at, [0.0, 10.0, 20.0, 34.0]);
        let kept = apart(marks(&[0.0, 5.0, 10.0, 25.0]), 9.0);
        let at: Vec<f64> = kept.iter().map(|mark| mark.0).collect();
        assert_eq!(at, [0.0, 10.0, 25.0]);
        assert!(apart(vec![], 9.0).is_empty());
        assert_eq!(apart(marks(&[5.0]), 9.0).len(), 1);
    }
}
