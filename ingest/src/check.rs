//! [`DecodedBand`] in, [`CheckedBand`] out: implausible values masked and counted over all bands of a step, and the file refused
//! if there are many.

use contract::event::RejectReason;
use contract::masked::MaskedCells;
use contract::quantity::Quantity;
use contract::time::Period;

use crate::decode::DecodedBand;
use crate::error::Rejection;
use crate::figures::figures;
use crate::plan::cf::unmarked::Ends;

/// Share of the valid values that may be implausible (and is masked); more than that is a wrong unit or a wrong scale.
pub(crate) const MAX_IMPLAUSIBLE_SHARE: f64 = 0.05;

/// Some rows of one step, whose values can be true: `[row, col]`, from the north, stored unit, NaN for no data.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CheckedBand(pub(crate) Vec<f32>);

/// What was found in the bands of one step so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found {
    pub(crate) valid_cells: u64,
    /// Cells that the file gave a value for.
    pub(crate) masked: MaskedCells,
    /// Lowest and highest value; of none at all nothing to be used.
    range: [f32; 2],
    /// One of the implausible ones.
    example: f32,
    ends: Ends,
}

impl Found {
    /// Before the first band.
    pub(crate) fn nothing() -> Self {
        Self {
            valid_cells: 0,
            masked: MaskedCells::default(),
            range: [f32::INFINITY, f32::NEG_INFINITY],
            example: f32::NAN,
            ends: Ends::default(),
        }
    }

    /// Lowest and highest value; of none at all nothing to be used.
    pub(crate) fn range(&self) -> [f64; 2] {
        self.range.map(f64::from)
    }

    /// Masks what cannot be true, and counts.
    pub(crate) fn band(&mut self, band: DecodedBand, quantity: Quantity) -> CheckedBand {
        let DecodedBand {
            mut values,
            masked,
            ends,
        } = band;
        self.masked = self.masked + masked;
        self.ends.join(ends);
        let plausible = quantity.plausible();
        let [low, high] = &mut self.range;
        for value in &mut values {
            if value.is_nan() {
                continue;
            }
            if is_plausible(*value, &plausible) {
                self.valid_cells += 1;
                (*low, *high) = (low.min(*value), high.max(*value));
            } else {
                self.masked.implausible += 1;
                self.example = *value;
                *value = f32::NAN;
            }
        }
        CheckedBand(values)
    }

    /// Checks the step after its last band. One without any value passes with no valid cells; whether that is too little is for
    /// the file.
    pub(crate) fn check(
        &self,
        quantity: Quantity,
        variable: &str,
        period: Period,
    ) -> Result<(), Rejection> {
        self.ends.check(variable)?;
        let implausible = self.masked.implausible;
        let all = self.valid_cells + implausible;
        if implausible as f64 > MAX_IMPLAUSIBLE_SHARE * all as f64 {
            let plausible = quantity.plausible();
            let detail = format!(
                "has {implausible} of {all} values outside {} to {} {} in {period}, such as {}; correct unit, scale or fill value in a profile",
                figures(*plausible.start()),
                figures(*plausible.end()),
                quantity.unit(),
                figures(self.example)
            );
            return Err(Rejection::new(RejectReason::Values, variable, detail));
        }
        Ok(())
    }
}

/// The bounds of the plausible range are rounded to float32 as the values are: exactly 1.0 of ice is plausible.
fn is_plausible(value: f32, plausible: &std::ops::RangeInclusive<f64>) -> bool {
    (*plausible.start() as f32..=*plausible.end() as f32).contains(&value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step that comes in bands of so many values.
    fn check(values: &[f32], band: usize) -> Result<(Found, Vec<f32>), Rejection> {
        let mut found = Found::nothing();
        let mut checked = vec![];
        for (at, values) in values.chunks(band).enumerate() {
            let masked = MaskedCells {
                out_of_range: if at == 0 { 3 } else { 0 },
                ..MaskedCells::default()
            };
            let band = DecodedBand {
                values: values.to_vec(),
                masked,
                ends: Ends::default(),
            };
            checked.extend(found.band(band, Quantity::IceFraction).0);
        }
        found.check(
            Quantity::IceFraction,
            "ice",
            Period::month(2000, 1).unwrap(),
        )?;
        Ok((found, checked))
    }

    #[test]
    fn a_few_implausible_values_are_masked_and_counted_over_all_bands() {
        let mut values = vec![0.5; 100];
        (values[0], values[1], values[99], values[50]) = (7.0, f32::NAN, 8.0, 0.25);
        for band in [100, 30, 1] {
            let (found, checked) = check(&values, band).unwrap();
            assert_eq!(found.valid_cells, 97);
            let counts = (found.masked.implausible, found.masked.out_of_range);
            assert_eq!(counts, (2, 3), "two, and those masked before");
            assert!([0, 1, 99].iter().all(|at| checked[*at].is_nan()));
            assert_eq!(
                found.range().map(f64::to_bits),
                [0.25, 0.5].map(f64::to_bits)
            );
        }
        assert_eq!(check(&[0.0, 1.0], 2).unwrap().0.valid_cells, 2);
    }

    #[test]
    fn many_implausible_values_refuse_the_file_wherever_they_are() {
        let rejection = check(&[50.0; 100], 100).unwrap_err();
        assert_eq!(rejection.reason, RejectReason::Values);
        let told = "has 100 of 100 values outside 0 to 1 ";
        assert!(rejection.detail.contains(told), "{rejection}");
        assert!(rejection.detail.contains("such as 50;"), "{rejection}");
        assert!(check(&[f32::INFINITY; 3], 3).is_err());
        // Six of a hundred, all of them in one band or one in each.
        let few = |at: fn(usize) -> bool| {
            let value = |i: usize| if at(i) { 50.0 } else { 0.5 };
            (0..100).map(value).collect::<Vec<f32>>()
        };
        for values in [few(|i| i < 6), few(|i| i > 93), few(|i| i % 16 == 15)] {
            let rejection = check(&values, 10).unwrap_err();
            assert!(rejection.detail.contains("6 of 100"), "{rejection}");
        }
        assert!(check(&few(|i| i < 5), 10).is_ok(), "half of the first band");
    }

    #[test]
    fn a_step_without_values_has_no_valid_cells() {
        let (found, _) = check(&[f32::NAN; 10], 4).unwrap();
        assert_eq!((found.valid_cells, found.masked.implausible), (0, 0));
    }
}
