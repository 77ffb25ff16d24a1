// Linear interpolation in time between two adjacent fields (eq. 3 in docs/method.md); without the second where it has no weight.
fn interpolated(v1: f32, v2: f32, weight: f32) -> f32 {
    if (weight <= 0.0) { return v1; }
    if (is_missing(v1) || is_missing(v2)) { return MISSING; }
    return v1 + (v2 - v1) * weight;
}
