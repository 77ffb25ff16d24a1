//! [`DecodedGrid`] in, [`CheckedGrid`] out: implausible values masked and counted, or the file refused if there are many.

use contract::event::RejectReason;
use contract::masked::MaskedCells;
use contract::quantity::Quantity;
use contract::time::Period;

use crate::decode::DecodedGrid;
use crate::error::Rejection;

/// Share of the valid values that may be implausible (and is masked); more than that is a wrong unit or a wrong scale.
pub(crate) const MAX_IMPLAUSIBLE_SHARE: f64 = 0.05;

/// One step whose values can be true.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CheckedGrid {
    pub(crate) period: Period,
    /// `[row, col]`, row 0 north, stored unit, NaN for no data.
    pub(crate) values: Vec<f32>,
    pub(crate) valid_cells: u64,
    /// Cells that the file gave a value for.
    pub(crate) masked: MaskedCells,
}

impl CheckedGrid {
    /// Lowest and highest value; of none at all nothing to be used.
    pub(crate) fn range(&self) -> [f64; 2] {
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for value in &self.values {
            // NaN is neither less nor more.
            low = low.min(*value);
            high = high.max(*value);
        }
        [low.into(), high.into()]
    }
}

/// Checks one step. A step without any value passes with no valid cells; whether that is too little is for the file.
pub(crate) fn run(
    grid: DecodedGrid,
    quantity: Quantity,
    variable: &str,
) -> Result<CheckedGrid, Rejection> {
    let DecodedGrid {
        period,
        mut values,
        masked,
    } = grid;
    let plausible = quantity.plausible();
    let (mut valid_cells, mut implausible, mut example) = (0u64, 0u64, f32::NAN);
    for value in &mut values {
        if value.is_nan() {
            continue;
        }
        if is_plausible(*value, &plausible) {
            valid_cells += 1;
        } else {
            implausible += 1;
            example = *value;
            *value = f32::NAN;
        }
    }
    let all = valid_cells + implausible;
    if implausible as f64 > MAX_IMPLAUSIBLE_SHARE * all as f64 {
        let detail = format!(
            "has {implausible} of {all} values outside {:e} to {:e} {} in {period}, such as {example:e}; correct unit, scale or fill value in a profile",
            plausible.start(),
            plausible.end(),
            quantity.unit()
        );
        return Err(Rejection::new(RejectReason::Values, variable, detail));
    }
    Ok(CheckedGrid {
        period,
        values,
        valid_cells,
        masked: MaskedCells {
            implausible,
            ..masked
        },
    })
}

/// The bounds of the plausible range are rounded to float32 as the values are: exactly 1.0 of ice is plausible.
fn is_plausible(value: f32, plausible: &std::ops::RangeInclusive<f64>) -> bool {
    (*plausible.start() as f32..=*plausible.end() as f32).contains(&value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(values: Vec<f32>) -> Result<CheckedGrid, Rejection> {
        let period = Period::month(2000, 1).unwrap();
        let masked = MaskedCells {
            out_of_range: 3,
            ..MaskedCells::default()
        };
        let grid = DecodedGrid {
            period,
            values,
            masked,
        };
        run(grid, Quantity::IceFraction, "ice")
    }

    #[test]
    fn a_few_implausible_values_are_masked_and_counted() {
        let mut values = vec![0.5; 100];
        (values[0], values[1]) = (7.0, f32::NAN);
        let checked = check(values).unwrap();
        assert_eq!(checked.valid_cells, 98);
        let counts = (checked.masked.implausible, checked.masked.out_of_range);
        assert_eq!(counts, (1, 3), "one, and those masked before");
        assert!(checked.values[0].is_nan() && checked.values[1].is_nan());
        assert_eq!(check(vec![0.0, 1.0]).unwrap().valid_cells, 2);
    }

    #[test]
    fn many_implausible_values_refuse_the_file() {
        let rejection = check(vec![50.0; 100]).unwrap_err();
        assert_eq!(rejection.reason, RejectReason::Values);
        assert!(rejection.detail.contains("100 of 100"), "{rejection}");
        assert!(check(vec![f32::INFINITY; 3]).is_err());
    }

    #[test]
    fn a_step_without_values_has_no_valid_cells() {
        let checked = check(vec![f32::NAN; 10]).unwrap();
        assert_eq!((checked.valid_cells, checked.masked.implausible), (0, 0));
    }
}
