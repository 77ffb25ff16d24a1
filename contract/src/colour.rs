//! Transfer functions: a linear map from a value to a colour (eq. 2 of the method), shared by legends and pictures.

use serde::{Deserialize, Serialize};

use crate::quantity::Quantity;

/// A named list of equally spaced colours, sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Palette {
    /// Diverging blue - pale - red; safe for colour-blind readers. Sinks blue, sources red.
    Balance,
    /// Sequential dark blue to pale yellow for temperature.
    Thermal,
    /// Sequential pale to dark green for chlorophyll.
    Algae,
    /// Sequential pale to dark for speeds and amounts.
    Speed,
}

impl Palette {
    /// Colours at equal distances from 0 to 1, sRGB bytes, lightness varying evenly.
    pub fn stops(self) -> &'static [[u8; 3]] {
        match self {
            Self::Balance => &[
                [17, 56, 127],
                [30, 102, 190],
                [92, 159, 219],
                [170, 207, 236],
                [240, 240, 238],
                [244, 191, 163],
                [226, 122, 92],
                [188, 50, 52],
                [118, 14, 36],
            ],
            Self::Thermal => &[
                [8, 29, 66],
                [32, 50, 130],
                [92, 60, 148],
                [148, 74, 140],
                [204, 92, 116],
                [240, 130, 84],
                [250, 182, 72],
                [240, 240, 100],
            ],
            Self::Algae => &[
                [226, 246, 220],
                [172, 218, 160],
                [112, 190, 112],
                [46, 158, 82],
                [10, 120, 74],
                [18, 82, 56],
                [16, 44, 32],
            ],
            Self::Speed => &[
                [255, 252, 210],
                [220, 220, 140],
                [160, 190, 80],
                [84, 158, 60],
                [22, 122, 66],
                [18, 82, 60],
                [20, 40, 36],
            ],
        }
    }
}

/// A linear transfer function over a range of stored values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TransferFunction {
    /// Colours.
    pub palette: Palette,
    /// Stored value of the first colour.
    #[serde(with = "crate::exact")]
    pub low: f64,
    /// Stored value of the last colour, above `low`.
    #[serde(with = "crate::exact")]
    pub high: f64,
}

impl TransferFunction {
    /// What a quantity is drawn with unless told otherwise.
    pub fn default_for(quantity: Quantity) -> Self {
        let display = quantity.display();
        let (palette, low, high) = match quantity {
            Quantity::CarbonFlux => (Palette::Balance, -40.0, 40.0),
            Quantity::AccumulatedCarbon => (Palette::Balance, -50.0, 50.0),
            Quantity::SeaSurfaceTemperature => (Palette::Thermal, -2.0, 32.0),
            Quantity::Chlorophyll => (Palette::Algae, 0.0, 2.0),
            Quantity::WindSpeed | Quantity::Precipitation => (Palette::Speed, 0.0, 15.0),
            Quantity::Pco2 => (Palette::Thermal, 280.0, 440.0),
            Quantity::Salinity => (Palette::Thermal, 30.0, 38.0),
            Quantity::AirPressure => (Palette::Thermal, 980.0, 1035.0),
            Quantity::IceFraction => (Palette::Speed, 0.0, 100.0),
            Quantity::WaveHeight => (Palette::Speed, 0.0, 6.0),
            Quantity::Current => (Palette::Balance, -1.5, 1.5),
            Quantity::Elevation => (Palette::Balance, -6000.0, 6000.0),
        };
        let stored = |shown: f64| (shown - display.offset) / display.factor;
        Self {
            palette,
            low: stored(low),
            high: stored(high),
        }
    }

    /// Place of a stored value between `low` (0) and `high` (1), clamped; NaN stays NaN.
    pub fn position(&self, value: f64) -> f64 {
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    /// Colour of a stored value, sRGB 0 to 1, linear between stops; black for NaN.
    pub fn color(&self, value: f64) -> [f64; 3] {
        let stops = self.palette.stops();
        let x = self.position(value) * (stops.len() - 1) as f64;
        if x.is_nan() {
            return [0.0; 3];
        }
        let i = (x as usize).min(stops.len() - 2);
        let t = x - i as f64;
        std::array::from_fn(|c| {
            (f64::from(stops[i][c]) * (1.0 - t) + f64::from(stops[i + 1][c]) * t) / 255.0
        })
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_a_diverging_palette_is_no_flux() {
        let tf = TransferFunction::default_for(Quantity::CarbonFlux);
        assert_eq!(tf.color(0.0), [240.0 / 255.0, 240.0 / 255.0, 238.0 / 255.0]);
        assert_eq!(tf.color(-1.0), [17.0 / 255.0, 56.0 / 255.0, 127.0 / 255.0]);
    }

    #[test]
    fn every_quantity_has_a_rising_range() {
        for quantity in Quantity::ALL {
            let tf = TransferFunction::default_for(quantity);
            assert!(tf.low < tf.high, "{quantity:?}");
        }
    }
}
