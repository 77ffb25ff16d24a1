//! The same by random errors: fields that go together as the sum over pairs assumes, drawn, weighed and added up, as a check of it and
//! for percentiles.
//!
//! Round the whole circle errors of rows are independent from wave to wave: of each wave there is a matrix of every row with every
//! row, and a field is its Cholesky factor times normal numbers, transformed back. From step to step what is there is damped, and new errors
//! come in.

use rayon::prelude::*;

use super::pairs::Pairs;
use super::philox::normals;
use super::plane::Plane;
use super::transform::{Complex, Transform};

/// Share of a variance that is added to it, so that rounding leaves each matrix a factor.
const JITTER: f64 = 1e-10;

/// A step whose errors are drawn.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DrawnStep {
    /// Its middle.
    pub(super) middle_days: f64,
    /// Area x standard error of each block, kg s⁻¹.
    pub(super) blocks: Vec<f64>,
    /// Rows of the budget that it lies in, and for how many seconds.
    pub(super) rows: Vec<(usize, f64)>,
}

/// Draws fields over a plane.
pub(super) struct Draws {
    rows: usize,
    cols: usize,
    transform: Transform,
    /// Of each wave the lower triangle of its factor, row by row.
    factors: Vec<Vec<f64>>,
    days: f64,
    seed: u64,
}

impl Draws {
    /// `round` blocks of the plane go round the earth.
    pub(super) fn new(plane: &Plane, length_km: f64, days: f64, seed: u64, round: usize) -> Self {
        let ring = Plane {
            cols: round,
            is_ring: true,
            ..plane.clone()
        };
        let rows = ring.lats_deg.len();
        let pairs = Pairs::new(ring, length_km);
        let transform = Transform::new(round);
        let of_rows: Vec<Vec<Vec<f64>>> = (0..rows)
            .into_par_iter()
            .map(|row| {
                (0..=row)
                    .map(|other| pairs.round(row, other, &transform))
                    .collect()
            })
            .collect();
        let factors = (0..=round / 2)
            .into_par_iter()
            .map(|wave| factor(&of_rows, wave))
            .collect();
        Self {
            rows,
            cols: plane.cols,
            transform,
            factors,
            days,
            seed,
        }
    }

    /// What errors add to each row of the budget in each draw, kg: `[row][draw]`.
    pub(super) fn run(&self, steps: &[DrawnStep], row_count: usize, draws: u32) -> Vec<Vec<f64>> {
        let of_draws: Vec<Vec<f64>> = (0..draws)
            .into_par_iter()
            .map(|draw| self.one(steps, row_count, draw))
            .collect();
        (0..row_count)
            .map(|row| of_draws.iter().map(|of_draw| of_draw[row]).collect())
            .collect()
    }

    fn one(&self, steps: &[DrawnStep], row_count: usize, draw: u32) -> Vec<f64> {
        let (size, waves) = (self.transform.size(), self.factors.len());
        let mut sums = vec![0.0; row_count];
        let mut waves_now = vec![Complex::default(); self.rows * waves];
        let mut then_days: Option<f64> = None;
        let (mut row, mut field) = (
            vec![Complex::default(); size],
            vec![Complex::default(); size],
        );
        for (number, step) in (0..).zip(steps) {
            let left = match then_days {
                Some(then) if self.days > 0.0 => (-(step.middle_days - then) / self.days).exp(),
                _ => 0.0,
            };
            then_days = Some(step.middle_days);
            self.renew(&mut waves_now, left, [draw, number]);
            let mut sum = 0.0;
            for (at, blocks) in step.blocks.chunks(self.cols).enumerate() {
                let own = &waves_now[at * waves..(at + 1) * waves];
                for wave in 0..size {
                    // A row of real numbers: waves beyond the half are mirror images.
                    let mirrored = own[wave.min(size - wave)];
                    let im = if 2 * wave <= size {
                        -mirrored.im
                    } else {
                        mirrored.im
                    };
                    row[wave] = Complex::new(mirrored.re, im);
                }
                self.transform.process(&row, &mut field);
                sum += blocks
                    .iter()
                    .zip(&field)
                    .map(|(own, error)| own * error.re)
                    .sum::<f64>();
            }
            sum /= (size as f64).sqrt();
            for (row, seconds) in &step.rows {
                sums[*row] += sum * seconds;
            }
        }
        sums
    }

    /// Damps what is there to `left` of it and adds new errors, so that the variance stays 1.
    fn renew(&self, now: &mut [Complex], left: f64, [draw, step]: [u32; 2]) {
        let new = (1.0 - left * left).sqrt();
        let waves = self.factors.len();
        let mut drawn = vec![Complex::default(); self.rows];
        for (wave, factor) in self.factors.iter().enumerate() {
            let has_mirror = wave != 0 && 2 * wave != self.transform.size();
            for (pair, drawn) in drawn.chunks_mut(2).enumerate() {
                let own = normals([pair as u32, wave as u32, step, draw], self.seed);
                for (drawn, [re, im]) in drawn.iter_mut().zip([[own[0], own[1]], [own[2], own[3]]])
                {
                    *drawn = if has_mirror {
                        Complex::new(re * 0.5f64.sqrt(), im * 0.5f64.sqrt())
                    } else {
                        Complex::new(re, 0.0)
                    };
                }
            }
            let mut first = 0;
            for row in 0..self.rows {
                let (mut re, mut im) = (0.0, 0.0);
                for (share, drawn) in factor[first..=first + row].iter().zip(&drawn) {
                    re += share * drawn.re;
                    im += share * drawn.im;
                }
                first += row + 1;
                let own = &mut now[row * waves + wave];
                *own = Complex::new(left * own.re + new * re, left * own.im + new * im);
            }
        }
    }
}

/// The Cholesky factor of a wave, its lower triangle row by row.
fn factor(of_rows: &[Vec<Vec<f64>>], wave: usize) -> Vec<f64> {
    let rows = of_rows.len();
    let at = |row: usize, col: usize| row * (row + 1) / 2 + col;
    let mut own = vec![0.0; rows * (rows + 1) / 2];
    for row in 0..rows {
        for col in 0..=row {
            let mut left = of_rows[row][col][wave];
            for before in 0..col {
                left -= own[at(row, before)] * own[at(col, before)];
            }
            own[at(row, col)] = if row == col {
                (left + JITTER * of_rows[row][row][wave].abs())
                    .max(0.0)
                    .sqrt()
            } else {
                let diagonal: f64 = own[at(col, col)];
                if diagonal > 0.0 { left / diagonal } else { 0.0 }
            };
        }
    }
    own
}

#[cfg(test)]
mod tests {
    use super::super::pairs::Form;
    use super::*;

    /// Two steps over part of a ring of 24 columns, in one row of the budget.
    fn steps() -> (Plane, Vec<DrawnStep>) {
        let plane = Plane {
            lats_deg: vec![52.5, 37.5, 22.5, 7.5],
            dlon_deg: 15.0,
            cols: 9,
            is_ring: false,
        };
        let step = |day: f64| DrawnStep {
            middle_days: day,
            blocks: (0..36).map(|i| 1.0 + (f64::from(i) + day).sin()).collect(),
            rows: vec![(0, 2.0)],
        };
        (plane, vec![step(0.0), step(30.0)])
    }

    #[test]
    fn draws_spread_as_the_sum_over_pairs_says() {
        let (plane, steps) = steps();
        for (length_km, days) in [(800.0, 0.0), (3000.0, 40.0)] {
            let pairs = Pairs::new(plane.clone(), length_km);
            let form = |a: usize, b: usize| {
                pairs.spectrum(&Form {
                    x: steps[a].blocks.clone(),
                    y: steps[b].blocks.clone(),
                })
            };
            let own = pairs.sums(&[form(0, 0), form(1, 1), form(0, 1)]);
            let rho = if days > 0.0 {
                f64::exp(-30.0 / days)
            } else {
                0.0
            };
            let variance = 4.0 * (own[0] + own[1] + 2.0 * rho * own[2]);
            let draws = 4000;
            let found = Draws::new(&plane, length_km, days, 11, 24).run(&steps, 1, draws);
            let spread = found[0].iter().map(|x| x * x).sum::<f64>() / f64::from(draws);
            // Four standard errors of a variance of so many draws.
            let slack = 4.0 * (2.0 / f64::from(draws)).sqrt();
            assert!(
                (spread / variance - 1.0).abs() < slack,
                "{spread} {variance}"
            );
        }
    }

    #[test]
    fn any_number_of_threads_draws_the_same_and_another_seed_others() {
        let (plane, steps) = steps();
        let with = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| Draws::new(&plane, 900.0, 20.0, seed, 24).run(&steps, 1, 20))
        };
        assert_eq!(with(1, 5), with(4, 5));
        assert_ne!(with(1, 5), with(1, 6));
    }
}
