//! How colours are seen: CIE L*a*b*, CIEDE2000, and what readers see who lack one kind of cones. For tests.

type Triple = [f64; 3];
type Matrix = [Triple; 3];

/// A kind of reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reader {
    Usual,
    Protanope,
    Deuteranope,
    Tritanope,
    /// Whoever sees a copy in grey.
    Grey,
}

impl Reader {
    pub(super) const ALL: [Self; 5] = [
        Self::Usual,
        Self::Protanope,
        Self::Deuteranope,
        Self::Tritanope,
        Self::Grey,
    ];

    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Usual => "usual",
            Self::Protanope => "protanopia",
            Self::Deuteranope => "deuteranopia",
            Self::Tritanope => "tritanopia",
            Self::Grey => "grey print",
        }
    }

    /// What is seen of a linear colour: Machado, Oliveira and Fernandes (2009), doi:10.1109/TVCG.2009.113, severity 1.0 of
    /// their table; grey has the same luminance.
    pub(super) fn sees(self, linear: Triple) -> Triple {
        let matrix: Matrix = match self {
            Self::Usual => return linear,
            Self::Grey => return [times(&XYZ, linear)[1]; 3],
            Self::Protanope => [
                [0.152_286, 1.052_583, -0.204_868],
                [0.114_503, 0.786_281, 0.099_216],
                [-0.003_882, -0.048_116, 1.051_998],
            ],
            Self::Deuteranope => [
                [0.367_322, 0.860_646, -0.227_968],
                [0.280_085, 0.672_501, 0.047_413],
                [-0.011_820, 0.042_940, 0.968_881],
            ],
            Self::Tritanope => [
                [1.255_528, -0.076_749, -0.178_779],
                [-0.078_411, 0.930_809, 0.147_602],
                [0.004_733, 0.691_367, 0.303_900],
            ],
        };
        times(&matrix, linear).map(|c| c.clamp(0.0, 1.0))
    }
}

/// Linear sRGB to CIE XYZ under D65, IEC 61966-2-1.
const XYZ: Matrix = [
    [0.412_456_4, 0.357_576_1, 0.180_437_5],
    [0.212_672_9, 0.715_152_2, 0.072_175_0],
    [0.019_333_9, 0.119_192_0, 0.950_304_1],
];

fn times(matrix: &Matrix, v: Triple) -> Triple {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Linear light of sRGB from 0 to 1, IEC 61966-2-1.
pub(super) fn linear(srgb: Triple) -> Triple {
    srgb.map(|c| {
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    })
}

/// The way back, in bytes.
pub(super) fn bytes(linear: Triple) -> [u8; 3] {
    linear.map(|c| {
        let srgb = if c <= 0.003_130_8 {
            c * 12.92
        } else {
            1.055 * c.powf(1.0 / 2.4) - 0.055
        };
        (srgb.clamp(0.0, 1.0) * 255.0).round() as u8
    })
}

/// CIE 1976 L*a*b* under D65 (CIE 15).
pub(super) fn lab(linear: Triple) -> Triple {
    let f = |t: f64| {
        if t > 216.0 / 24389.0 {
            t.cbrt()
        } else {
            841.0 / 108.0 * t + 4.0 / 29.0
        }
    };
    let [x, y, z] = times(&XYZ, linear);
    let [x, y, z] = [f(x / 0.95047), f(y), f(z / 1.08883)];
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIEDE2000 (CIE 142-2001), after Sharma, Wu and Dalal (2005), doi:10.1002/col.20070. 1 is about what is just seen.
pub(super) fn difference([l1, a1, b1]: Triple, [l2, a2, b2]: Triple) -> f64 {
    let seventh = |c: f64| (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt();
    let chroma = f64::midpoint(a1.hypot(b1), a2.hypot(b2));
    let wider = 1.0 + 0.5 * (1.0 - seventh(chroma));
    let polar = |a: f64, b: f64| {
        let c = (a * wider).hypot(b);
        let hue_deg = if c < 1e-12 {
            0.0
        } else {
            b.atan2(a * wider).to_degrees().rem_euclid(360.0)
        };
        (c, hue_deg)
    };
    let ((c1, h1), (c2, h2)) = (polar(a1, b1), polar(a2, b2));
    let is_grey = c1 * c2 < 1e-24;
    let turn_deg = match h2 - h1 {
        _ if is_grey => 0.0,
        turn if turn > 180.0 => turn - 360.0,
        turn if turn < -180.0 => turn + 360.0,
        turn => turn,
    };
    let hue_deg = match h1 + h2 {
        sum if is_grey => sum,
        sum if (h1 - h2).abs() <= 180.0 => 0.5 * sum,
        sum if sum < 360.0 => 0.5 * (sum + 360.0),
        sum => 0.5 * (sum - 360.0),
    };
    let (lightness, chroma) = (f64::midpoint(l1, l2), f64::midpoint(c1, c2));
    let cos = |deg: f64| deg.to_radians().cos();
    let t = 1.0 - 0.17 * cos(hue_deg - 30.0)
        + 0.24 * cos(2.0 * hue_deg)
        + 0.32 * cos(3.0 * hue_deg + 6.0)
        - 0.20 * cos(4.0 * hue_deg - 63.0);
    let off = (lightness - 50.0).powi(2);
    let by_lightness = (l2 - l1) / (1.0 + 0.015 * off / (20.0 + off).sqrt());
    let by_chroma = (c2 - c1) / (1.0 + 0.045 * chroma);
    let by_hue =
        2.0 * (c1 * c2).sqrt() * (0.5 * turn_deg).to_radians().sin() / (1.0 + 0.015 * chroma * t);
    let rotated = 30.0 * (-((hue_deg - 275.0) / 25.0).powi(2)).exp();
    let rotation = -2.0 * seventh(chroma) * (2.0 * rotated).to_radians().sin();
    let squares = by_lightness.powi(2) + by_chroma.powi(2) + by_hue.powi(2);
    (squares + rotation * by_chroma * by_hue).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of the paper's table 1 with their published difference: of its 34 those that tell wrong programs apart.
    const PUBLISHED: [(Triple, Triple, f64); 18] = [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, 3.1571, -77.2803], [50.0, 0.0, -82.7485], 2.8615),
        ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0),
        ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0009], 7.1792),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0011], 7.2195),
        ([50.0, -0.001, 2.49], [50.0, 0.0009, -2.49], 4.8045),
        ([50.0, -0.001, 2.49], [50.0, 0.0011, -2.49], 4.7461),
        ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([50.0, 2.5, 0.0], [61.0, -5.0, 29.0], 22.8977),
        ([50.0, 2.5, 0.0], [56.0, -27.0, -3.0], 31.9030),
        ([50.0, 2.5, 0.0], [58.0, 24.0, 15.0], 19.4535),
        (
            [60.2574, -34.0099, 36.2677],
            [60.4626, -34.1751, 39.4387],
            1.2644,
        ),
        (
            [22.7233, 20.0904, -46.6940],
            [23.0331, 14.9730, -42.5619],
            2.0373,
        ),
        (
            [90.8027, -2.0831, 1.4410],
            [91.1528, -1.6435, 0.0447],
            1.4441,
        ),
        (
            [6.7747, -0.2908, -2.4247],
            [5.8714, -0.0985, -2.2286],
            0.6377,
        ),
        (
            [2.0776, 0.0795, -1.1350],
            [0.9033, -0.0636, -0.5514],
            0.9082,
        ),
    ];

    #[test]
    fn differences_are_those_that_were_published() {
        for (a, b, published) in PUBLISHED {
            for found in [difference(a, b), difference(b, a)] {
                assert!((found - published).abs() < 1e-4, "{a:?} {b:?}: {found}");
            }
        }
    }

    #[test]
    fn greys_stay_grey_and_the_colours_of_a_kind_of_cones_run_together() {
        let apart = |a: Triple, b: Triple, reader: Reader| {
            let [a, b] = [a, b].map(|srgb| lab(reader.sees(linear(srgb))));
            difference(a, b)
        };
        for reader in Reader::ALL {
            let grey = reader.sees([0.3; 3]);
            assert!(
                grey.iter().all(|c| (c - 0.3).abs() < 1e-3),
                "{reader:?} {grey:?}"
            );
        }
        // A red and a green that protanopes confuse, a blue and a green that tritanopes do.
        let (red, green) = ([0.72, 0.25, 0.2], [0.36, 0.36, 0.18]);
        assert!(apart(red, green, Reader::Usual) > 3.0 * apart(red, green, Reader::Protanope));
        let (blue, teal) = ([0.0, 0.45, 0.6], [0.0, 0.48, 0.35]);
        assert!(apart(blue, teal, Reader::Usual) > 2.0 * apart(blue, teal, Reader::Tritanope));
        let white = lab([1.0; 3]);
        assert!((white[0] - 100.0).abs() < 1e-3 && white[1].abs() < 0.02 && white[2].abs() < 0.02);
    }
}
