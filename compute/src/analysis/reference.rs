//! Series that tests share with `tests/reference/series_statistics.py`, which prints what they are held against.

/// Goes together with its next values and rises; some values are equal.
pub(super) const SERIES: [f64; 30] = [
    2.1, 2.6, 2.3, 1.7, 1.9, 2.8, 3.4, 3.1, 2.7, 2.2, 2.9, 3.6, 4.2, 3.9, 3.3, 2.8, 3.1, 3.8, 4.4,
    4.9, 4.1, 3.5, 3.8, 4.6, 5.2, 4.7, 4.3, 3.7, 4.4, 5.1,
];
/// Follows it.
pub(super) const OTHER: [f64; 30] = [
    0.4, 0.9, 1.8, 1.1, 0.2, 0.7, 1.9, 2.2, 1.4, 0.8, 0.3, 1.2, 2.4, 2.9, 1.8, 1.1, 0.9, 1.3, 2.2,
    3.1, 2.8, 1.6, 1.2, 1.9, 2.7, 3.3, 2.5, 1.4, 1.7, 2.6,
];
/// Wanders: each value keeps most of the one before.
pub(super) const SLOW: [f64; 30] = [
    0.1, 0.5, 0.9, 1.4, 1.2, 1.5, 1.1, 0.8, 0.9, 0.4, 0.1, -0.4, -0.7, -0.5, -0.9, -0.6, -0.2, 0.3,
    0.7, 1.1, 1.6, 1.9, 1.7, 2.1, 1.8, 2.3, 2.2, 1.9, 2.4, 2.6,
];

/// 0, 1, 2 ... of as many.
pub(super) fn steps(count: usize) -> Vec<f64> {
    (0..count).map(|i| i as f64).collect()
}

/// Are two numbers the same but for a share of them?
pub(super) fn near(found: f64, expected: f64, share: f64) {
    let is_near = (found - expected).abs() <= share * expected.abs();
    assert!(is_near, "{found} is not {expected}");
}
