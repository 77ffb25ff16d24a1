//! Numbers that mean no data in many files, and of which this file says nothing. Those that a quantity cannot be are masked as such; others must be
//! told by where they stand.

use contract::event::RejectReason;

use crate::error::Rejection;

/// Numbers that people write for no data.
const USUAL: [f64; 18] = [
    -1e20, -1e10, -99_999.0, -32_768.0, -32_767.0, -9_999.9, -9_999.0, -999.9, -999.0, -128.0,
    255.0, 999.0, 9_999.0, 32_767.0, 65_535.0, 99_999.0, 1e10, 1e20,
];
/// How much further from all others than these are from each other a single negative number must lie, where none of them is negative.
const ALONE: f64 = 10.0;
/// How near in float32 a number is the one that was meant.
const SAME: f64 = 1e-6;

/// The ends of many numbers: what tells whether one of them means no data. Those of parts add up to those of the whole.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Ends {
    /// The lowest and, with the sign turned, the highest; none of no number.
    ends: Option<[End; 2]>,
}

/// One end.
#[derive(Debug, Clone, Copy, PartialEq)]
struct End {
    number: f64,
    /// How often it is there.
    count: u64,
    /// The lowest number above it.
    next: Option<f64>,
}

impl End {
    #[expect(clippy::float_cmp, reason = "a number for no data is one exact number")]
    fn add(&mut self, number: f64, count: u64) {
        if number < self.number {
            let next = Some(self.number);
            *self = Self {
                number,
                count,
                next,
            };
        } else if number == self.number {
            self.count += count;
        } else if self.next.is_none_or(|next| number < next) {
            self.next = Some(number);
        }
    }
}

impl Ends {
    /// Adds a number; NaN is passed over.
    pub(crate) fn add(&mut self, number: f64) {
        if number.is_nan() {
            return;
        }
        let signed = [number, -number];
        match &mut self.ends {
            Some(ends) => ends
                .iter_mut()
                .zip(signed)
                .for_each(|(end, n)| end.add(n, 1)),
            None => {
                self.ends = Some(signed.map(|number| End {
                    number,
                    count: 1,
                    next: None,
                }));
            }
        }
    }

    /// Adds the ends of other numbers.
    pub(crate) fn join(&mut self, others: Self) {
        let (Some(own), Some(others)) = (&mut self.ends, others.ends) else {
            self.ends = self.ends.or(others.ends);
            return;
        };
        for (own, other) in own.iter_mut().zip(others) {
            own.add(other.number, other.count);
            // It lies above that number, and so is no end however often it is there.
            other.next.into_iter().for_each(|next| own.add(next, 1));
        }
    }

    /// Refuses stored numbers of which one usual number for no data, several times there, lies further from all others than these
    /// from each other; so does a single negative one that lies much further from others that are not negative.
    pub(crate) fn check(&self, variable: &str) -> Result<(), Rejection> {
        let Some([lowest, highest]) = self.ends else {
            return Ok(());
        };
        for (is_turned, end, far) in [(false, lowest, highest), (true, highest, lowest)] {
            let Some(next) = end.next else {
                continue;
            };
            let is_single = end.count == 1;
            let is_below_all = !is_turned && end.number < 0.0 && next >= 0.0;
            if is_single && !is_below_all {
                continue;
            }
            let as_it_is = |number: f64| if is_turned { -number } else { number };
            let number = as_it_is(end.number);
            let is_usual = USUAL
                .iter()
                .any(|usual| (number - usual).abs() <= SAME * usual.abs());
            // The other end, seen from this one.
            let far = -far.number;
            let least = if is_single { ALONE } else { 1.0 };
            if !is_usual || next - end.number <= least * (far - next) {
                continue;
            }
            let (there, near, far) = (end.count, as_it_is(next), as_it_is(far));
            let (low, high) = if is_turned { (far, near) } else { (near, far) };
            let detail = format!(
                "has {there} cells of {number} and all others are {low} to {high}, but no _FillValue or missing_value says that it means no data; say fill_values = [{number}] in a profile, or [] if it is a value"
            );
            return Err(Rejection::new(RejectReason::Values, variable, detail));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(values: &[f64]) -> Ends {
        let mut ends = Ends::default();
        for value in values {
            ends.add(*value);
        }
        ends
    }

    fn check(variable: &str, values: &[f64]) -> Result<(), Rejection> {
        let whole = ends(values);
        for at in 0..=values.len() {
            let mut parts = ends(&values[..at]);
            parts.join(ends(&values[at..]));
            assert_eq!(parts, whole, "{values:?} in two parts");
        }
        whole.check(variable)
    }

    #[test]
    fn a_number_for_no_data_that_nothing_marks_is_seen_by_its_distance() {
        for fill in [-999.0, f64::from(-999.9f32), 1e20, 255.0] {
            let refused = check("v", &[1.0, fill, 4.0, fill, f64::NAN]).unwrap_err();
            assert!(refused.to_string().contains("fill_values"), "{refused}");
        }
        assert!(
            check("v", &[1.0, 4.0, -999.0, f64::NAN]).is_err(),
            "one alone"
        );
    }

    #[test]
    fn numbers_among_others_single_ones_and_unusual_ones_are_values() {
        for values in [
            vec![-2000.0, -999.0, -999.0, 500.0],
            vec![-999.0, -999.0, 500.0, -400.0],
            vec![1.0, 400.0, -999.0],
            vec![-1.0, 4.0, -999.0],
            vec![1.0, 4.0, 999.0],
            vec![1.0, 4.0, 90.0, 90.0],
            vec![-999.0, -999.0],
            vec![],
            vec![f64::NAN],
        ] {
            check("v", &values).unwrap();
        }
    }
}
