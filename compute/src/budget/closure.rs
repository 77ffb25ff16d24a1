//! Rows of time beside their period.

use contract::budget::{BudgetRow, Closure};

use super::fixed::{MASS_DECIMALS, decimal_text, steps_of_text};

/// What rows sum to beside their period as one row; none if a sum leaves 128 bits.
pub(super) fn of_time(rows: &[BudgetRow], total: &[BudgetRow]) -> Option<Closure> {
    Some(Closure {
        rows_kg: decimal_text(mass_steps(rows)?, MASS_DECIMALS),
        total_kg: decimal_text(mass_steps(total)?, MASS_DECIMALS),
        regions: None,
    })
}

/// Sum of rows, kg in steps of 10⁻⁹.
pub(super) fn mass_steps(rows: &[BudgetRow]) -> Option<i128> {
    let mut steps = rows
        .iter()
        .map(|row| steps_of_text(&row.budget_kg, MASS_DECIMALS));
    steps.try_fold(0i128, |sum, own| sum.checked_add(own?))
}
