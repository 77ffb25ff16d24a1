//! Random numbers by counter: Philox 4x32 with ten rounds (Salmon et al. 2011, doi:10.1145/2063384.2063405). Whoever asks for a number
//! names it, so that any thread draws the same.

/// Multipliers of both halves, and what keys grow by, as the paper has them.
const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const KEY_STEPS: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: usize = 10;

/// Four random numbers of 32 bits.
pub(super) fn philox(counter: [u32; 4], seed: u64) -> [u32; 4] {
    let mut key = [seed as u32, (seed >> 32) as u32];
    let mut now = counter;
    for _ in 0..ROUNDS {
        let [low, high] =
            [0, 1].map(|half| u64::from(MULTIPLIERS[half]) * u64::from(now[2 * half]));
        now = [
            (high >> 32) as u32 ^ now[1] ^ key[0],
            high as u32,
            (low >> 32) as u32 ^ now[3] ^ key[1],
            low as u32,
        ];
        for (own, step) in key.iter_mut().zip(KEY_STEPS) {
            *own = own.wrapping_add(step);
        }
    }
    now
}

/// Four normal numbers of mean 0 and variance 1 (Box and Muller 1958, doi:10.1214/aoms/1177706645).
pub(super) fn normals(counter: [u32; 4], seed: u64) -> [f64; 4] {
    // In the middle of each of 2^32 steps: never 0.
    let even = philox(counter, seed).map(|bits| (f64::from(bits) + 0.5) / 4_294_967_296.0);
    let pair = |a: f64, b: f64| {
        let (sine, cosine) = (std::f64::consts::TAU * b).sin_cos();
        let radius = (-2.0 * a.ln()).sqrt();
        [radius * cosine, radius * sine]
    };
    let ([a, b], [c, d]) = (pair(even[0], even[1]), pair(even[2], even[3]));
    [a, b, c, d]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `kat_vectors` of the authors' Random123.
    #[test]
    fn the_authors_numbers_come_out() {
        assert_eq!(
            philox([0; 4], 0),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        assert_eq!(
            philox([u32::MAX; 4], u64::MAX),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox(
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                0x299f_31d0_a409_3822
            ),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn normals_have_their_mean_and_variance() {
        let count = 20_000;
        let all: Vec<f64> = (0..count).flat_map(|i| normals([i, 1, 2, 3], 7)).collect();
        let n = all.len() as f64;
        let mean = all.iter().sum::<f64>() / n;
        let variance = all.iter().map(|x| x * x).sum::<f64>() / n;
        // Four standard errors.
        assert!(mean.abs() < 4.0 / n.sqrt(), "{mean}");
        assert!(
            (variance - 1.0).abs() < 4.0 * (2.0 / n).sqrt(),
            "{variance}"
        );
    }
}
