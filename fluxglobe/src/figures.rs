//! Numbers for people: so many decimals where these say something, figures and size where they do not.

/// A number with so many decimals; one of which they would show little but zeros, or a huge one, by its size: `-1.2345e-9`.
pub(crate) fn figures(value: f64, decimals: usize) -> String {
    // Zero has no sign.
    let value = value + 0.0;
    if value != 0.0 && !(1e-3..1e9).contains(&value.abs()) {
        format!("{value:.decimals$e}")
    } else {
        format!("{value:.decimals$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_nothing_is_not_shown_as_zero() {
        let texts = [0.0, -0.0, -2.5, 0.001, -5.763_9e-12, 4e-4, 2e9].map(|it| figures(it, 4));
        let expected = [
            "0.0000",
            "0.0000",
            "-2.5000",
            "0.0010",
            "-5.7639e-12",
            "4.0000e-4",
            "2.0000e9",
        ];
        assert_eq!(texts, expected);
        assert_eq!(figures(-0.000_12, 3), "-1.200e-4");
    }
}
