//! Named lists of colours: even in lightness, and told apart by colour-blind readers.
//!
//! The manner is that of Thyng et al. (2016), True Colors of Oceanography, doi:10.5670/oceanog.2016.66: lightness rises
//! or falls all the way, or peaks at no difference; `Haline`, `Ice`, `Dense` and the blue arm of `Delta`
//! follow the figures published there. How each is seen is measured in docs/palettes.md.

use serde::{Deserialize, Serialize};

use crate::ContractError;

/// A named list of equally spaced colours, sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Palette {
    /// Diverging blue - pale - red; safe for colour-blind readers. Sinks blue, sources red.
    Balance,
    /// Diverging blue-green - pale - purple-red: rotation, northward against southward.
    Curl,
    /// Diverging blue - pale yellow - olive: differences and anomalies.
    Delta,
    /// Sequential dark blue to pale yellow for temperature.
    Thermal,
    /// Sequential dark blue over green to pale yellow for salinity.
    Haline,
    /// Sequential near black over blue to white for ice.
    Ice,
    /// Sequential pale to dark green for chlorophyll.
    Algae,
    /// Sequential pale to dark for speeds and amounts.
    Speed,
    /// Sequential pale over blue to dark purple for densities and pressures.
    Dense,
    /// Sequential black to white.
    Gray,
}

impl Palette {
    /// All of them, in the order they are offered.
    pub const ALL: [Self; 10] = [
        Self::Balance,
        Self::Curl,
        Self::Delta,
        Self::Thermal,
        Self::Haline,
        Self::Ice,
        Self::Algae,
        Self::Speed,
        Self::Dense,
        Self::Gray,
    ];

    /// Name in URLs and on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Balance => "balance",
            Self::Curl => "curl",
            Self::Delta => "delta",
            Self::Thermal => "thermal",
            Self::Haline => "haline",
            Self::Ice => "ice",
            Self::Algae => "algae",
            Self::Speed => "speed",
            Self::Dense => "dense",
            Self::Gray => "gray",
        }
    }

    /// Is its middle the lightest, for values on either side of none?
    pub fn is_diverging(self) -> bool {
        match self {
            Self::Balance | Self::Curl | Self::Delta => true,
            Self::Thermal
            | Self::Haline
            | Self::Ice
            | Self::Algae
            | Self::Speed
            | Self::Dense
            | Self::Gray => false,
        }
    }

    /// Colours at equal distances from 0 to 1, sRGB bytes, lightness varying evenly.
    pub fn stops(self) -> &'static [[u8; 3]] {
        match self {
            Self::Balance => &BALANCE,
            Self::Curl => &CURL,
            Self::Delta => &DELTA,
            Self::Thermal => &THERMAL,
            Self::Haline => &HALINE,
            Self::Ice => &ICE,
            Self::Algae => &ALGAE,
            Self::Speed => &SPEED,
            Self::Dense => &DENSE,
            Self::Gray => &GRAY,
        }
    }

    /// Colour at a place from 0 to 1, sRGB 0 to 1, linear between stops.
    pub(super) fn colour_at(self, place: f64) -> [f64; 3] {
        let stops = self.stops();
        let x = place * (stops.len() - 1) as f64;
        let i = (x as usize).min(stops.len() - 2);
        let t = x - i as f64;
        std::array::from_fn(|c| {
            (f64::from(stops[i][c]) * (1.0 - t) + f64::from(stops[i + 1][c]) * t) / 255.0
        })
    }
}

const BALANCE: [[u8; 3]; 9] = [
    [17, 56, 127],
    [30, 102, 190],
    [92, 159, 219],
    [170, 207, 236],
    [240, 240, 238],
    [244, 191, 163],
    [226, 122, 92],
    [188, 50, 52],
    [118, 14, 36],
];

const CURL: [[u8; 3]; 11] = [
    [10, 40, 96],
    [8, 82, 122],
    [16, 122, 138],
    [74, 164, 160],
    [164, 206, 194],
    [246, 242, 236],
    [238, 184, 150],
    [212, 118, 94],
    [172, 60, 78],
    [118, 26, 64],
    [62, 10, 34],
];

const DELTA: [[u8; 3]; 11] = [
    [16, 31, 63],
    [27, 62, 130],
    [27, 107, 160],
    [77, 150, 174],
    [160, 199, 205],
    [254, 253, 213],
    [203, 197, 80],
    [150, 156, 10],
    [104, 116, 2],
    [68, 76, 4],
    [40, 34, 6],
];

const THERMAL: [[u8; 3]; 8] = [
    [8, 29, 66],
    [32, 50, 130],
    [92, 60, 148],
    [148, 74, 140],
    [204, 92, 116],
    [240, 130, 84],
    [250, 182, 72],
    [240, 240, 100],
];

const HALINE: [[u8; 3]; 12] = [
    [41, 24, 107],
    [42, 35, 160],
    [15, 71, 153],
    [18, 95, 142],
    [38, 116, 137],
    [53, 136, 136],
    [65, 157, 133],
    [81, 178, 124],
    [111, 198, 107],
    [160, 214, 91],
    [212, 225, 112],
    [253, 238, 153],
];

const ICE: [[u8; 3]; 12] = [
    [3, 5, 18],
    [25, 25, 51],
    [44, 42, 87],
    [58, 60, 125],
    [62, 83, 160],
    [62, 109, 178],
    [72, 134, 187],
    [89, 159, 196],
    [114, 184, 205],
    [149, 207, 216],
    [192, 229, 232],
    [234, 252, 253],
];

const ALGAE: [[u8; 3]; 7] = [
    [226, 246, 220],
    [172, 218, 160],
    [112, 190, 112],
    [46, 158, 82],
    [10, 120, 74],
    [18, 82, 56],
    [16, 44, 32],
];

const SPEED: [[u8; 3]; 7] = [
    [255, 252, 210],
    [220, 220, 140],
    [160, 190, 80],
    [84, 158, 60],
    [22, 122, 66],
    [18, 82, 60],
    [20, 40, 36],
];

const DENSE: [[u8; 3]; 12] = [
    [230, 240, 240],
    [191, 221, 229],
    [156, 201, 226],
    [129, 180, 227],
    [115, 154, 228],
    [117, 127, 221],
    [120, 100, 202],
    [119, 74, 175],
    [113, 50, 141],
    [100, 31, 104],
    [80, 20, 66],
    [54, 14, 36],
];

const GRAY: [[u8; 3]; 2] = [[0, 0, 0], [255, 255, 255]];

impl std::fmt::Display for Palette {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl std::str::FromStr for Palette {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|palette| palette.as_str() == s);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::as_str).join(", ");
            ContractError::invalid("palette", s, format!("one of {names}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Triple = [f64; 3];

    /// Distance in CIE 1976 L*a*b* that is seen at a glance; a trained eye tells 2 apart.
    const TOLD_APART: f64 = 15.0;

    fn times(matrix: &[Triple; 3], v: Triple) -> Triple {
        matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }

    /// IEC 61966-2-1.
    fn linear(srgb: Triple) -> Triple {
        srgb.map(|c| {
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    /// CIE 1976 L*a*b* under D65.
    fn lab(linear: Triple) -> Triple {
        let xyz = times(
            &[
                [0.4124564, 0.3575761, 0.1804375],
                [0.2126729, 0.7151522, 0.0721750],
                [0.0193339, 0.1191920, 0.9503041],
            ],
            linear,
        );
        let f = |t: f64| {
            if t > 216.0 / 24389.0 {
                t.cbrt()
            } else {
                841.0 / 108.0 * t + 4.0 / 29.0
            }
        };
        let [x, y, z] = [f(xyz[0] / 0.95047), f(xyz[1]), f(xyz[2] / 1.08883)];
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    #[derive(Debug, Clone, Copy)]
    enum Eye {
        Usual,
        Protanope,
        Deuteranope,
    }

    /// What an eye sees: Viénot, Brettel and Mollon (1999), Color Research & Application 24(4), 243-252.
    fn seen(linear: Triple, eye: Eye) -> Triple {
        let [mut l, mut m, s] = times(
            &[
                [17.8824, 43.5161, 4.11935],
                [3.45565, 27.1554, 3.86714],
                [0.0299566, 0.184309, 1.46709],
            ],
            linear,
        );
        match eye {
            Eye::Usual => (),
            Eye::Protanope => l = 2.02344 * m - 2.52581 * s,
            Eye::Deuteranope => m = 0.494207 * l + 1.24827 * s,
        }
        let back = times(
            &[
                [0.0809444479, -0.130504409, 0.116721066],
                [-0.0102485335, 0.0540193266, -0.113614708],
                [-0.000365296938, -0.00412161469, 0.693511405],
            ],
            [l, m, s],
        );
        back.map(|c| c.clamp(0.0, 1.0))
    }

    fn lightness(palette: Palette, at: f64) -> f64 {
        lab(linear(palette.colour_at(at)))[0]
    }

    /// Do the lightnesses from one place to another rise, or fall, at every step?
    fn runs_one_way(palette: Palette, from: f64, to: f64) -> bool {
        let at = |i: i32| lightness(palette, from + (to - from) * f64::from(i) / 64.0);
        let steps: Vec<f64> = (0..64).map(|i| at(i + 1) - at(i)).collect();
        steps.iter().all(|step| *step > 0.1) || steps.iter().all(|step| *step < -0.1)
    }

    #[test]
    fn sequential_palettes_run_one_way_in_lightness_and_diverging_ones_peak_in_the_middle() {
        for palette in Palette::ALL {
            if palette.is_diverging() {
                assert!(runs_one_way(palette, 0.0, 0.5), "{palette}");
                assert!(runs_one_way(palette, 0.5, 1.0), "{palette}");
                let middle = lightness(palette, 0.5);
                assert!(middle > 90.0 && middle > lightness(palette, 0.0) + 60.0);
                assert!(middle > lightness(palette, 1.0) + 60.0, "{palette}");
            } else {
                assert!(runs_one_way(palette, 0.0, 1.0), "{palette}");
            }
        }
        assert!(
            !runs_one_way(Palette::Balance, 0.0, 1.0),
            "a fold would be seen"
        );
    }

    #[test]
    fn the_arms_of_diverging_palettes_are_told_apart_by_colour_blind_readers() {
        let apart = |a: Triple, b: Triple, eye| {
            let [a, b] = [a, b].map(|srgb| lab(seen(linear(srgb), eye)));
            (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
        };
        for palette in Palette::ALL.into_iter().filter(|p| p.is_diverging()) {
            for eye in [Eye::Usual, Eye::Protanope, Eye::Deuteranope] {
                for i in 2..=10 {
                    let off = f64::from(i) / 20.0;
                    let [low, high] = [0.5 - off, 0.5 + off].map(|at| palette.colour_at(at));
                    let apart = apart(low, high, eye);
                    assert!(
                        apart > TOLD_APART,
                        "{palette} {eye:?} {off} from the middle: {apart}"
                    );
                }
            }
        }
        // A red and a green of one lightness, which a protanope confuses, are found.
        let confused = [[0.72, 0.25, 0.2], [0.36, 0.36, 0.18]];
        assert!(apart(confused[0], confused[1], Eye::Usual) > TOLD_APART);
        assert!(apart(confused[0], confused[1], Eye::Protanope) < TOLD_APART);
    }

    #[test]
    fn palettes_are_read_by_their_names() {
        for palette in Palette::ALL {
            assert_eq!(palette.to_string().parse::<Palette>().unwrap(), palette);
            let json = serde_json::to_string(&palette).unwrap();
            assert_eq!(json, format!("\"{palette}\""));
        }
        let refused = "jet".parse::<Palette>().unwrap_err().to_string();
        assert!(refused.contains("balance, curl"), "{refused}");
    }
}
