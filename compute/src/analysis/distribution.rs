//! Chances: the normal distribution and Student's t.

use statrs::distribution::{ContinuousCDF as _, Normal, StudentsT};

/// Share of an interval that holds what it is about.
pub const CONFIDENCE: f64 = 0.95;

/// Chance of a standard normal variable as far from zero as `z` on either side.
pub fn normal_two_sided(z: f64) -> f64 {
    2.0 * Normal::standard().sf(z.abs())
}

/// How far from zero a standard normal variable lies with 95 % on either side.
pub fn normal_quantile() -> f64 {
    Normal::standard().inverse_cdf(0.5 * (1.0 + CONFIDENCE))
}

/// Chance of Student's t with `freedom` degrees as far from zero as `t` on either side; none without a degree.
pub fn student_two_sided(t: f64, freedom: f64) -> Option<f64> {
    Some((2.0 * student(freedom)?.sf(t.abs())).min(1.0))
}

/// How far from zero Student's t lies with 95 % on either side; none without a degree of freedom.
pub fn student_quantile(freedom: f64) -> Option<f64> {
    Some(student(freedom)?.inverse_cdf(0.5 * (1.0 + CONFIDENCE)))
}

fn student(freedom: f64) -> Option<StudentsT> {
    StudentsT::new(0.0, 1.0, freedom).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What `scipy.stats` prints: `tests/reference/series_statistics.py`.
    #[test]
    fn chances_are_those_of_an_independent_library() {
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        near(normal_two_sided(1.0), 0.317_310_507_862_914_15);
        near(normal_two_sided(-3.5), 0.000_465_258_158_071_050_03);
        near(normal_quantile(), 1.959_963_984_540_054);
        near(
            student_two_sided(2.0, 10.0).unwrap(),
            0.073_388_034_770_740_37,
        );
        near(
            student_two_sided(-4.2, 3.7).unwrap(),
            0.016_116_786_207_065_057,
        );
        near(student_quantile(10.0).unwrap(), 2.228_138_851_986_274);
        near(student_quantile(3.7).unwrap(), 2.867_520_707_191_189_5);
        assert_eq!(student_two_sided(2.0, 0.0), None);
        assert_eq!(student_quantile(-1.0), None);
    }
}
