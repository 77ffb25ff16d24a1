//! Sums of steps while cells are added to them.

use super::lanes::{
    LOW_BITS, MOST_PRODUCTS, Products, Steps, Weighed, WeightExtra, add_counts, add_products,
};
use crate::reduce::accumulator::StepSums;
use crate::reduce::cells::CellWeight;

/// Cells that are added before weights leave their 64 bits: each weighs below 2³⁸.
const MOST_CELLS: usize = 1 << 24;

/// Sums by step, each kind side by side.
#[derive(Debug, Default)]
pub(super) struct Totals {
    /// Cells that were added to `counts`, `weights` and `extra`.
    cell_count: usize,
    counts: Vec<i64>,
    weights: Vec<i64>,
    /// What coverage counts besides weights.
    extra: Vec<i64>,
    sums: Vec<i128>,
    /// Cells that were added to `low` and `high`, products in two parts that are not yet in `sums`.
    product_count: usize,
    low: Vec<i64>,
    high: Vec<i64>,
    squares: Vec<i128>,
    /// Nothing where they are not wanted.
    extremes: Vec<[f32; 2]>,
    /// What was added before these.
    before: Vec<StepSums>,
}

impl Totals {
    /// Of so many steps.
    pub(super) fn new(steps: usize, with_extremes: bool) -> Self {
        let none = StepSums::default();
        let extremes = if with_extremes { steps } else { 0 };
        Self {
            cell_count: 0,
            counts: vec![0; steps],
            weights: vec![0; steps],
            extra: vec![0; steps],
            sums: vec![0; steps],
            product_count: 0,
            low: vec![0; steps],
            high: vec![0; steps],
            squares: vec![0; steps],
            extremes: vec![[none.min, none.max]; extremes],
            before: vec![none; steps],
        }
    }

    /// Adds sums of some steps of cells that weigh the same.
    pub(super) fn add(
        &mut self,
        first: usize,
        cell_count: usize,
        weight: CellWeight,
        [counts, sums, squares]: [&[i64]; 3],
    ) {
        if self.cell_count + cell_count > MOST_CELLS {
            self.put_by();
        }
        self.cell_count += cell_count;
        let steps = first..first + counts.len();
        let mut to = Weighed {
            counts: &mut self.counts[steps.clone()],
            weights: &mut self.weights[steps.clone()],
            extra: &mut self.extra[steps.clone()],
        };
        add_counts(counts, in_parts(weight), &mut to);
        let weighed = |sum: i64| i128::from(sum) * i128::from(weight.weight);
        for (own, sum) in self.sums[steps.clone()].iter_mut().zip(sums) {
            *own += weighed(*sum);
        }
        for (own, square) in self.squares[steps].iter_mut().zip(squares) {
            *own += weighed(*square);
        }
    }

    /// Adds a cell's values at steps from `first` on; is one among them that cannot be summed?
    pub(super) fn add_cell(
        &mut self,
        first: usize,
        values: &[f32],
        steps_of: Steps,
        weight: CellWeight,
    ) -> bool {
        if self.cell_count + 1 > MOST_CELLS {
            self.put_by();
        }
        if self.product_count == MOST_PRODUCTS {
            self.carry();
        }
        self.cell_count += 1;
        self.product_count += 1;
        let steps = first..first + values.len();
        let mut weighed = Weighed {
            counts: &mut self.counts[steps.clone()],
            weights: &mut self.weights[steps.clone()],
            extra: &mut self.extra[steps.clone()],
        };
        let mut products = Products {
            low: &mut self.low[steps.clone()],
            high: &mut self.high[steps],
        };
        let to = (&mut weighed, &mut products);
        add_products(values, steps_of, in_parts(weight), to)
    }

    /// Adds both parts of products to the sums.
    fn carry(&mut self) {
        let parts = self.low.iter_mut().zip(&mut self.high);
        for (sum, (low, high)) in self.sums.iter_mut().zip(parts) {
            *sum += i128::from(*low) + (i128::from(*high) << LOW_BITS);
            (*low, *high) = (0, 0);
        }
        self.product_count = 0;
    }

    /// Are extremes wanted?
    pub(super) fn looks_at_extremes(&self) -> bool {
        !self.extremes.is_empty()
    }

    /// Takes the extremes of a cell, if they are wanted.
    pub(super) fn look_at(&mut self, first: usize, values: &[f32]) {
        let own = self.extremes.get_mut(first..first + values.len());
        for ([min, max], value) in own.unwrap_or_default().iter_mut().zip(values) {
            *min = if *value < *min { *value } else { *min };
            *max = if *value > *max { *value } else { *max };
        }
    }

    /// Makes room for more cells.
    fn put_by(&mut self) {
        self.carry();
        self.cell_count = 0;
        for (step, before) in self.before.iter_mut().enumerate() {
            before.count += self.counts[step].unsigned_abs();
            before.weight += i128::from(self.weights[step]);
            before.covered += i128::from(self.weights[step]) + i128::from(self.extra[step]);
            before.sum += self.sums[step];
            before.squares += self.squares[step];
        }
        for sums in [&mut self.counts, &mut self.weights, &mut self.extra] {
            sums.fill(0);
        }
        self.sums.fill(0);
        self.squares.fill(0);
    }

    /// The sums of all steps.
    pub(super) fn finish(mut self) -> Vec<StepSums> {
        self.put_by();
        for (own, [min, max]) in self.before.iter_mut().zip(self.extremes) {
            (own.min, own.max) = (min, max);
        }
        self.before
    }
}

/// What coverage counts of a cell is told by how much it differs from the weight: mostly by nothing.
fn in_parts(CellWeight { weight, covered }: CellWeight) -> WeightExtra {
    [weight, covered - weight]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_that_leave_64_bits_are_summed_all_the_same() {
        let weight = CellWeight {
            weight: (1 << 38) - 1,
            covered: 1,
        };
        let mut totals = Totals::new(2, false);
        let (cells, times) = (1 << 12, 3 << 14);
        for _ in 0..times {
            totals.add(1, cells, weight, [&[cells as i64], &[-7], &[]]);
        }
        let all = totals.finish();
        assert_eq!(all[0], StepSums::default());
        let count = cells as u64 * times;
        assert_eq!(all[1].count, count);
        assert_eq!(all[1].weight, i128::from(count) * i128::from(weight.weight));
        assert!(all[1].weight > i128::from(u64::MAX));
        assert_eq!((all[1].covered, all[1].squares), (i128::from(count), 0));
        assert_eq!(
            all[1].sum,
            -7 * i128::from(times) * i128::from(weight.weight)
        );
    }
}
