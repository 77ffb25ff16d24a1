//! Errors of steps that follow each other: what a row of a budget sums, and how each step goes together with those before it.
//!
//! With rho = exp(-t / days) all that is left of the steps before is one field, which is damped from step to step: a sum over pairs of
//! steps is one over steps.

use contract::time::Period;

use super::pairs::Form;

/// Milliseconds in a day.
const DAY_MS: f64 = 86_400_000.0;

/// What the cells of one step weigh, before time.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct StepErrors {
    /// Area x standard error of each block, kg s⁻¹.
    pub(super) blocks: Vec<f64>,
    /// Their sum over cells.
    pub(super) sum: f64,
    /// Sum of their squares over cells.
    pub(super) squares: f64,
    /// Area of cells with a flux, m².
    pub(super) flux_m2: f64,
    /// Area of those with an error too, m².
    pub(super) error_m2: f64,
}

/// What one row has summed so far.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct RowSum {
    /// With the correlation that was asked for, kg².
    pub(super) variance: f64,
    /// Without any, kg².
    pub(super) squares: f64,
    /// Sum of standard errors, kg: what is left of it is the error where all have one in common.
    pub(super) sum: f64,
    /// Area x time of cells with a flux, m² s.
    pub(super) flux: f64,
    /// The same of those with an error.
    pub(super) error: f64,
    /// Errors of the steps so far as they stand at the middle of the last one.
    carried: Option<(f64, Vec<f64>)>,
}

impl RowSum {
    /// Takes a step in; what is left is a sum over pairs of its blocks, of which the variance is made.
    pub(super) fn add(&mut self, row: Period, step: Period, own: &StepErrors, days: f64) -> Form {
        let inside_ms = step.end.min(row.end).ms() - step.start.max(row.start).ms();
        let seconds = inside_ms as f64 / 1000.0;
        self.squares += own.squares * seconds * seconds;
        self.sum += own.sum * seconds;
        self.flux += own.flux_m2 * seconds;
        self.error += own.error_m2 * seconds;
        let x: Vec<f64> = own.blocks.iter().map(|share| share * seconds).collect();
        if days <= 0.0 {
            return Form { y: x.clone(), x };
        }
        let middle_days = 0.5 * (step.start.ms() as f64 + step.end.ms() as f64) / DAY_MS;
        let before: Vec<f64> = match self.carried.take() {
            Some((then_days, carried)) => {
                let left = (-(middle_days - then_days) / days).exp();
                carried.iter().map(|one| one * left).collect()
            }
            None => vec![0.0; x.len()],
        };
        // Each pair of steps stands for itself and its mirror image.
        let y = x.iter().zip(&before).map(|(x, v)| x + 2.0 * v).collect();
        let carried = x.iter().zip(&before).map(|(x, v)| x + v).collect();
        self.carried = Some((middle_days, carried));
        Form { x, y }
    }

    /// Lets go of what no later step needs.
    pub(super) fn finish(&mut self) {
        self.carried = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn period(start: &str, end: &str) -> Period {
        Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
    }

    fn of_one(share: f64) -> StepErrors {
        StepErrors {
            blocks: vec![share],
            sum: share,
            squares: share * share,
            flux_m2: 1.0,
            error_m2: 1.0,
        }
    }

    #[test]
    fn a_recursion_over_steps_is_the_sum_over_their_pairs() {
        let days = 40.0;
        let steps = [
            (period("2000-01-01", "2000-02-01"), 1.0),
            (period("2000-02-01", "2000-02-11"), -2.0),
            // A gap, and a step that the row cuts.
            (period("2000-05-01", "2000-07-01"), 0.5),
        ];
        let row = period("2000-01-01", "2000-06-01");
        let mut sum = RowSum::default();
        for (step, share) in steps {
            let form = sum.add(row, step, &of_one(share), days);
            sum.variance += form.x[0] * form.y[0];
        }
        let seconds = |step: Period| {
            (step.end.min(row.end).ms() - step.start.max(row.start).ms()) as f64 / 1000.0
        };
        let middle = |step: Period| 0.5 * (step.start.ms() + step.end.ms()) as f64 / DAY_MS;
        let (mut variance, mut squares) = (0.0, 0.0);
        for (a, x) in steps {
            squares += (x * seconds(a)).powi(2);
            for (b, y) in steps {
                let rho = (-(middle(a) - middle(b)).abs() / days).exp();
                variance += x * seconds(a) * y * seconds(b) * rho;
            }
        }
        assert!((sum.variance / variance - 1.0).abs() < 1e-13);
        assert!((sum.squares / squares - 1.0).abs() < 1e-13);
    }

    #[test]
    fn steps_on_their_own_have_no_cross_terms() {
        let mut sum = RowSum::default();
        let (a, b) = (
            period("2000-01-01", "2000-02-01"),
            period("2000-02-01", "2000-03-01"),
        );
        let row = period("2000", "2001");
        for step in [a, b] {
            let form = sum.add(row, step, &of_one(3.0), 0.0);
            assert_eq!(form.x, form.y);
            sum.variance += form.x[0] * form.y[0];
        }
        assert!((sum.variance / sum.squares - 1.0).abs() < 1e-15);
    }
}
