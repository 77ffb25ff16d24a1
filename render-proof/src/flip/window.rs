//! Weighted means over windows of pixels: a plane of numbers and the weights along a row or a column in, a plane out.

/// One number a pixel.
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) values: Vec<f64>,
}

impl Plane {
    /// Every value replaced by the sum of its neighbours times `weights`, in rows by the first and in columns by the
    /// second. Windows have an odd number of weights; the picture goes on beyond its edge as it ends there.
    pub(super) fn weighed(&self, across: &[f64], down: &[f64]) -> Self {
        self.in_rows(across).in_columns(down)
    }

    fn in_rows(&self, weights: &[f64]) -> Self {
        let last = self.width.saturating_sub(1);
        let row_of = |row: &[f64]| -> Vec<f64> {
            (0..self.width)
                .map(|x| window(x, last, weights, |x| row[x]))
                .collect()
        };
        Self {
            width: self.width,
            values: self
                .values
                .chunks_exact(self.width)
                .flat_map(row_of)
                .collect(),
        }
    }

    fn in_columns(&self, weights: &[f64]) -> Self {
        let height = self.values.len() / self.width;
        let last = height.saturating_sub(1);
        let places = (0..height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        let values = places
            .map(|(x, y)| window(y, last, weights, |y| self.values[y * self.width + x]))
            .collect();
        Self {
            width: self.width,
            values,
        }
    }
}

fn window(at: usize, last: usize, weights: &[f64], value: impl Fn(usize) -> f64) -> f64 {
    let radius = weights.len() / 2;
    let places = (0..weights.len()).map(|i| (at + i).saturating_sub(radius).min(last));
    places
        .zip(weights)
        .map(|(at, weight)| value(at) * weight)
        .sum()
}

/// A number for every whole distance up to `radius` either side.
pub(super) fn weights(radius: usize, weight: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=2 * radius)
        .map(|i| weight(i as f64 - radius as f64))
        .collect()
}
