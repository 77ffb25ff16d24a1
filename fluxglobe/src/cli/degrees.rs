//! A longitude or latitude of the command line: text in, degrees out.

/// Degrees, east and north positive: `-149.5`.
///
/// # Errors
/// Anything but a number: hemispheres are signs.
pub(super) fn degrees(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_not_a_number| {
        "degrees are a number, east and north positive: -149.5 for 149.5° W".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_letter_of_a_hemisphere_is_told_to_be_a_sign() {
        assert_eq!(degrees("-149.5"), Ok(-149.5));
        for text in ["149.5W", "10°", "north", ""] {
            let refused = degrees(text).unwrap_err();
            assert!(refused.contains("-149.5 for 149.5° W"), "{text}");
        }
    }
}
