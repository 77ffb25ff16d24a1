//! Numbers at instants in, a curve through them out that goes nowhere beyond its neighbours and rests at both ends.
//!
//! Cubic Hermite pieces with the slopes of F. N. Fritsch and R. E. Carlson: *Monotone piecewise cubic interpolation*. SIAM
//! Journal on Numerical Analysis 17 (2), 238, 1980. [doi:10.1137/0717021](https://doi.org/10.1137/0717021)

/// Radius of the circle of slopes, in those of the chord, within which a piece is monotone (Fritsch and Carlson, eq. 2.4).
const MOST_SLOPES: f64 = 3.0;

/// A number that changes with time: once differentiable, monotone where its values are, level at both ends.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Monotone {
    at: Vec<f64>,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Monotone {
    /// Through values at instants, as many of each and two at least; instants rise strictly.
    pub(super) fn through(at: &[f64], values: Vec<f64>) -> Self {
        debug_assert!(at.len() == values.len() && at.len() >= 2);
        let lengths: Vec<f64> = at.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let rises = values.windows(2).map(|pair| pair[1] - pair[0]);
        let chords: Vec<f64> = rises
            .zip(&lengths)
            .map(|(rise, length)| rise / length)
            .collect();
        let mut slopes = vec![0.0; values.len()];
        for i in 1..chords.len() {
            let (before, after) = (chords[i - 1], chords[i]);
            if before * after > 0.0 {
                // That of the parabola through three values.
                slopes[i] =
                    (before * lengths[i] + after * lengths[i - 1]) / (lengths[i - 1] + lengths[i]);
            }
        }
        for (i, chord) in chords.iter().enumerate() {
            if *chord == 0.0 {
                (slopes[i], slopes[i + 1]) = (0.0, 0.0);
                continue;
            }
            let radius = (slopes[i] / chord).hypot(slopes[i + 1] / chord);
            if radius > MOST_SLOPES {
                slopes[i] *= MOST_SLOPES / radius;
                slopes[i + 1] *= MOST_SLOPES / radius;
            }
        }
        Self {
            at: at.to_vec(),
            values,
            slopes,
        }
    }

    /// The value at an instant; beyond the ends theirs.
    pub(super) fn value(&self, at: f64) -> f64 {
        let last = self.at.len() - 2;
        let i = self
            .at
            .partition_point(|knot| *knot <= at)
            .saturating_sub(1)
            .min(last);
        let length = self.at[i + 1] - self.at[i];
        let t = ((at - self.at[i]) / length).clamp(0.0, 1.0);
        let rest = 1.0 - t;
        // Hermite's four polynomials.
        self.values[i] * (1.0 + 2.0 * t) * rest * rest
            + self.values[i + 1] * t * t * (3.0 - 2.0 * t)
            + length * t * rest * (self.slopes[i] * rest - self.slopes[i + 1] * t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of Fritsch and Carlson's kind: level, then steep, then nearly level.
    const AT: [f64; 7] = [0.0, 1.0, 1.5, 4.0, 4.2, 7.0, 9.0];
    const VALUES: [f64; 7] = [0.0, 0.0, 10.0, 10.5, 90.0, 90.1, 20.0];

    #[test]
    fn it_meets_its_values_stays_between_them_and_rests_at_both_ends() {
        let curve = Monotone::through(&AT, VALUES.to_vec());
        for (at, value) in AT.iter().zip(VALUES) {
            assert!((curve.value(*at) - value).abs() < 1e-12, "{at}");
        }
        for (pair, ends) in AT.windows(2).zip(VALUES.windows(2)) {
            let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            let way = (ends[1] - ends[0]).signum();
            let mut before = ends[0];
            for step in 0..=1000 {
                let at = pair[0] + (pair[1] - pair[0]) * f64::from(step) / 1000.0;
                let value = curve.value(at);
                assert!((low - 1e-9..=high + 1e-9).contains(&value), "{at}: {value}");
                assert!(
                    (value - before) * way >= -1e-9,
                    "{at}: {value} after {before}"
                );
                before = value;
            }
        }
        assert!((curve.value(1e-4) - VALUES[0]).abs() < 1e-6);
        assert!((curve.value(9.0 - 1e-4) - VALUES[6]).abs() < 1e-5);
        assert!(
            (curve.value(-3.0) - 0.0).abs() < 1e-12 && (curve.value(30.0) - 20.0).abs() < 1e-12
        );
    }

    #[test]
    fn slopes_are_the_same_from_both_sides_and_none_is_level_between_rising_values() {
        let rising = Monotone::through(&[0.0, 1.0, 4.0, 4.5, 9.0], vec![0.0, 5.0, 6.0, 30.0, 31.0]);
        for at in [1.0, 4.0, 4.5] {
            let step = 1e-6;
            let [before, after] =
                [-step, step].map(|step| (rising.value(at + step) - rising.value(at)) / step);
            assert!(
                (before - after).abs() < 1e-3 * after.abs(),
                "{at}: {before} {after}"
            );
            assert!(after > 0.05, "{at}: {after}");
        }
    }

    #[test]
    fn even_values_are_met_evenly_between_the_ends() {
        let even = Monotone::through(&[0.0, 1.0, 2.0, 3.0, 4.0], vec![0.0, 1.0, 2.0, 3.0, 4.0]);
        for at in [1.0, 1.25, 1.5, 2.7, 3.0] {
            assert!((even.value(at) - at).abs() < 1e-12, "{at}");
        }
    }
}
