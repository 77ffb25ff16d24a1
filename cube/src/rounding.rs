//! Means of levels are kept in fewer digits than values: a float in, the nearest one of so many bits out. Pure.

/// Bits of the mantissa that are kept, the leading one not counted: 2⁻¹⁶ of a value are lost at most.
pub(crate) const KEPT_BITS: u32 = 15;

/// The nearest value of [`KEPT_BITS`] bits, of two the even one.
pub(crate) fn rounded(value: f32) -> f32 {
    const CUT: u32 = f32::MANTISSA_DIGITS - 1 - KEPT_BITS;
    if !value.is_finite() {
        return value;
    }
    let bits = value.to_bits();
    let is_odd = (bits >> CUT) & 1;
    let up = bits + (1 << (CUT - 1)) - 1 + is_odd;
    let near = f32::from_bits(up >> CUT << CUT);
    // The largest numbers have nothing above them.
    if near.is_finite() { near } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_number_of_fewer_bits_is_kept() {
        for value in [1.0_f32, -290.153_7, 7.393_315e-10, 3.0e38, -1.5e-39, 0.0] {
            let near = rounded(value);
            let off = f64::from(near) - f64::from(value);
            assert!(
                off.abs() <= f64::from(value.abs()) * f64::exp2(-16.0) + 1e-40,
                "{value}"
            );
            assert_eq!(near.to_bits() & 0xFF, 0, "{value}");
            assert_eq!(rounded(near).to_bits(), near.to_bits());
        }
        assert!(rounded(f32::NAN).is_nan());
        assert!(rounded(f32::MAX).is_finite());
        // Of two that are as near the even one.
        let step = f32::EPSILON * 256.0;
        assert_eq!(rounded(1.0 + step / 2.0).to_bits(), 1.0_f32.to_bits());
        assert_eq!(
            rounded(1.0 + step * 1.5).to_bits(),
            (1.0 + step * 2.0).to_bits()
        );
    }
}
