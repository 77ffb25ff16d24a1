//! Whole numbers of a file that are stored as they are: those that a float32 does not hold are refused where they are codes, of which
//! each would become another one, and told of where they are not. Codes may be kept as numbers of floating point.

use std::sync::atomic::{AtomicBool, Ordering};

use contract::event::RejectReason;
use contract::quantity::Quantity;
use contract::time::Period;

use crate::error::Rejection;
use crate::inspect::file::description::Kind;
use crate::plan::cf::packing::Unpacked;
use crate::plan::{Plan, PlannedStep};

/// From here on a float32 does not hold every whole number.
const EXACT: u64 = 1 << 24;
/// From here on the reader, which gives numbers as float64, does not either.
const READ_EXACTLY: f64 = (1u64 << 53) as f64;

/// Those of one variable.
#[derive(Debug)]
pub(crate) struct WholeNumbers {
    variable: String,
    are_codes: bool,
    /// Was one found that values do not hold?
    is_rounded: AtomicBool,
}

impl WholeNumbers {
    /// Those of a plan; none of a variable whose numbers are shorter, have fractions and are no codes, or become others.
    pub(crate) fn of(plan: &Plan) -> Option<Self> {
        let stays = |step: &PlannedStep| is_identity(step.factor, step.offset);
        let (packing, quantity) = (&plan.packing, plan.target.quantity);
        let is_long = match plan.variable.kind {
            Kind::Integer(bytes) | Kind::Unsigned(bytes) => bytes >= 4,
            Kind::Float(bytes) => bytes > 4 && !quantity.flags().is_empty(),
            Kind::Text(_) | Kind::Other => false,
        };
        let is_kept =
            is_long && is_identity(packing.scale, packing.offset) && plan.steps.iter().all(stays);
        // A count has the unit 1, and says so.
        let is_count =
            quantity.flags().is_empty() && plan.variable.attributes.text("units").is_some();
        is_kept.then(|| Self {
            variable: plan.variable.name.clone(),
            are_codes: matches!(quantity, Quantity::Open(_)) && quantity.unit() == "1" && !is_count,
            is_rounded: AtomicBool::new(false),
        })
    }

    /// Looks at the values of some rows of a step.
    ///
    /// # Errors
    /// One of them is a code that values do not hold.
    pub(crate) fn check(
        &self,
        values: impl Iterator<Item = Unpacked>,
        period: Period,
    ) -> Result<(), Rejection> {
        let mut lost = values.filter_map(|value| match value {
            Unpacked::Value(value) => {
                Some(value).filter(|value| value.fract() == 0.0 && !is_held(*value))
            }
            Unpacked::Missing | Unpacked::OutOfRange => None,
        });
        let Some(lost) = lost.next() else {
            return Ok(());
        };
        if !self.are_codes {
            self.is_rounded.store(true, Ordering::Relaxed);
            return Ok(());
        }
        let detail = format!(
            "has the code {lost} in {period}, which would become another one: values are of float32, which holds all whole numbers to {EXACT} alone; number the codes anew, or state the unit of what is no code"
        );
        Err(Rejection::new(RejectReason::Values, &self.variable, detail))
    }

    /// What is told of those that were looked at.
    pub(crate) fn said(&self) -> Option<String> {
        let said = || {
            format!(
                "{}: has whole numbers beyond {EXACT} that float32 does not hold; they are rounded to its 24 bits",
                self.variable
            )
        };
        self.is_rounded.load(Ordering::Relaxed).then(said)
    }
}

#[expect(clippy::float_cmp, reason = "a whole number is one exact number")]
fn is_held(value: f64) -> bool {
    f64::from(value as f32) == value && value.abs() < READ_EXACTLY
}

#[expect(clippy::float_cmp, reason = "what changes nothing is one exact number")]
fn is_identity(factor: f64, offset: f64) -> bool {
    factor == 1.0 && offset == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looked_at(are_codes: bool, values: &[Unpacked]) -> (Result<(), Rejection>, Option<String>) {
        let whole = WholeNumbers {
            variable: "basin".to_owned(),
            are_codes,
            is_rounded: AtomicBool::new(false),
        };
        let checked = whole.check(values.iter().copied(), Period::month(2001, 1).unwrap());
        (checked, whole.said())
    }

    #[test]
    fn codes_that_would_become_others_are_refused_and_numbers_told_of() {
        let (even, odd) = (16_777_218.0, 16_777_217.0);
        for lost in [odd, -odd, 9_007_199_254_740_992.0] {
            let values = [
                Unpacked::Value(even),
                Unpacked::Missing,
                Unpacked::Value(lost),
            ];
            let (checked, _) = looked_at(true, &values);
            let refused = checked.unwrap_err().to_string();
            assert!(
                refused.contains(&format!("the code {lost} in 2001-01")),
                "{refused}"
            );
            let (checked, said) = looked_at(false, &values);
            assert!(checked.is_ok() && said.is_some_and(|line| line.contains("16777216")));
        }
        for values in [
            [Unpacked::Value(even), Unpacked::Value(16_777_216.0)],
            [Unpacked::Missing, Unpacked::OutOfRange],
            // No whole numbers.
            [Unpacked::Value(0.1), Unpacked::Value(f64::NAN)],
        ] {
            assert_eq!(looked_at(true, &values), (Ok(()), None));
            assert_eq!(looked_at(false, &values), (Ok(()), None));
        }
    }
}
