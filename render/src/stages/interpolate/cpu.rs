//! CPU twin of `interpolate.wgsl`.

use crate::stages::layout::{MISSING, is_missing};
use crate::stages::params::Params;

/// Value between two adjacent fields, `weight` of the way from `v1` to `v2` (eq. 3 in docs/method.md); missing if either is, unless the
/// instant is that of the first field.
pub fn interpolated(v1: f32, v2: f32, weight: f32) -> f32 {
    if weight <= 0.0 {
        return v1;
    }
    if is_missing(v1) || is_missing(v2) {
        return MISSING;
    }
    v1 + (v2 - v1) * weight
}

/// Fills the cells of `between` that the picture needs.
pub fn interpolate(
    params: &Params,
    weight: f32,
    before: &[f32],
    after: &[f32],
    between: &mut [f32],
) {
    for cell in params.interpolation.first_cell as usize..params.interpolation.end_cell as usize {
        between[cell] = interpolated(before[cell], after[cell], weight);
    }
}
