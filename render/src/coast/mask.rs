//! Lines in absolute pixels in, how much of every pixel of a picture they cover out.
//!
//! A pixel's coverage depends on its own place and on the lines, in whatever order they come: pictures side by side have
//! no seam.

use glam::DVec2;

/// How a line is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Pen {
    /// Half its width, pixels.
    pub half_width_px: f64,
    /// Coverage of what it covers whole, 0 to 1.
    pub strength: f64,
}

impl Pen {
    /// That of coast lines.
    pub const COAST: Self = Self {
        half_width_px: 0.6,
        strength: 1.0,
    };

    /// Farthest from a line that a pixel's centre is touched by it.
    pub fn reach_px(self) -> f64 {
        self.half_width_px + 0.5
    }
}

/// Looked at beyond that, so that rounding leaves out nothing.
const SLACK_PX: f64 = 1e-3;

/// Coverage of every pixel of a picture, 0 to 255, four to a word; a row begins with a word.
#[derive(Debug, Clone)]
pub struct Mask {
    /// Absolute pixel of the left top corner.
    origin_px: DVec2,
    size_px: [u32; 2],
    words: Vec<u32>,
}

impl Mask {
    /// Nothing covered yet.
    pub fn new(origin_px: [f64; 2], size_px: [u32; 2]) -> Self {
        let words = size_px[0].div_ceil(4) as usize * size_px[1] as usize;
        Self {
            origin_px: origin_px.into(),
            size_px,
            words: vec![0; words],
        }
    }

    /// Words in a row of a picture of this width.
    pub fn row_words(width_px: u32) -> u32 {
        width_px.div_ceil(4)
    }

    /// All words.
    pub fn into_words(self) -> Vec<u32> {
        self.words
    }

    /// Writes the coverage of every pixel into the bits of its word, of one word for each, from `shift` on, which are 0.
    pub fn write(&self, words: &mut [u32], shift: u32) {
        let row_words = Self::row_words(self.size_px[0]) as usize;
        let rows = words.chunks_exact_mut(self.size_px[0] as usize);
        for (words, own) in rows.zip(self.words.chunks_exact(row_words)) {
            let lined = words.chunks_mut(4).zip(own).filter(|(_, own)| **own != 0);
            for (words, own) in lined {
                for (word, byte) in words.iter_mut().zip(own.to_le_bytes()) {
                    *word |= u32::from(byte) << shift;
                }
            }
        }
    }

    /// Coverage of a pixel of the picture.
    pub fn at(words: &[u32], width_px: u32, pixel: [u32; 2]) -> u32 {
        let word = words[(pixel[1] * Self::row_words(width_px) + pixel[0] / 4) as usize];
        word >> (pixel[0] % 4 * 8) & 255
    }

    /// Covers what a straight line between two absolute places does.
    pub fn draw(&mut self, pen: Pen, a: DVec2, b: DVec2) {
        let [width, height] = self.size_px.map(f64::from);
        let (low, high) = (a.min(b) - self.origin_px, a.max(b) - self.origin_px);
        let reach = pen.reach_px() + SLACK_PX;
        let is_near =
            high.x > -reach && low.x < width + reach && high.y > -reach && low.y < height + reach;
        if !is_near {
            return;
        }
        let span = |low: f64, high: f64, most: f64| {
            let first = (low - reach - 0.5).ceil().clamp(0.0, most) as u32;
            first..((high + reach - 0.5).floor() + 1.0).clamp(0.0, most) as u32
        };
        for y in span(low.y, high.y, height) {
            let middle = self.origin_px.y + f64::from(y) + 0.5;
            let Some([west, east]) = across(a, b, middle, reach) else {
                continue;
            };
            let left = self.origin_px.x;
            for x in span(west - left, east - left, width) {
                let center = DVec2::new(left + f64::from(x) + 0.5, middle);
                let cover = (pen.reach_px() - distance(center, a, b)).clamp(0.0, 1.0);
                let cover = cover * pen.strength;
                self.cover([x, y], (cover * 255.0).round() as u32);
            }
        }
    }

    fn cover(&mut self, pixel: [u32; 2], cover: u32) {
        let at = (pixel[1] * Self::row_words(self.size_px[0]) + pixel[0] / 4) as usize;
        let shift = pixel[0] % 4 * 8;
        let word = &mut self.words[at];
        let before = *word >> shift & 255;
        *word += cover.saturating_sub(before) << shift;
    }
}

/// West and east end of what lies within `reach` of a height; none if nothing does.
fn across(a: DVec2, b: DVec2, y: f64, reach: f64) -> Option<[f64; 2]> {
    let way = b - a;
    let [mut first, mut last] = [0.0, 1.0];
    if way.y == 0.0 {
        if (a.y - y).abs() > reach {
            return None;
        }
    } else {
        let ends = [(y - reach - a.y) / way.y, (y + reach - a.y) / way.y];
        first = ends[0].min(ends[1]).max(0.0);
        last = ends[0].max(ends[1]).min(1.0);
        if first > last {
            return None;
        }
    }
    let (start, end) = (a.x + way.x * first, a.x + way.x * last);
    Some([start.min(end), start.max(end)])
}

fn distance(place: DVec2, a: DVec2, b: DVec2) -> f64 {
    let way = b - a;
    let length_sq = way.length_squared();
    let along = if length_sq > 0.0 {
        ((place - a).dot(way) / length_sq).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (place - (a + way * along)).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(origin_px: [f64; 2], size_px: [u32; 2], lines: &[[[f64; 2]; 2]]) -> Vec<u32> {
        let mut mask = Mask::new(origin_px, size_px);
        for [a, b] in lines {
            mask.draw(Pen::COAST, (*a).into(), (*b).into());
        }
        mask.into_words()
    }

    #[test]
    fn a_line_covers_as_many_pixels_as_its_width_and_length_make() {
        for (end, length) in [([90.0, 50.0], 80.0), ([80.0, 90.0], 80.622_577)] {
            let words = drawn([0.0; 2], [100, 100], &[[[10.0, 50.0], end]]);
            let sum: u32 = (0..100)
                .flat_map(|y| (0..100).map(move |x| [x, y]))
                .map(|pixel| Mask::at(&words, 100, pixel))
                .sum();
            let area = f64::from(sum) / 255.0;
            // Round ends of half a width's radius, softened, add about a square pixel and a half.
            let expected = 1.2 * length + 1.5;
            assert!((area / expected - 1.0).abs() < 0.05, "{area} {expected}");
        }
    }

    #[test]
    fn pictures_side_by_side_have_no_seam_in_any_order_of_lines() {
        let lines: Vec<[[f64; 2]; 2]> = (0..200u32)
            .map(|i| {
                let at =
                    |j: u32| f64::from((i * 7919 + j * 104_729) % 1000) / 1000.0 * 90.0 + 960.0;
                [[at(0), at(1)], [at(2), at(3)]]
            })
            .collect();
        let whole = drawn([970.0; 2], [64, 64], &lines);
        let back: Vec<_> = lines.iter().rev().copied().collect();
        assert_eq!(whole, drawn([970.0; 2], [64, 64], &back));
        for corner in [[0, 0], [32, 0], [0, 32], [32, 32]] {
            let origin = corner.map(|px| 970.0 + f64::from(px));
            let part = drawn(origin, [32, 32], &lines);
            for y in 0..32 {
                for x in 0..32 {
                    let in_whole = Mask::at(&whole, 64, [corner[0] + x, corner[1] + y]);
                    assert_eq!(Mask::at(&part, 32, [x, y]), in_whole, "{corner:?} {x} {y}");
                }
            }
        }
        assert!(whole.iter().any(|word| *word != 0) && whole.contains(&0));
    }

    #[test]
    fn lines_outside_and_lines_without_length_do_no_harm() {
        let far = [[[-1e9, -1e9], [-1e8, 5.0]], [[1e12, 0.0], [1e12, 1.0]]];
        assert!(
            drawn([0.0; 2], [30, 30], &far)
                .iter()
                .all(|word| *word == 0)
        );
        let dot = drawn([0.0; 2], [30, 30], &[[[4.5, 4.5], [4.5, 4.5]]]);
        assert_eq!(Mask::at(&dot, 30, [4, 4]), 255);
        let huge = drawn([0.0; 2], [30, 30], &[[[-1e7, 15.0], [1e7, 15.0]]]);
        assert_eq!(Mask::at(&huge, 30, [29, 14]), Mask::at(&huge, 30, [0, 15]));
    }
}
