//! Of which size and quality a picture can be had in time: what the last ones took in, the next one's share of its full
//! size out.

use std::time::Duration;

/// From a state to its picture on the screen.
const AIM: Duration = Duration::from_millis(50);
/// Shares of the full width and height, largest first.
const SHARES: [f64; 6] = [1.0, 0.75, 0.5, 0.375, 0.25, 0.1875];
/// Where a stream begins, among the shares.
const FIRST: usize = 2;
/// Fewest pixels of the shorter side.
const FEWEST_PX: u32 = 96;
/// Pictures after a change of size that say nothing of the new one: they were under way already.
const SETTLING: u32 = 3;
/// Quality of a JPEG, and where the link is what takes long.
const QUALITY: u8 = 82;
const QUALITY_ON_A_SLOW_LINK: u8 = 55;

/// How one stream goes.
#[derive(Debug)]
pub(super) struct Pace {
    share: usize,
    /// Running means, seconds.
    drawing_s: f64,
    link_s: f64,
    /// The shortest time from sending to a receipt: what the way itself takes.
    way: Option<Duration>,
    settling: u32,
}

impl Pace {
    pub(super) fn new() -> Self {
        Self {
            share: FIRST,
            drawing_s: AIM.as_secs_f64(),
            link_s: 0.0,
            way: None,
            settling: 0,
        }
    }

    /// A picture in motion took so long from its state until it was ready.
    pub(super) fn drawn(&mut self, took: Duration) {
        mix(&mut self.drawing_s, took);
        self.choose();
    }

    /// A picture was seen so long after it was sent.
    pub(super) fn seen(&mut self, after: Duration) {
        let way = self.way.map_or(after, |way| way.min(after));
        self.way = Some(way);
        mix(&mut self.link_s, after - way);
    }

    fn choose(&mut self) {
        if self.settling > 0 {
            self.settling -= 1;
            return;
        }
        let (aim_s, now_s) = (AIM.as_secs_f64(), self.drawing_s + self.link_s);
        let larger = |share: usize| (SHARES[share - 1] / SHARES[share]).powi(2);
        let next = if now_s > 1.3 * aim_s && self.share + 1 < SHARES.len() {
            self.share + 1
        } else if self.share > 0 && now_s * larger(self.share) < 0.9 * aim_s {
            self.share - 1
        } else {
            return;
        };
        // As it would be if time went by pixels: the next pictures say how it is.
        let factor = (SHARES[next] / SHARES[self.share]).powi(2);
        self.drawing_s *= factor;
        self.link_s *= factor;
        self.share = next;
        self.settling = SETTLING;
    }

    /// The share of the full size that the next picture in motion has.
    pub(super) fn share(&self) -> Share {
        Share(SHARES[self.share])
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

/// A share of a picture's width and height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share(f64);

impl Share {
    /// The pixels of it, enough to be seen.
    pub(super) fn of(self, full_px: [u32; 2]) -> [u32; 2] {
        let shorter = f64::from(full_px[0].min(full_px[1]));
        let share = self.0.max((f64::from(FEWEST_PX) / shorter).min(1.0));
        full_px.map(|px| ((f64::from(px) * share).round() as u32).max(1))
    }
}

/// An eighth of the news.
fn mix(mean_s: &mut f64, took: Duration) {
    *mean_s += (took.as_secs_f64() - *mean_s) / 8.0;
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL_PX: [u32; 2] = [1920, 1080];

    /// After many pictures that take `pixel_ns` a pixel and `least_ms` besides.
    fn settled(pixel_ns: f64, least_ms: f64) -> [u32; 2] {
        let mut pace = Pace::new();
        let mut last = vec![];
        for _ in 0..400 {
            let [width, height] = pace.share().of(FULL_PX);
            let pixels = f64::from(width) * f64::from(height);
            pace.drawn(Duration::from_secs_f64(
                least_ms * 1e-3 + pixels * pixel_ns * 1e-9,
            ));
            last.push([width, height]);
        }
        last.reverse();
        // It has settled: nothing goes to and fro.
        assert!(
            last[..100].iter().all(|size| *size == last[0]),
            "{:?}",
            &last[..20]
        );
        last[0]
    }

    #[test]
    fn a_quick_device_draws_in_full_and_a_slow_one_as_large_as_it_can_in_time() {
        assert_eq!(settled(5.0, 1.0), FULL_PX);
        let [width, _] = settled(100.0, 5.0);
        assert!((480..=960).contains(&width), "{width}");
        assert_eq!(settled(1000.0, 100.0)[0], 360);
    }

    #[test]
    fn a_link_that_clogs_makes_pictures_smaller_and_a_long_way_alone_does_not() {
        let mut far = Pace::new();
        let mut clogged = Pace::new();
        for i in 0..200 {
            far.seen(Duration::from_millis(300));
            far.drawn(Duration::from_millis(8));
            clogged.seen(Duration::from_millis(if i == 0 { 20 } else { 400 }));
            clogged.drawn(Duration::from_millis(8));
        }
        assert_eq!(far.share().of(FULL_PX), FULL_PX);
        assert_eq!(far.quality(), QUALITY);
        assert!(clogged.share().of(FULL_PX)[0] < 960);
        assert_eq!(clogged.quality(), QUALITY_ON_A_SLOW_LINK);
    }

    #[test]
    fn small_pictures_are_never_made_smaller_than_can_be_seen() {
        let share = Pace::new().share();
        assert_eq!(share.of([64, 48]), [64, 48]);
        assert_eq!(share.of([120, 96]), [120, 96]);
        assert_eq!(share.of([4096, 1]), [4096, 1]);
    }
}
