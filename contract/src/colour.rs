//! Transfer functions: from a value to colour, opacity and size (eq. 2 in docs/method.md), shared by legends and pictures.

mod options;
mod palette;
mod stops;

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::quantity::Quantity;

pub use options::{ShownRange, TransferOptions};
pub use palette::Palette;
pub use stops::{AtStop, MAX_STOPS, MAX_VALUE, Rgb, Share, Stop, Stops};

/// Least distance from the first to the last value: its inverse is far from the limits of the numbers that pictures are
/// computed with.
const MIN_SPAN: f64 = 1e-30;

/// What a value looks like, over a range of stored values: linear in a palette unless there are stops.
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
    /// The palette's last colour first.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reversed: bool,
    /// Colours in place of the palette's, by stored value.
    #[serde(default, skip_serializing_if = "Stops::is_empty")]
    pub colors: Stops<Rgb>,
    /// Share of the style's optical depth, and of a map's opacity, in place of the usual one, by stored value.
    #[serde(default, skip_serializing_if = "Stops::is_empty")]
    pub opacity: Stops<Share>,
    /// Radius of a particle over that of a full-size one in place of the usual one, by stored value.
    #[serde(default, skip_serializing_if = "Stops::is_empty")]
    pub size: Stops<Share>,
}

impl TransferFunction {
    /// A palette over a range of stored values.
    pub fn linear(palette: Palette, low: f64, high: f64) -> Self {
        Self {
            palette,
            low,
            high,
            reversed: false,
            colors: Stops::default(),
            opacity: Stops::default(),
            size: Stops::default(),
        }
    }

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
            Quantity::IceFraction | Quantity::SeaAreaFraction | Quantity::LandAreaFraction => {
                (Palette::Speed, 0.0, 100.0)
            }
            Quantity::WaveHeight => (Palette::Speed, 0.0, 6.0),
            Quantity::Current => (Palette::Balance, -1.5, 1.5),
            Quantity::Elevation => (Palette::Balance, -6000.0, 6000.0),
        };
        Self::linear(palette, display.stored(low), display.stored(high))
    }

    /// Place of a stored value between `low` (0) and `high` (1), clamped; NaN stays NaN.
    pub fn position(&self, value: f64) -> f64 {
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    /// The nearest value of the range, which is not taken to rise.
    fn within(&self, value: f64) -> f64 {
        value.max(self.low).min(self.high)
    }

    /// Colour of a stored value, sRGB 0 to 1, linear between stops; black for NaN.
    pub fn color(&self, value: f64) -> [f64; 3] {
        let position = self.position(value);
        if position.is_nan() {
            return [0.0; 3];
        }
        let Some((below, above, share)) = self.colors.around(self.within(value)) else {
            let place = if self.reversed {
                1.0 - position
            } else {
                position
            };
            return self.palette.color_at(place);
        };
        std::array::from_fn(|c| {
            (f64::from(below.0[c]) * (1.0 - share) + f64::from(above.0[c]) * share) / 255.0
        })
    }

    /// Share of the optical depth at a stored value; none without stops of opacity.
    pub fn opacity(&self, value: f64) -> Option<f64> {
        self.share(&self.opacity, value)
    }

    /// Size of a particle over the full one at a stored value; none without stops of size.
    pub fn size(&self, value: f64) -> Option<f64> {
        self.share(&self.size, value)
    }

    fn share(&self, stops: &Stops<Share>, value: f64) -> Option<f64> {
        let (below, above, share) = stops.around(self.within(value))?;
        Some(below.get() * (1.0 - share) + above.get() * share)
    }

    /// Checks every limit of one that came from outside.
    ///
    /// # Errors
    /// The first limit that is broken, with what would be valid.
    pub fn validate(&self) -> Result<(), ContractError> {
        let bad = |reason: &str| {
            let text = format!("{} to {}", self.low, self.high);
            Err(ContractError::invalid("range of colours", &text, reason))
        };
        let is_usable = |value: f64| (-MAX_VALUE..=MAX_VALUE).contains(&value);
        if !is_usable(self.low) || !is_usable(self.high) || self.low >= self.high {
            return bad("numbers must be finite and the range must rise");
        }
        if self.high - self.low < MIN_SPAN {
            return bad("the two values are too close to each other");
        }
        if self.reversed && !self.colors.is_empty() {
            return bad("a palette is turned round, colour stops are written the other way round");
        }
        self.colors.validate()?;
        self.opacity.validate()?;
        self.size.validate()
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
            tf.validate().unwrap();
        }
    }

    #[test]
    fn a_reversed_palette_has_its_last_colour_first() {
        let plain = TransferFunction::linear(Palette::Ice, 0.0, 1.0);
        let reversed = TransferFunction {
            reversed: true,
            ..plain
        };
        assert_eq!(plain.color(0.0), reversed.color(1.0));
        assert_eq!(plain.color(0.25), reversed.color(0.75));
        assert_ne!(plain.color(0.25), reversed.color(0.25));
    }

    #[test]
    fn stops_take_the_place_of_the_palette() {
        let tf = TransferFunction {
            colors: "0:#000000,4:#ffffff".parse().unwrap(),
            opacity: "1:0,3:1".parse().unwrap(),
            ..TransferFunction::linear(Palette::Ice, 1.0, 4.0)
        };
        assert_eq!(tf.color(2.0), [0.5; 3]);
        assert_eq!(tf.color(-9.0), [0.25; 3], "as at the range's end");
        assert_eq!(tf.color(f64::NAN), [0.0; 3]);
        assert_eq!(
            [1.0, 2.0, 9.0].map(|v| tf.opacity(v)),
            [Some(0.0), Some(0.5), Some(1.0)]
        );
        assert_eq!(tf.size(2.0), None);
    }

    #[test]
    fn what_is_not_used_takes_no_room_in_a_job() {
        let tf = TransferFunction::linear(Palette::Ice, 0.5, 1.0);
        let json = serde_json::to_string(&tf).unwrap();
        assert_eq!(json, r#"{"palette":"ice","low":"0.5","high":"1"}"#);
        let full = TransferFunction {
            reversed: true,
            size: "0:0.5".parse().unwrap(),
            ..tf
        };
        let json = serde_json::to_string(&full).unwrap();
        let end = r#""high":"1","reversed":true,"size":[["0","0.5"]]}"#;
        assert!(json.ends_with(end), "{json}");
        assert_eq!(
            serde_json::from_str::<TransferFunction>(&json).unwrap(),
            full
        );
    }

    #[test]
    fn ranges_that_pictures_cannot_be_computed_with_are_refused() {
        let with = |low, high| TransferFunction::linear(Palette::Ice, low, high);
        for (low, high) in [
            (1.0, 1.0),
            (2.0, 1.0),
            (f64::NAN, 1.0),
            (0.0, f64::INFINITY),
            (-1e300, 1e300),
            (0.0, 1e-40),
        ] {
            assert!(with(low, high).validate().is_err(), "{low} to {high}");
        }
        let both = TransferFunction {
            reversed: true,
            colors: "0:#000000,4:#ffffff".parse().unwrap(),
            ..with(0.0, 1.0)
        };
        assert!(
            both.validate()
                .unwrap_err()
                .to_string()
                .contains("other way round")
        );
    }
}
