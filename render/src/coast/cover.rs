//! Closed outlines in pixels in, the share of every pixel that they go round out: exact areas, whatever the outline.
//!
//! Every edge adds to the pixels of a row what it covers to its right, with the sign of its direction; sums along the row
//! are what lies within (as in Levien 2016, font-rs). Outlines that overlap add up, those that run the other way are
//! taken away, and edges that two outlines share leave no seam.

use glam::DVec2;

/// The sums of some rows of a picture.
pub struct Cover {
    first_row: u32,
    size_px: [u32; 2],
    sums: Vec<f32>,
    /// Of every row: anything was added to it.
    is_touched: Vec<bool>,
    /// Share of all pixels before anything is added.
    base: f32,
}

impl Cover {
    /// Nothing covered yet.
    pub fn new(first_row: u32, size_px: [u32; 2]) -> Self {
        Self::within(Vec::new(), first_row, size_px)
    }

    /// The same in memory that was used before, whatever is in it.
    pub fn within(mut memory: Vec<f32>, first_row: u32, size_px: [u32; 2]) -> Self {
        // A pixel more at the end of each row takes what falls beyond.
        let sums = (size_px[0] as usize + 2) * size_px[1] as usize;
        memory.clear();
        memory.resize(sums, 0.0);
        Self {
            first_row,
            size_px,
            sums: memory,
            is_touched: vec![false; size_px[1] as usize],
            base: 0.0,
        }
    }

    /// The memory, for the next one.
    pub fn into_memory(self) -> Vec<f32> {
        self.sums
    }

    /// Covers every pixel so many times more.
    pub fn add_everywhere(&mut self, times: i32) {
        self.base += times as f32;
    }

    /// Adds an edge of a closed outline, its interior on the left of its way as it is seen; y runs down. What is outside
    /// the rows covers nothing of them.
    pub fn add_edge(&mut self, a: DVec2, b: DVec2) {
        // Rows of the whole picture: what is added to one is the same whatever rows these are.
        let rows = [self.first_row, self.first_row + self.size_px[1]].map(f64::from);
        // Downwards, the interior lies on the right on the screen.
        let (sign, top, bottom) = if a.y <= b.y {
            (1.0, a, b)
        } else {
            (-1.0, b, a)
        };
        let (first, last) = (top.y.max(rows[0]), bottom.y.min(rows[1]));
        if first >= last || !a.is_finite() || !b.is_finite() {
            return;
        }
        let slope = (bottom.x - top.x) / (bottom.y - top.y);
        let x_at = |y: f64| top.x + (y - top.y) * slope;
        let mut y = first;
        for row in first as usize..(last.ceil() as usize) {
            let end = last.min(row as f64 + 1.0);
            let own = row - self.first_row as usize;
            self.add_in_row(own, [x_at(y), x_at(end)], sign * (end - y));
            y = end;
        }
    }

    /// Adds a piece of an edge within a row of pixels, `down` high.
    fn add_in_row(&mut self, row: usize, ends: [f64; 2], down: f64) {
        let width = f64::from(self.size_px[0]);
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        self.is_touched[row] = true;
        let at = row * (self.size_px[0] as usize + 2);
        let sums = &mut self.sums[at..at + self.size_px[0] as usize + 2];
        if low >= width {
            return;
        }
        if high <= 0.0 {
            // What lies left of the picture covers all of the row.
            sums[0] += down as f32;
            return;
        }
        let first = low.max(0.0).floor() as usize;
        if high <= first as f64 + 1.0 && low >= 0.0 {
            let middle = 0.5 * (low + high) - first as f64;
            sums[first] += (down * (1.0 - middle)) as f32;
            sums[first + 1] += (down * middle) as f32;
            return;
        }
        let per_px = down / (high - low);
        sums[0] += ((-low).max(0.0) * per_px) as f32;
        let last = high.min(width).ceil() as usize;
        for px in first..last {
            let (left, right) = (low.max(px as f64), high.min(px as f64 + 1.0));
            let part = (right - left) * per_px;
            let middle = 0.5 * (left + right) - px as f64;
            sums[px] += (part * (1.0 - middle)) as f32;
            sums[px + 1] += (part * middle) as f32;
        }
    }

    /// Writes the coverage of every pixel, 0 to 255, into the bits of its word from `shift` on, which are 0.
    pub fn write(&self, words: &mut [u32], shift: u32) {
        let width = self.size_px[0] as usize;
        let all = (self.base.clamp(0.0, 1.0) * 255.0 + 0.5) as u32;
        let sums = self.sums.chunks_exact(width + 2);
        let rows = words.chunks_exact_mut(width).zip(sums);
        for ((words, sums), is_touched) in rows.zip(&self.is_touched) {
            if !is_touched && all == 0 {
                continue;
            }
            let mut sum = self.base;
            for (word, own) in words.iter_mut().zip(sums) {
                sum += own;
                *word |= ((sum.clamp(0.0, 1.0) * 255.0 + 0.5) as u32) << shift;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn covered(size_px: [u32; 2], outlines: &[Vec<DVec2>]) -> Vec<u8> {
        let mut cover = Cover::new(0, size_px);
        for outline in outlines {
            let ends = outline.iter().zip(outline.iter().cycle().skip(1));
            for (&a, &b) in ends {
                cover.add_edge(a, b);
            }
        }
        let mut words = vec![0; size_px[0] as usize * size_px[1] as usize];
        cover.write(&mut words, 8);
        words.into_iter().map(|word| (word >> 8) as u8).collect()
    }

    fn outline(places: &[[f64; 2]]) -> Vec<DVec2> {
        places.iter().map(|place| (*place).into()).collect()
    }

    /// Down its left side.
    fn rectangle([left, top]: [f64; 2], [right, bottom]: [f64; 2]) -> Vec<DVec2> {
        outline(&[[left, top], [left, bottom], [right, bottom], [right, top]])
    }

    #[test]
    fn a_disc_covers_its_area_and_every_pixel_the_share_that_lies_within() {
        let circle: Vec<DVec2> = (0..3600)
            .map(|i| {
                let (sin, cos) = (f64::from(-i) / 3600.0 * std::f64::consts::TAU).sin_cos();
                DVec2::new(50.3 + 30.0 * cos, 49.6 + 30.0 * sin)
            })
            .collect();
        let bytes = covered([100, 100], &[circle]);
        let area: f64 = bytes.iter().map(|byte| f64::from(*byte) / 255.0).sum();
        let exact = std::f64::consts::PI * 900.0;
        assert!((area / exact - 1.0).abs() < 1e-3, "{area} {exact}");
        for (at, byte) in bytes.iter().enumerate() {
            let (x, y) = ((at % 100) as f64, (at / 100) as f64);
            // Against 32 x 32 places of the pixel.
            let within = |i: u32| {
                let (east, south) = (f64::from(i % 32), f64::from(i / 32));
                let place = [
                    x + (east + 0.5) / 32.0 - 50.3,
                    y + (south + 0.5) / 32.0 - 49.6,
                ];
                place[0].hypot(place[1]) < 30.0
            };
            let share = f64::from((0..1024).filter(|i| within(*i)).count() as u32) / 1024.0;
            assert!((f64::from(*byte) / 255.0 - share).abs() < 0.02, "{x} {y}");
        }
    }

    #[test]
    fn outlines_that_share_an_edge_leave_no_seam() {
        let left = outline(&[[2.0, 2.0], [2.0, 18.0], [9.3, 18.0], [11.7, 2.0]]);
        let right = outline(&[[11.7, 2.0], [9.3, 18.0], [18.0, 18.0], [18.0, 2.0]]);
        let both = covered([20, 20], &[left, right]);
        assert_eq!(both, covered([20, 20], &[rectangle([2.0; 2], [18.0; 2])]));
    }

    #[test]
    fn what_runs_the_other_way_is_a_hole() {
        let mut hole = rectangle([6.5, 6.0], [10.0, 10.0]);
        hole.reverse();
        let bytes = covered([20, 20], &[rectangle([2.0; 2], [18.0; 2]), hole]);
        let at = |x: usize, y: usize| bytes[y * 20 + x];
        assert_eq!(
            [at(4, 8), at(6, 8), at(7, 8), at(12, 8), at(1, 1)],
            [255, 128, 0, 255, 0]
        );
    }

    #[test]
    fn pictures_that_show_a_part_have_the_bytes_of_the_whole() {
        let star: Vec<DVec2> = (0..40)
            .map(|i| {
                let (sin, cos) = (f64::from(-i * 7) / 40.0 * std::f64::consts::TAU).sin_cos();
                DVec2::new(32.0 + 300.0 * cos, 20.0 + 33.0 * sin)
            })
            .collect();
        let whole = covered([64, 40], std::slice::from_ref(&star));
        let shifted = star
            .iter()
            .map(|place| *place - DVec2::new(16.0, 8.0))
            .collect();
        let part = covered([32, 24], &[shifted]);
        for (at, byte) in part.iter().enumerate() {
            let of_whole = whole[(at / 32 + 8) * 64 + at % 32 + 16];
            assert!(byte.abs_diff(of_whole) <= 1, "{at}: {byte} {of_whole}");
        }
    }

    #[test]
    fn what_lies_far_outside_or_is_no_number_does_no_harm() {
        let far = rectangle([-1e9, -1e9], [1e9, 1e9]);
        assert!(covered([9, 7], &[far]).iter().all(|byte| *byte == 255));
        for [left, top] in [[-1e6, 0.0], [50.0, 0.0], [0.0, -1e6], [0.0, 50.0]] {
            let beside = rectangle([left, top], [left + 20.0, top + 20.0]);
            assert!(covered([9, 7], &[beside]).iter().all(|byte| *byte == 0));
        }
        let odd = outline(&[[f64::NAN, 1.0], [3.0, f64::NAN], [5.0, 5.0]]);
        assert!(covered([9, 7], &[odd]).iter().all(|byte| *byte == 0));
    }
}
