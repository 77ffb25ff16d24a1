//! Sums over all pairs of blocks, x R y with rho = exp(-d / length), in the time of a transform.
//!
//! The distance of two blocks depends on their rows and on how many columns lie between them: R is a matrix of convolutions along
//! rows, one a pair of rows, and the Fourier transform of rows turns each into a product. Where columns do not go round, rows are
//! continued with zeros so far that no end meets the other. Nothing is left out: it is the sum over pairs up to rounding.
//!
//! Rows are summed apart and added in their order, so that any number of threads gives the same bits.

use rayon::prelude::*;

use super::plane::{Plane, SPHERE_RADIUS_KM};
use super::transform::{Complex, Transform, quick_size};

/// The two sides of a sum, `[row, col]` in the plane.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Form {
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
}

/// Both sides of a form, transformed: `[row, wave]` of real and imaginary parts of x, then of y.
pub(super) struct Spectrum(Vec<[f64; 4]>);

/// Sums over the pairs of a plane.
pub(super) struct Pairs {
    plane: Plane,
    length_km: f64,
    /// Of a row with its zeros.
    transform: Transform,
    /// Squared sine of half the longitude between columns, by how many lie between them.
    haversines: Vec<f64>,
}

impl Pairs {
    /// `length_km` is above 0.
    pub(super) fn new(plane: Plane, length_km: f64) -> Self {
        let size = transform_size(&plane);
        let haversine = |cols: usize| {
            (0.5 * (cols as f64 * plane.dlon_deg).to_radians())
                .sin()
                .powi(2)
        };
        Self {
            transform: Transform::new(size),
            haversines: (0..=size / 2).map(haversine).collect(),
            plane,
            length_km,
        }
    }

    /// Waves that say all of a row of real numbers.
    fn waves(&self) -> usize {
        self.transform.size() / 2 + 1
    }

    /// A form as its sums are taken of.
    pub(super) fn spectrum(&self, form: &Form) -> Spectrum {
        let (cols, size) = (self.plane.cols, self.transform.size());
        let mut all = Vec::with_capacity(self.plane.lats_deg.len() * self.waves());
        let (mut row, mut waves) = (
            vec![Complex::default(); size],
            vec![Complex::default(); size],
        );
        for (x, y) in form.x.chunks(cols).zip(form.y.chunks(cols)) {
            // Two rows of real numbers at once, as the parts of one of complex ones.
            for (both, (x, y)) in row.iter_mut().zip(x.iter().zip(y)) {
                *both = Complex::new(*x, *y);
            }
            self.transform.process(&row, &mut waves);
            all.extend((0..self.waves()).map(|wave| {
                let (own, mirrored) = (waves[wave], waves[(size - wave) % size]);
                let x = [own.re + mirrored.re, own.im - mirrored.im];
                let y = [own.im + mirrored.im, mirrored.re - own.re];
                [0.5 * x[0], 0.5 * x[1], 0.5 * y[0], 0.5 * y[1]]
            }));
        }
        Spectrum(all)
    }

    /// The sum over pairs of each form.
    pub(super) fn sums(&self, forms: &[Spectrum]) -> Vec<f64> {
        let rows = self.plane.lats_deg.len();
        let of_rows: Vec<Vec<f64>> = (0..rows)
            .into_par_iter()
            .map(|row| self.of_row(row, forms))
            .collect();
        let mut sums = vec![0.0; forms.len()];
        for of_row in of_rows {
            for (sum, part) in sums.iter_mut().zip(of_row) {
                *sum += part;
            }
        }
        let size = self.transform.size() as f64;
        sums.iter().map(|sum| sum / size).collect()
    }

    /// Pairs of a row with itself and with each row after it.
    fn of_row(&self, row: usize, forms: &[Spectrum]) -> Vec<f64> {
        let mut sums = vec![0.0; forms.len()];
        let size = self.transform.size();
        let (mut table, mut kernel) = (
            vec![Complex::default(); size],
            vec![Complex::default(); size],
        );
        let rows = self.plane.lats_deg.len();
        for first in (row..rows).step_by(2) {
            let second = (first + 1).min(rows - 1);
            self.kernels(row, [first, second], &mut table);
            self.transform.process(&table, &mut kernel);
            let is_diagonal = first == row;
            for (sum, form) in sums.iter_mut().zip(forms) {
                let own = self.waves_of(form, row);
                // Kernels are even, so that the transform of each is real: they stay apart.
                let along = |other: usize, of: fn(&Complex) -> f64| {
                    let other = self.waves_of(form, other);
                    let waves = kernel.iter().map(of).zip(own.iter().zip(other));
                    waves
                        .enumerate()
                        .fold(0.0, |sum, (wave, (kernel, (a, b)))| {
                            let here = a[0] * b[2] + a[1] * b[3];
                            let there = b[0] * a[2] + b[1] * a[3];
                            self.times(wave) * kernel * (here + there) + sum
                        })
                };
                let share = if is_diagonal { 0.5 } else { 1.0 };
                *sum += share * along(first, |both| both.re);
                if second > first {
                    *sum += along(second, |both| both.im);
                }
            }
        }
        sums
    }

    /// How two rows go together wave by wave where as many columns as `transform` takes go round.
    pub(super) fn round(&self, row: usize, other: usize, transform: &Transform) -> Vec<f64> {
        let size = transform.size();
        let (mut table, mut waves) = (
            vec![Complex::default(); size],
            vec![Complex::default(); size],
        );
        self.kernels(row, [other, other], &mut table);
        transform.process(&table, &mut waves);
        waves[..=size / 2].iter().map(|wave| wave.re).collect()
    }

    fn waves_of<'a>(&self, form: &'a Spectrum, row: usize) -> &'a [[f64; 4]] {
        let waves = self.waves();
        &form.0[row * waves..(row + 1) * waves]
    }

    /// A wave stands for its mirror image too, but for those that have none.
    fn times(&self, wave: usize) -> f64 {
        if wave == 0 || 2 * wave == self.transform.size() {
            1.0
        } else {
            2.0
        }
    }

    /// How a row goes together with two others, by columns between them: as real and as imaginary parts.
    fn kernels(&self, row: usize, others: [usize; 2], table: &mut [Complex]) {
        let lats_rad = |row: usize| self.plane.lats_deg[row].to_radians();
        let own = lats_rad(row);
        let [first, second] = others.map(|other| {
            let other = lats_rad(other);
            let across = (0.5 * (own - other)).sin().powi(2);
            move |along: f64| across + own.cos() * other.cos() * along
        });
        let rho = |haversine: f64| {
            let distance_km = 2.0 * SPHERE_RADIUS_KM * haversine.min(1.0).sqrt().asin();
            (-distance_km / self.length_km).exp()
        };
        let size = table.len();
        for (cols, along) in self.haversines.iter().enumerate().take(size / 2 + 1) {
            let both = Complex::new(rho(first(*along)), rho(second(*along)));
            table[cols] = both;
            table[(size - cols) % size] = both;
        }
    }
}

/// Columns of a row with its zeros: those that go round need none if their number is quick, others as many as keep both ends apart.
pub(super) fn transform_size(plane: &Plane) -> usize {
    if plane.is_ring && quick_size(plane.cols) == plane.cols {
        plane.cols
    } else {
        quick_size(2 * plane.cols - 1)
    }
}

#[cfg(test)]
mod tests;
