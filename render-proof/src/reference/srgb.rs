//! sRGB (IEC 61966-2-1) and linear light, in double precision.

use glam::DVec3;

/// Linear light of sRGB, both 0 to 1.
pub(super) fn linear_of(srgb: DVec3) -> DVec3 {
    srgb.map(|channel| {
        if channel <= 0.04045 {
            channel / 12.92
        } else {
            ((channel + 0.055) / 1.055).powf(2.4)
        }
    })
}

/// A premultiplied colour in linear light as one in sRGB: what a file with straight alpha says, times its alpha.
pub(super) fn encoded([r, g, b, alpha]: [f64; 4]) -> [f64; 4] {
    if alpha <= 0.0 {
        return [0.0; 4];
    }
    let straight = DVec3::new(r, g, b) / alpha;
    let srgb = straight.clamp(DVec3::ZERO, DVec3::ONE).map(|light| {
        if light <= 0.003_130_8 {
            light * 12.92
        } else {
            1.055 * light.powf(1.0 / 2.4) - 0.055
        }
    });
    let [r, g, b] = (srgb * alpha).to_array();
    [r, g, b, alpha]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_opaque_colour_comes_back() {
        for byte in 0..=255 {
            let srgb = DVec3::splat(f64::from(byte) / 255.0);
            let [r, _, _, alpha] = encoded(linear_of(srgb).extend(1.0).to_array());
            assert!((r - srgb.x).abs() < 1e-6 && alpha >= 1.0);
        }
        // Half covered by white: half of the light, and white.
        let half = encoded([0.5; 4]);
        assert!(half.iter().all(|channel| (channel - 0.5).abs() < 1e-12));
    }
}
