//! CPU twin of what `prelude.wgsl` does with colours.
//!
//! Light adds up and is blended as it is: linear. A particle's colour codes it by its square root, 8 bits a channel:
//! steps about as even to the eye as those of sRGB, and a multiplication decodes them.

use glam::Vec3;

/// Red, green and blue of a particle's colour: square roots of linear light, times 255.
pub fn codes_of(colour: u32) -> Vec3 {
    Vec3::from_array([0, 8, 16].map(|shift| ((colour >> shift) & 255) as f32))
}

/// A colour with other codes; what its last byte says stays.
pub fn with_codes(colour: u32, codes: Vec3) -> u32 {
    let rounded = codes.clamp(Vec3::ZERO, Vec3::splat(255.0)) + 0.5;
    rounded.x as u32 | (rounded.y as u32) << 8 | (rounded.z as u32) << 16 | (colour & 0xff00_0000)
}

/// Linear light of sRGB, both 0 to 1 (IEC 61966-2-1).
pub fn linear_of(srgb: Vec3) -> Vec3 {
    srgb.map(|channel| {
        if channel <= 0.04045 {
            channel / 12.92
        } else {
            ((channel + 0.055) / 1.055).powf(2.4)
        }
    })
}

/// sRGB of linear light; what is below 0 is 0.
pub fn srgb_of(linear: Vec3) -> Vec3 {
    linear.max(Vec3::ZERO).map(|light| {
        if light <= 0.003_130_8 {
            light * 12.92
        } else {
            1.055 * light.powf(1.0 / 2.4) - 0.055
        }
    })
}

/// The code of linear light from 0 to 1.
pub fn code_of(linear: f32) -> u32 {
    (linear.clamp(0.0, 1.0).sqrt() * 255.0 + 0.5) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_of_srgb_comes_back_from_linear_light_and_within_one_from_its_code() {
        for byte in 0..=255u32 {
            let srgb = Vec3::splat(byte as f32 / 255.0);
            let back = srgb_of(linear_of(srgb)).x * 255.0;
            assert_eq!((back + 0.5) as u32, byte);
            let code = codes_of(code_of(linear_of(srgb).x)).x / 255.0;
            let coded = srgb_of(Vec3::splat(code * code)).x * 255.0;
            assert!((coded - byte as f32).abs() < 0.75, "{byte}: {coded}");
        }
    }

    #[test]
    fn half_of_the_light_is_not_half_of_the_byte() {
        assert!((linear_of(Vec3::splat(0.5)).x - 0.2140).abs() < 1e-4);
        assert!((srgb_of(Vec3::splat(0.5)).x - 0.7354).abs() < 1e-4);
        assert_eq!(srgb_of(Vec3::splat(-0.1)), Vec3::ZERO);
    }

    #[test]
    fn codes_keep_the_last_byte_and_stop_at_their_ends() {
        let colour = with_codes(0x7f01_0203, Vec3::new(300.0, -4.0, 12.4));
        assert_eq!(colour, 0x7f0c_00ff);
        assert_eq!(codes_of(colour), Vec3::new(255.0, 0.0, 12.0));
    }
}
