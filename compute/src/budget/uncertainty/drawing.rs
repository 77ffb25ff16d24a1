//! A Monte Carlo beside the sum over pairs: steps gathered, errors drawn, budgets spread.

use std::sync::Arc;

use contract::budget::{BudgetErrors, BudgetRow, MonteCarlo, RowDraws};
use contract::grid::Grid;
use contract::manifest::Step;

use super::draws::{DrawnStep, Draws};
use super::errors::Errors;
use super::plane::Window;
use super::scheme::of_draws;
use super::summing::{blocking, weighed};
use crate::ComputeError;
use crate::budget::rows::KG_PER_TG;
use crate::region::loaded::RegionWeights;

/// Milliseconds in a day.
const DAY_MS: f64 = 86_400_000.0;
/// Percent of draws below the lower end of the interval; as many are above the upper one.
const BELOW_PERCENT: f64 = 2.5;

/// Steps whose errors are to be drawn.
pub(super) struct Drawing {
    grid: Grid,
    window: Window,
    region: Arc<RegionWeights>,
    length_km: f64,
    days: f64,
    asked: MonteCarlo,
    steps: Vec<DrawnStep>,
}

impl Drawing {
    /// None where nothing is asked to be drawn.
    ///
    /// # Errors
    /// `Uncertainty` where it would not end in time.
    pub(super) fn new(
        grid: &Grid,
        window: &Window,
        region: &Arc<RegionWeights>,
        errors: &BudgetErrors,
        step_count: usize,
    ) -> Result<Option<Self>, ComputeError> {
        let Some(asked) = errors.monte_carlo else {
            return Ok(None);
        };
        Ok(Some(Self {
            window: of_draws(grid, window, errors.length_km, step_count, asked.draws)?,
            grid: *grid,
            region: Arc::clone(region),
            length_km: errors.length_km,
            days: errors.days,
            asked,
            steps: vec![],
        }))
    }

    /// Takes a step in.
    pub(super) async fn take(
        &mut self,
        step: &Step,
        rows: &[BudgetRow],
        (values, errors): (&Arc<Vec<Vec<f32>>>, &Errors),
    ) -> Result<(), ComputeError> {
        let (grid, window, region) = (self.grid, self.window.clone(), Arc::clone(&self.region));
        let (values, errors) = (Arc::clone(values), errors.clone());
        let own = blocking(move || weighed(&grid, &window, &region, (&values, &errors))).await?;
        let (start, end) = (step.period.start, step.period.end);
        let inside_ms = |row: &BudgetRow| end.min(row.end).ms() - start.max(row.start).ms();
        let inside = rows.iter().map(inside_ms).enumerate();
        let inside = inside.filter(|(_, inside_ms)| *inside_ms > 0);
        self.steps.push(DrawnStep {
            middle_days: 0.5 * (start.ms() as f64 + end.ms() as f64) / DAY_MS,
            blocks: own.blocks,
            rows: inside
                .map(|(row, inside_ms)| (row, inside_ms as f64 / 1000.0))
                .collect(),
        });
        Ok(())
    }

    /// Draws, and what budgets of rows come to.
    pub(super) async fn run(self, rows: &[BudgetRow]) -> Result<Vec<RowDraws>, ComputeError> {
        let row_count = rows.len();
        let drawn = blocking(move || {
            let plane = self.window.plane(&self.grid);
            let round = self.window.round(&self.grid).unwrap_or(plane.cols);
            let draws = Draws::new(&plane, self.length_km, self.days, self.asked.seed, round);
            draws.run(&self.steps, row_count, self.asked.draws)
        });
        let drawn = drawn.await?;
        let of_row = |(row, kg): (&BudgetRow, Vec<f64>)| spread(row.budget_tg, kg);
        Ok(rows.iter().zip(drawn).map(of_row).collect())
    }
}

/// How budgets spread about `budget_tg` with so many kg added in each draw.
fn spread(budget_tg: f64, mut added_kg: Vec<f64>) -> RowDraws {
    added_kg.sort_unstable_by(f64::total_cmp);
    let count = added_kg.len() as f64;
    let mean = added_kg.iter().sum::<f64>() / count;
    let squares: f64 = added_kg.iter().map(|kg| (kg - mean).powi(2)).sum();
    let sigma_tg = (squares / (count - 1.0)).sqrt() / KG_PER_TG;
    // Straight in rank, as percentiles of series are.
    let percentile = |percent: f64| {
        let rank = percent / 100.0 * (count - 1.0);
        let (low, high) = (rank.floor() as usize, rank.ceil() as usize);
        let within = added_kg[low] + (added_kg[high] - added_kg[low]) * rank.fract();
        budget_tg + within / KG_PER_TG
    };
    RowDraws {
        sigma_tg,
        sigma_error_tg: sigma_tg / (2.0 * (count - 1.0)).sqrt(),
        p2_5_tg: percentile(BELOW_PERCENT),
        p97_5_tg: percentile(100.0 - BELOW_PERCENT),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_that_of_its_draws() {
        // 0 to 40 Tg: mean 20, variance 41 * 42 / 12.
        let added: Vec<f64> = (0..41).map(|tg| f64::from(tg) * KG_PER_TG).rev().collect();
        let own = spread(100.0, added);
        let sigma = (41.0 * 42.0 / 12.0f64).sqrt();
        assert!((own.sigma_tg - sigma).abs() < 1e-9);
        assert!((own.sigma_error_tg - sigma / 80f64.sqrt()).abs() < 1e-9);
        assert!((own.p2_5_tg - 101.0).abs() < 1e-9 && (own.p97_5_tg - 139.0).abs() < 1e-9);
    }
}
