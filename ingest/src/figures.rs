//! A number in, its text as people write it out.

use std::fmt::{Display, LowerExp};

/// From here on, and below [`SMALL`], numbers are written by their size.
const LARGE: f64 = 1e7;
const SMALL: f64 = 1e-3;

/// A number with all its digits, so that it is told from its neighbours: `250`, `3.1460857`; a small or a huge one by its size, `1e-6`.
pub(crate) fn figures<T: Copy + Into<f64> + Display + LowerExp>(value: T) -> String {
    let size = value.into().abs();
    if size == 0.0 {
        // Zero has no sign.
        "0".to_owned()
    } else if (SMALL..LARGE).contains(&size) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_people_write_them() {
        for (value, text) in [
            (250.0, "250"),
            (325.0, "325"),
            (-0.0, "0"),
            (0.01, "0.01"),
            (-80_000.5, "-80000.5"),
            (-1e-6, "-1e-6"),
            (9.97e36, "9.97e36"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(figures(value), text);
        }
        assert_eq!(figures(3.146_085_7_f32), "3.1460857");
    }
}
