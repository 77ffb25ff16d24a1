//! How a series goes together with itself some steps later, and how many of its values are worth one of their own.

/// Correlation of a series with itself `lag` steps later, -1 to 1; 0 where nothing is left to compare or nothing varies.
///
/// `values` are one for each step at equal distances, NaN no data. Sums of products about the one mean over the sum of
/// squares, as usual (Box and Jenkins 1976, section 2.1.5); with gaps the mean product over the pairs there are stands for all.
pub fn autocorrelation(values: &[f64], lag: usize) -> f64 {
    if lag >= values.len() {
        return 0.0;
    }
    let about = About::mean_of(values);
    let (mut products, mut pairs) = (0.0, 0.0);
    for at in 0..values.len() - lag {
        products += about.left[at] * about.left[at + lag];
        pairs += about.is_there[at] * about.is_there[at + lag];
    }
    about.correlation(values.len(), lag, products, pairs)
}

/// Values less their mean.
struct About {
    /// 0 where there is no data.
    left: Vec<f64>,
    /// 1 where there is data, else 0.
    is_there: Vec<f64>,
    count: f64,
    /// Sum of the squares of what is left.
    squares: f64,
}

impl About {
    fn mean_of(values: &[f64]) -> Self {
        let present = values.iter().filter(|value| !value.is_nan());
        let (sum, count) = present.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
        let mean = sum / count;
        let less = |value: &f64| if value.is_nan() { 0.0 } else { value - mean };
        let left: Vec<f64> = values.iter().map(less).collect();
        let is_there = |value: &f64| if value.is_nan() { 0.0 } else { 1.0 };
        Self {
            squares: left.iter().map(|left| left.powi(2)).sum(),
            left,
            is_there: values.iter().map(is_there).collect(),
            count,
        }
    }

    /// Of the sum of so many products at a lag.
    fn correlation(&self, steps: usize, lag: usize, products: f64, pairs: f64) -> f64 {
        if pairs <= 0.0 || self.squares <= 0.0 {
            return 0.0;
        }
        // Equal to products / squares where no step is missing.
        let of_all = (steps - lag) as f64 / steps as f64;
        (products / pairs * of_all / (self.squares / self.count)).clamp(-1.0, 1.0)
    }
}

/// Effective number of `count` values whose errors go together with the next ones by `r`: n (1 - r) / (1 + r), never more
/// than n (Santer et al. 2000, doi:10.1029/1999JD901105).
pub fn effective_count(count: usize, r: f64) -> f64 {
    let r = r.max(0.0);
    count as f64 * (1.0 - r) / (1.0 + r)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 1, 2, 3, 4 about 2.5: squares 5; one later 0.75 - 0.25 + 0.75 = 1.25.
    #[test]
    fn numbers_are_those_of_a_hand_calculation() {
        let values = [1.0, 2.0, 3.0, 4.0];
        assert!((autocorrelation(&values, 0) - 1.0).abs() < 1e-15);
        assert!((autocorrelation(&values, 1) - 0.25).abs() < 1e-15);
        assert!((autocorrelation(&values, 3) - -0.45).abs() < 1e-15);
        // 1, _, 3, 4 about 8/3: squares 14/3; the one pair (3, 4) 4/9, three quarters of it over 14/9.
        let gap = [1.0, f64::NAN, 3.0, 4.0];
        assert!((autocorrelation(&gap, 1) - 0.75 * (4.0 / 9.0) / (14.0 / 9.0)).abs() < 1e-15);
        for nothing in [&[][..], &[f64::NAN; 3], &[2.0; 5]] {
            assert!(autocorrelation(nothing, 1).abs() < 1e-15);
        }
        assert!((effective_count(30, 0.5) - 10.0).abs() < 1e-12);
        assert!((effective_count(30, -0.5) - 30.0).abs() < 1e-12);
    }
}
