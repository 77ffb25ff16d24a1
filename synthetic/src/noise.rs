//! Smooth deterministic noise in three dimensions: a place in, a number around 0 out; no state, no tables.

/// Noise of one seed.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    seed: u64,
}

impl Noise {
    /// Noise that another seed does not give.
    pub fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// A number in 0 to 1 for a lattice point. The mixing steps are those of `SplitMix64` (Steele et al. 2014).
    fn lattice(self, x: i64, y: i64, z: i64) -> f64 {
        let mut h = self.seed ^ (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        h ^= (y as u64)
            .wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
            .rotate_left(21);
        h ^= (z as u64)
            .wrapping_mul(0x1656_67b1_9e37_79f9)
            .rotate_left(42);
        h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((h ^ (h >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Noise of one wavelength, -1 to 1: lattice numbers joined smoothly.
    fn single(self, x: f64, y: f64, z: f64) -> f64 {
        let smooth = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        let (i, j, k) = (x.floor(), y.floor(), z.floor());
        let (u, v, w) = (smooth(x - i), smooth(y - j), smooth(z - k));
        let (i, j, k) = (i as i64, j as i64, k as i64);
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let row = |j, k| mix(self.lattice(i, j, k), self.lattice(i + 1, j, k), u);
        let plane = |k| mix(row(j, k), row(j + 1, k), v);
        let value = if w == 0.0 {
            plane(k)
        } else {
            mix(plane(k), plane(k + 1), w)
        };
        2.0 * value - 1.0
    }

    /// Noise of several wavelengths, each half as long and half as strong as the one before; about -1 to 1.
    pub fn fractal(self, x: f64, y: f64, z: f64, octaves: u32) -> f64 {
        let mut sum = 0.0;
        let (mut strength, mut total, mut scale) = (1.0, 0.0, 1.0);
        for octave in 0..octaves {
            // Each octave from another place, so that lattice points do not line up.
            let shift = 17.3 * f64::from(octave);
            sum += strength
                * self.single(
                    x * scale + shift,
                    y * scale - shift,
                    z + 31.0 * f64::from(octave),
                );
            total += strength;
            strength *= 0.5;
            scale *= 2.0;
        }
        sum / total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_bounded_and_centred() {
        let noise = Noise::new(7);
        let samples: Vec<f64> = (0..4000)
            .map(|i| noise.fractal(f64::from(i) * 0.37, f64::from(i) * 0.11, 0.5, 4))
            .collect();
        assert!(samples.iter().all(|v| v.abs() <= 1.0));
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        assert!(mean.abs() < 0.05, "{mean}");
        for i in 0..1000 {
            let x = f64::from(i) * 0.01;
            assert!(
                (noise.fractal(x, 2.0, 0.0, 4) - noise.fractal(x + 1e-4, 2.0, 0.0, 4)).abs() < 2e-3
            );
        }
    }
}
