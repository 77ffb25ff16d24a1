//! The Fourier transform of a row: X(f) = sum of x(j) exp(-2 pi i f j / n), by mixed radices (Cooley and Tukey 1965,
//! doi:10.1090/S0025-5718-1965-0178586-1).
//!
//! Plain arithmetic in a fixed order: the same bits on any processor.

use std::f64::consts::TAU;

/// A complex number.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Complex {
    pub(super) re: f64,
    pub(super) im: f64,
}

impl Complex {
    pub(super) fn new(re: f64, im: f64) -> Self {
        Self { re, im }
    }

    fn plus(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }

    fn minus(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.im - other.im)
    }

    fn times(self, other: Self) -> Self {
        Self::new(
            self.re * other.re - self.im * other.im,
            self.re * other.im + self.im * other.re,
        )
    }
}

/// Largest prime that a quick size may have.
const LARGEST_RADIX: usize = 5;

/// A transform of one size.
#[derive(Debug)]
pub(super) struct Transform {
    size: usize,
    radices: Vec<usize>,
    /// exp(-2 pi i k / size).
    roots: Vec<Complex>,
}

impl Transform {
    pub(super) fn new(size: usize) -> Self {
        let root = |k: usize| {
            let (sine, cosine) = (TAU * k as f64 / size as f64).sin_cos();
            Complex::new(cosine, -sine)
        };
        Self {
            size,
            radices: radices(size),
            roots: (0..size).map(root).collect(),
        }
    }

    /// Number of values of a row.
    pub(super) fn size(&self) -> usize {
        self.size
    }

    /// Transforms `row` into `to`, both of the transform's size.
    pub(super) fn process(&self, row: &[Complex], to: &mut [Complex]) {
        self.level(row, 1, to, &self.radices);
    }

    /// Every `stride`-th of `from`, as many as `to` holds.
    fn level(&self, from: &[Complex], stride: usize, to: &mut [Complex], radices: &[usize]) {
        let Some((&radix, rest)) = radices.split_first() else {
            to[0] = from[0];
            return;
        };
        let part = to.len() / radix;
        for (offset, to) in to.chunks_mut(part).enumerate() {
            self.level(&from[offset * stride..], stride * radix, to, rest);
        }
        if radix == 2 {
            let (even, odd) = to.split_at_mut(part);
            for (k, (a, b)) in even.iter_mut().zip(odd).enumerate() {
                let turned = b.times(self.roots[k * stride]);
                (*a, *b) = (a.plus(turned), a.minus(turned));
            }
            return;
        }
        let mut turned = vec![Complex::default(); radix];
        for k in 0..part {
            for (q, turned) in turned.iter_mut().enumerate() {
                *turned = to[q * part + k].times(self.roots[q * k * stride]);
            }
            for r in 0..radix {
                let term =
                    |q: usize| turned[q].times(self.roots[q * r * part * stride % self.size]);
                to[r * part + k] = (0..radix).map(term).fold(Complex::default(), Complex::plus);
            }
        }
    }
}

/// Primes of a size, the large ones last.
fn radices(mut size: usize) -> Vec<usize> {
    let mut found = vec![];
    let mut prime = 2;
    while size > 1 {
        if size.is_multiple_of(prime) {
            found.push(prime);
            size /= prime;
        } else {
            prime += 1;
        }
    }
    found
}

/// The least size from a number on that has small primes only.
pub(super) fn quick_size(at_least: usize) -> usize {
    let at_least = at_least.max(1);
    // There is a power of two below twice any number.
    (at_least..2 * at_least)
        .find(|size| radices(*size).iter().all(|radix| *radix <= LARGEST_RADIX))
        .unwrap_or(at_least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_sum_that_it_stands_for() {
        for size in [1, 2, 3, 4, 5, 7, 12, 30, 45, 64, 77, 360] {
            let row: Vec<Complex> = (0..size)
                .map(|j| Complex::new((j as f64 * 1.3).sin(), (j as f64 * 0.7).cos() - 0.2))
                .collect();
            let mut found = row.clone();
            Transform::new(size).process(&row, &mut found);
            for (wave, found) in found.iter().enumerate() {
                let (mut re, mut im) = (0.0, 0.0);
                for (j, x) in row.iter().enumerate() {
                    let angle = -TAU * ((wave * j) % size) as f64 / size as f64;
                    re += x.re * angle.cos() - x.im * angle.sin();
                    im += x.re * angle.sin() + x.im * angle.cos();
                }
                let off = (found.re - re).abs().max((found.im - im).abs());
                assert!(off < 1e-12 * size as f64, "{size}: {wave}: {off}");
            }
        }
    }

    #[test]
    fn quick_sizes_have_small_primes_only() {
        assert_eq!(
            [1, 7, 13, 31, 719, 1000].map(quick_size),
            [1, 8, 15, 32, 720, 1000]
        );
    }
}
