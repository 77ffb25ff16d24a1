//! The height bar: how high columns rise from the sea surface and how deep they sink, and the carbon that they stand for.

use contract::grid::LonLatDeg;
use contract::heights::HEIGHT_LIMIT_M;
use contract::job::RenderJob;
use contract::quantity::Quantity;
use legend::{LegendError, ticks};
use render::plan::Projection;

use super::super::lifted::Lifted;
use super::super::panel::Panel;
use super::super::text::{Anchor, Ink, width};
use super::{LINE_EM, PADDING_EM, SMALL_EM};

/// Largest and least length of the bar; one that would be shorter, because the camera looks down on it, is told in words.
const LENGTH_EM: [f64; 2] = [2.4, 8.5];
/// From the left of the panel's inside to the bar and to what is written beside it.
const BAR_EM: f64 = 0.5;
const BAR_TEXT_EM: f64 = 1.3;
/// Least distance of the numbers along it.
const TICKS_EM: f64 = 1.2;
/// Halvings of the search for the longest bar that fits.
const HALVINGS: u32 = 40;

/// Which way columns go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    Up,
    Down,
}

/// The bar and the words around it.
pub(super) struct Heights {
    /// Lines above and below it.
    above: Vec<(String, Ink)>,
    below: Vec<(String, Ink)>,
    /// From the deepest to the highest; none where the bar has no length.
    marks: Vec<Mark>,
    /// Its ends, pixels above the sea surface: the first below it, or at it.
    ends_px: [f64; 2],
}

/// A place of the bar.
#[derive(Debug, Clone, PartialEq)]
struct Mark {
    /// Above the sea surface, as it is drawn in the middle of the picture.
    at_px: f64,
    text: String,
    /// Nothing is drawn beyond it.
    is_limit: bool,
}

/// One side of the bar.
#[derive(Clone, Copy)]
struct Side<'a> {
    way: Way,
    /// What the highest or deepest column of the picture stands for, kg m⁻².
    most_kg_m2: f64,
    ruler: &'a Ruler<'a>,
}

/// From carbon to pixels in the middle of the picture.
struct Ruler<'a> {
    projection: &'a Projection,
    ground: LonLatDeg,
    m_per_kg_m2: f64,
}

impl Ruler<'_> {
    /// Pixels from the sea surface to the end of a column.
    fn px(&self, way: Way, kg_m2: f64) -> f64 {
        let height_m = (kg_m2 * self.m_per_kg_m2).min(HEIGHT_LIMIT_M);
        let height_m = match way {
            Way::Up => height_m,
            Way::Down => -height_m,
        };
        let [foot, end] = [0.0, height_m].map(|height| self.projection.seen(self.ground, height));
        let (Some(foot), Some(end)) = (foot, end) else {
            return f64::INFINITY;
        };
        (end.x_px - foot.x_px).hypot(end.y_px - foot.y_px)
    }

    fn limit_kg_m2(&self) -> f64 {
        HEIGHT_LIMIT_M / self.m_per_kg_m2
    }
}

impl Side<'_> {
    fn is_cut_off(&self) -> bool {
        self.most_kg_m2 > self.ruler.limit_kg_m2()
    }

    /// What the end of this share of the side stands for, kg m⁻².
    fn end_kg_m2(&self, share: f64) -> f64 {
        share * self.most_kg_m2.min(self.ruler.limit_kg_m2())
    }

    fn px(&self, share: f64) -> f64 {
        self.ruler.px(self.way, self.end_kg_m2(share))
    }

    /// Marks from the sea surface outwards, without that of the surface.
    fn marks(&self, share: f64, rounds: &[f64], em: f64) -> Vec<Mark> {
        let display = Quantity::AccumulatedCarbon.display();
        let end_px = self.px(share);
        if end_px < TICKS_EM * em {
            return vec![];
        }
        let end = display.shown(self.end_kg_m2(share));
        let sign = match self.way {
            Way::Up => 1.0,
            Way::Down => -1.0,
        };
        let far_enough = |value: &f64| {
            *value > 0.0 && self.ruler.px(self.way, display.stored(*value)) >= TICKS_EM * em
        };
        let own = rounds.iter().map(|round| round * sign);
        let mut own: Vec<f64> = own.filter(far_enough).collect();
        if own.is_empty() {
            // The shorter side may end before the first number of both.
            own = ticks::of(0.0, end).into_iter().filter(far_enough).collect();
        }
        let texts = ticks::texts(&own);
        let is_whole = share >= 1.0;
        let mut marks: Vec<(f64, String)> = own
            .into_iter()
            .zip(texts)
            .filter(|(value, _)| *value < end * (1.0 - 1e-9) || !is_whole)
            .map(|(value, text)| (self.ruler.px(self.way, display.stored(value)), text))
            .collect();
        if is_whole {
            marks.push((end_px, figures(end)));
        }
        // The sea surface has a number of its own.
        let mut marks = apart(marks, TICKS_EM * em);
        marks.retain(|(at_px, _)| *at_px >= TICKS_EM * em);
        if let Some((_, text)) = marks.last_mut() {
            let told = match (is_whole && self.is_cut_off(), self.way) {
                (true, _) => " and more, cut off",
                (false, Way::Up) => " given off",
                (false, Way::Down) => " taken up",
            };
            text.push_str(told);
        }
        let count = marks.len();
        let mark = |(i, (at_px, text)): (usize, (f64, String))| Mark {
            at_px: at_px * sign,
            text,
            is_limit: is_whole && self.is_cut_off() && i + 1 == count,
        };
        marks.into_iter().enumerate().map(mark).collect()
    }

    /// What this way means, and the most that there is of it.
    fn line(&self) -> String {
        let most = figures(Quantity::AccumulatedCarbon.display().shown(self.most_kg_m2));
        match self.way {
            Way::Up => format!("Height: carbon given off, {most} at most"),
            Way::Down => format!("Depth: carbon taken up, {most} at most"),
        }
    }
}

impl Heights {
    /// The bar of a job in the middle of its picture; none where nothing is lifted.
    pub(super) fn of(
        job: &RenderJob,
        lifted: &Lifted,
        (projection, ground): (&Projection, LonLatDeg),
        em: f64,
        since: &str,
    ) -> Option<Self> {
        let ruler = Ruler {
            projection,
            ground,
            m_per_kg_m2: job.style.height_m_per_kg_m2,
        };
        if ruler.m_per_kg_m2 <= 0.0 {
            return None;
        }
        let both = [(Way::Up, lifted.up_kg_m2), (Way::Down, lifted.down_kg_m2)];
        let sides: Vec<Side<'_>> = both
            .into_iter()
            // Little is seen from below the sea of what stands above it.
            .filter(|(way, most)| *most > 0.0 && (*way == Way::Down || !projection.is_below()))
            .map(|(way, most_kg_m2)| Side {
                way,
                most_kg_m2,
                ruler: &ruler,
            })
            .collect();
        let display = Quantity::AccumulatedCarbon.display();
        let unit = display.unit;
        let shown = |kg_m2: f64| figures(display.shown(kg_m2));
        let mut above: Vec<_> = sides.iter().map(|side| (side.line(), Ink::Panel)).collect();
        if sides.is_empty() {
            let line = if projection.is_below() {
                "No carbon taken up here"
            } else {
                "No carbon given off or taken up here"
            };
            above.push((line.to_owned(), Ink::Panel));
        }
        above.push((format!("since {since}, {unit}"), Ink::Soft));
        let hundred_km = shown(1e5 / ruler.m_per_kg_m2);
        let mut below = vec![(format!("100 km drawn are {hundred_km} {unit}"), Ink::Soft)];
        let (marks, ends_px) = bar(&sides, em);
        let limits = marks.iter().filter(|mark| mark.is_limit).count();
        if limits < sides.iter().filter(|side| side.is_cut_off()).count() {
            let line = format!("more than {} is cut off", shown(ruler.limit_kg_m2()));
            below.push((line, Ink::Soft));
        }
        Some(Self {
            above,
            below,
            marks,
            ends_px,
        })
    }

    /// Width and height within the padding of a panel.
    pub(super) fn size(&self, em: f64) -> Result<[f64; 2], LegendError> {
        let small = SMALL_EM * em;
        let mut across = 0.0f64;
        for (line, ink) in self.above.iter().chain(&self.below) {
            across = across.max(width(line, small, *ink)?);
        }
        for mark in &self.marks {
            across = across.max(BAR_TEXT_EM * em + width(&mark.text, small, Ink::Panel)?);
        }
        let lines = (self.above.len() + self.below.len()) as f64 * LINE_EM * em;
        Ok([across, lines + self.bar_px(em)])
    }

    /// What the bar takes of the panel's height.
    fn bar_px(&self, em: f64) -> f64 {
        if self.marks.is_empty() {
            return 0.0;
        }
        self.ends_px[1] - self.ends_px[0] + 1.6 * em
    }

    /// Draws bar and words from `y` on; where they end below comes back.
    pub(super) fn draw(&self, panel: &mut Panel, mut y: f64, em: f64) -> f64 {
        let (padding, small) = (PADDING_EM * em, SMALL_EM * em);
        let write = |panel: &mut Panel, y: f64, (line, ink): &(String, Ink)| {
            panel.write(line, [padding, y + 0.85 * em], small, Anchor::Start, *ink);
            y + LINE_EM * em
        };
        for line in &self.above {
            y = write(panel, y, line);
        }
        if !self.marks.is_empty() {
            self.draw_bar(panel, y, em);
            y += self.bar_px(em);
        }
        for line in &self.below {
            y = write(panel, y, line);
        }
        y + 0.5 * em
    }

    fn draw_bar(&self, panel: &mut Panel, y: f64, em: f64) {
        let small = SMALL_EM * em;
        let x = (PADDING_EM + BAR_EM) * em;
        let [deepest, highest] = self.ends_px;
        let surface = y + 0.7 * em + highest;
        panel.stroke([x, surface - highest], [x, surface - deepest], 0.12 * em);
        for mark in &self.marks {
            let at = surface - mark.at_px;
            let (reach, thick) = if mark.is_limit {
                (0.5, 0.2)
            } else {
                (0.32, 0.09)
            };
            // What is cut off, and the sea surface, cross the bar.
            let crosses = mark.is_limit || mark.at_px == 0.0;
            let from = if crosses { x - reach * em } else { x };
            panel.stroke([from, at], [x + reach * em, at], thick * em);
            let place = [(PADDING_EM + BAR_TEXT_EM) * em, at + 0.29 * em];
            panel.write(&mark.text, place, small, Anchor::Start, Ink::Panel);
        }
    }
}

/// The marks of a bar of so many sides and its ends; none where it would be too short to read. Both sides are to one scale:
/// what is too long is shortened by the same share.
fn bar(sides: &[Side<'_>], em: f64) -> (Vec<Mark>, [f64; 2]) {
    let [least_px, most_px] = LENGTH_EM.map(|limit| limit * em);
    let length_px = |share: f64| sides.iter().map(|side| side.px(share)).sum::<f64>();
    let share = longest(|share| length_px(share) <= most_px);
    if length_px(share) < least_px {
        return (vec![], [0.0; 2]);
    }
    let side = |way| sides.iter().find(|side| side.way == way);
    let ends = [Way::Down, Way::Up].map(side);
    let display = Quantity::AccumulatedCarbon.display();
    let [low, high] =
        ends.map(|side| side.map_or(0.0, |side| display.shown(side.end_kg_m2(share))));
    let rounds = ticks::of(-low, high);
    let [down, up] =
        ends.map(|side| side.map_or_else(Vec::new, |side| side.marks(share, &rounds, em)));
    let surface = Mark {
        at_px: 0.0,
        text: "0 sea surface".to_owned(),
        is_limit: false,
    };
    let marks = down.into_iter().rev().chain([surface]).chain(up).collect();
    let [down_px, up_px] = ends.map(|side| side.map_or(0.0, |side| side.px(share)));
    (marks, [-down_px, up_px])
}

/// The largest share, up to 1, that fits.
fn longest(fits: impl Fn(f64) -> bool) -> f64 {
    if fits(1.0) {
        return 1.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
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

#[cfg(test)]
mod tests {
    use super::*;

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
