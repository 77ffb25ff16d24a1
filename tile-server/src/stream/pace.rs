//! How good a picture can be had in time: what the last ones took in, the detail of the next one out.

use std::time::Duration;

use contract::job::{RenderJob, View};

/// From a state to its picture on the screen.
const AIM: Duration = Duration::from_millis(60);
/// All there is, best first.
const DETAILS: [Detail; 7] = [
    Detail::of(1.0, u32::MAX, u32::MAX),
    Detail::of(0.75, 64, 128),
    Detail::of(0.5, 16, 64),
    Detail::of(0.375, 8, 32),
    Detail::of(0.25, 4, 24),
    Detail::of(0.25, 2, 16),
    Detail::of(0.1875, 1, 12),
];
/// Pictures of one stream that are drawn at once at most.
const MOST_AT_ONCE: usize = 3;
/// With which one a stream begins: quick nearly everywhere, and better ones follow soon.
const FIRST: usize = 5;
/// Fewest pixels of the shorter side.
const FEWEST_PX: u32 = 96;
/// Pictures before a better detail is tried that was too slow: the first time, and at last.
const FIRST_HOLD: u32 = 60;
const LAST_HOLD: u32 = 2000;
/// Quality of a JPEG, and where the link is what takes long.
const QUALITY: u8 = 82;
const QUALITY_ON_A_SLOW_LINK: u8 = 55;

/// How much of a picture is drawn while it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Detail {
    /// Of width and height.
    share: f64,
    /// At most so many particles of a cell, in so many slices.
    particles_per_cell: u32,
    slices: u32,
}

/// How one stream goes.
#[derive(Debug)]
pub(super) struct Pace {
    detail: usize,
    /// Running means, seconds.
    drawing_s: f64,
    link_s: f64,
    /// The shortest time from sending to a receipt: what the way itself takes.
    way: Option<Duration>,
    /// Pictures until a better detail is tried, and for how many after the next one that is too slow.
    hold: u32,
    next_hold: u32,
}

impl Pace {
    pub(super) fn new() -> Self {
        Self {
            detail: FIRST,
            drawing_s: AIM.as_secs_f64(),
            link_s: 0.0,
            way: None,
            hold: 0,
            next_hold: FIRST_HOLD,
        }
    }

    /// A picture in motion took so long from its state until it was ready. Those that were under way when the detail
    /// changed say nothing of the new one.
    pub(super) fn drawn(&mut self, detail: Detail, took: Duration) {
        if detail != self.detail() {
            return;
        }
        mix(&mut self.drawing_s, took);
        self.choose();
    }

    /// A picture was seen so long after it was sent.
    pub(super) fn seen(&mut self, after: Duration) {
        let way = self.way.map_or(after, |way| way.min(after));
        self.way = Some(way);
        mix(&mut self.link_s, after.saturating_sub(way));
    }

    fn choose(&mut self) {
        let share_of_aim = (self.drawing_s + self.link_s) / AIM.as_secs_f64();
        self.hold = self.hold.saturating_sub(1);
        if share_of_aim > 1.3 && self.detail + 1 < DETAILS.len() {
            let is_far_off = share_of_aim > 4.0;
            self.turn_to(if is_far_off {
                DETAILS.len() - 1
            } else {
                self.detail + 1
            });
            // What was tried and was too slow is tried more and more seldom.
            self.hold = self.next_hold;
            self.next_hold = (self.next_hold * 2).min(LAST_HOLD);
        } else if share_of_aim < 0.5 && self.hold == 0 && self.detail > 0 {
            self.turn_to(self.detail - 1);
        }
    }

    fn turn_to(&mut self, detail: usize) {
        self.detail = detail;
        // Nothing is known of it.
        self.drawing_s = 0.8 * AIM.as_secs_f64();
        self.link_s = self.link_s.min(0.2 * AIM.as_secs_f64());
    }

    /// That of the next picture in motion.
    pub(super) fn detail(&self) -> Detail {
        DETAILS[self.detail]
    }

    /// Pictures that are drawn at once: what is drawn side by side on a slow device is only later.
    pub(super) fn at_once(&self) -> usize {
        match self.drawing_s {
            ..=0.1 => MOST_AT_ONCE,
            ..=0.4 => 2,
            _ => 1,
        }
    }

    /// Its quality.
    pub(super) fn quality(&self) -> u8 {
        if self.link_s > self.drawing_s {
            QUALITY_ON_A_SLOW_LINK
        } else {
            QUALITY
        }
    }
}

impl Detail {
    const fn of(share: f64, particles_per_cell: u32, slices: u32) -> Self {
        Self {
            share,
            particles_per_cell,
            slices,
        }
    }

    /// The same view in less detail. Text that is made anew for each picture takes longer than the picture, and could not
    /// be read: there is none.
    pub(super) fn reduce(self, job: RenderJob) -> RenderJob {
        let mut job = RenderJob {
            annotations: None,
            view: of_size(job.view, self.size_px(job.view.size_px())),
            ..job
        };
        let style = &mut job.style;
        style.particles_per_cell = style.particles_per_cell.min(self.particles_per_cell);
        style.slices = style.slices.min(self.slices);
        job
    }

    /// Its share of a size, enough to be seen.
    fn size_px(self, full_px: [u32; 2]) -> [u32; 2] {
        let shorter = f64::from(full_px[0].min(full_px[1]));
        let share = self.share.max((f64::from(FEWEST_PX) / shorter).min(1.0));
        full_px.map(|px| ((f64::from(px) * share).round() as u32).max(1))
    }
}

/// The same camera on other pixels.
fn of_size(view: View, [width, height]: [u32; 2]) -> View {
    match view {
        View::Globe {
            lon_deg,
            lat_deg,
            height_m,
            angles,
            ..
        } => View::Globe {
            lon_deg,
            lat_deg,
            height_m,
            width_px: width,
            height_px: height,
            angles,
        },
        tile @ View::Tile { .. } => tile,
    }
}

/// A quarter of the news.
fn mix(mean_s: &mut f64, took: Duration) {
    *mean_s += (took.as_secs_f64() - *mean_s) / 4.0;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The details of many pictures, where each takes what `cost_ms` says of it.
    fn run(cost_ms: impl Fn(Detail) -> f64) -> Vec<usize> {
        let mut pace = Pace::new();
        let mut all = vec![];
        for _ in 0..4000 {
            all.push(pace.detail);
            let took_s = cost_ms(pace.detail()) * 1e-3;
            pace.drawn(pace.detail(), Duration::from_secs_f64(took_s));
        }
        all
    }

    #[test]
    fn a_quick_device_draws_in_full_and_soon() {
        let all = run(|_any| 10.0);
        let first = all.iter().position(|&detail| detail == 0);
        assert!(first.is_some_and(|first| first < 20), "{first:?}");
        assert!(all[100..].iter().all(|&detail| detail == 0));
    }

    #[test]
    fn a_slow_device_draws_what_it_can_and_seldom_tries_more() {
        let all = run(|detail| if detail.slices > 24 { 250.0 } else { 25.0 });
        let slow = all[400..].iter().filter(|&&detail| detail < 4).count();
        assert!(slow * 20 < all.len(), "{slow}");
        assert!(all[400..].iter().all(|&detail| detail >= 2), "{all:?}");
        let mut slow = Pace::new();
        assert_eq!(slow.at_once(), MOST_AT_ONCE);
        for _ in 0..20 {
            slow.drawn(slow.detail(), Duration::from_millis(900));
        }
        assert_eq!(slow.at_once(), 1);
        let all = run(|_any| 900.0);
        assert!(all[50..].iter().all(|&detail| detail == DETAILS.len() - 1));
    }

    #[test]
    fn a_link_that_clogs_makes_pictures_smaller_and_a_long_way_alone_does_not() {
        let mut far = Pace::new();
        let mut clogged = Pace::new();
        for i in 0..200 {
            far.seen(Duration::from_millis(300));
            far.drawn(far.detail(), Duration::from_millis(8));
            clogged.seen(Duration::from_millis(if i == 0 { 20 } else { 400 }));
            clogged.drawn(clogged.detail(), Duration::from_millis(8));
        }
        assert_eq!((far.detail, far.quality()), (0, QUALITY));
        assert!(clogged.detail >= FIRST);
        assert_eq!(clogged.quality(), QUALITY_ON_A_SLOW_LINK);
    }

    #[test]
    fn small_pictures_are_never_made_smaller_than_can_be_seen() {
        let size = |full_px| DETAILS[3].size_px(full_px);
        assert_eq!(size([64, 48]), [64, 48]);
        assert_eq!(size([120, 96]), [120, 96]);
        assert_eq!(size([4096, 1]), [4096, 1]);
        assert_eq!(size([1600, 800]), [600, 300]);
    }
}
