//! CPU twin of the functions of `prelude.wgsl` that place a value in the range of colours.

use std::f32::consts::LOG2_E;

use crate::stages::params::Params;

/// Binary logarithm of a positive normal number, good to 1e-7.
fn binary_log(x: f32) -> f32 {
    let bits = x.to_bits();
    let exponent = bits.wrapping_sub(0x3f35_04f3).cast_signed() >> 23;
    let left = f32::from_bits(bits.wrapping_sub(exponent.cast_unsigned() << 23));
    let z = (left - 1.0) / (left + 1.0);
    let w = z * z;
    let series = 1.0 + w * (0.33333333 + w * (0.2 + w * (0.14285714 + w * 0.11111111)));
    exponent as f32 + 2.0 * LOG2_E * z * series
}

/// Place of a value between the ends of the range of colours, 0 to 1.
pub fn place_in_range(params: &Params, value: f32) -> f32 {
    let values = &params.values;
    let at = if values.is_log == 1 {
        binary_log(value.max(1.0e-37))
    } else {
        value
    };
    ((at - values.transfer_low) * values.transfer_per_unit).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_good_to_the_last_figures() {
        for i in -300..300 {
            let x = 1.317_f64.powi(i) * 1.000_1;
            let x = (x as f32).clamp(1e-37, 1e37);
            let expected = f64::from(x).log2();
            let apart = (f64::from(binary_log(x)) - expected).abs();
            assert!(apart < 1e-7 * expected.abs().max(1.0) * 2.0, "{x}: {apart}");
        }
        assert!(binary_log(1.0).abs() < 1e-7 && (binary_log(8.0) - 3.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_not_above_zero_lies_at_the_low_end() {
        let mut params = Params::default();
        params.values.is_log = 1;
        (params.values.transfer_low, params.values.transfer_per_unit) = (-3.0, 0.25);
        let at = |value| place_in_range(&params, value);
        assert!([-1.0, 0.0, 0.125].map(at).iter().all(|place| *place <= 0.0));
        assert!(at(1e30) >= 1.0);
        assert!((at(0.5) - 0.5).abs() < 1e-6);
    }
}
