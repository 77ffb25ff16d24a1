//! Values as whole numbers in the same order: what percentiles are searched in.

/// A number of a value that is no NaN; larger values have larger ones. -0 is 0.
#[inline]
pub(super) fn number_of(value: f32) -> u32 {
    let bits = (value + 0.0).to_bits();
    if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    }
}

/// The value of a number.
pub(super) fn value_of(number: u32) -> f32 {
    f32::from_bits(if number >> 31 == 1 {
        number ^ (1 << 31)
    } else {
        !number
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_in_the_order_of_values_and_lead_back() {
        let mut values = vec![0.0f32, 1e-44, 1e-38, 1e-9, 1.0, 1.000_000_1, 3.4e38, 290.25];
        values.extend(values.clone().iter().map(|value| -value));
        values.sort_by(f32::total_cmp);
        let numbers: Vec<u32> = values.iter().map(|value| number_of(*value)).collect();
        assert!(numbers.is_sorted());
        for value in values {
            let back = value_of(number_of(value));
            assert_eq!(back.to_bits(), (value + 0.0).to_bits(), "{value} {back}");
        }
        assert_eq!(number_of(-0.0), number_of(0.0));
    }
}
