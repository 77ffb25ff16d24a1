//! Transfer functions: from a value to colour, opacity and size (eq. 2 in docs/method.md), shared by legends and pictures.

mod options;
mod palette;
mod scale;
mod stops;

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::quantity::Quantity;

pub use options::{ShownRange, TransferOptions};
pub use palette::Palette;
pub use scale::Scale;
pub use stops::{AtStop, MAX_STOPS, MAX_VALUE, Rgb, Share, Stop, Stops};

/// Least distance from the first to the last value: its inverse is far from the limits of the numbers that pictures are
/// computed with.
const MIN_SPAN: f64 = 1e-30;
/// Least ratio of the last to the first value of a logarithmic range.
const MIN_RATIO: f64 = 1.0 + 1e-6;

/// What a value looks like, over a range of stored values: spread over a palette unless there are stops.
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
    /// How values are spread between the two.
    #[serde(default, skip_serializing_if = "Scale::is_usual")]
    pub scale: Scale,
    /// The palette's last colour first.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reversed: bool,
    /// Colours in place of the palette's, by stored value.
    // Stored objects keep this spelling, and so do the digests of jobs that name pictures.
    #[serde(rename = "colors", default, skip_serializing_if = "Stops::is_empty")]
    pub colours: Stops<Rgb>,
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
            scale: Scale::Linear,
            reversed: false,
            colours: Stops::default(),
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
            Quantity::SeaSurfaceTemperature
            | Quantity::SeaSurfaceSkinTemperature
            | Quantity::SeaSurfaceSubskinTemperature
            | Quantity::SeaSurfaceFoundationTemperature => (Palette::Thermal, -2.0, 32.0),
            Quantity::Chlorophyll => (Palette::Algae, 0.03, 10.0),
            Quantity::WindSpeed | Quantity::Precipitation => (Palette::Speed, 0.0, 15.0),
            Quantity::Pco2 | Quantity::Fco2 => (Palette::Thermal, 280.0, 440.0),
            Quantity::Salinity => (Palette::Thermal, 30.0, 38.0),
            Quantity::AirPressure => (Palette::Thermal, 980.0, 1035.0),
            Quantity::IceFraction | Quantity::SeaAreaFraction | Quantity::LandAreaFraction => {
                (Palette::Speed, 0.0, 100.0)
            }
            Quantity::WaveHeight => (Palette::Speed, 0.0, 6.0),
            Quantity::Current => (Palette::Balance, -1.5, 1.5),
            Quantity::Elevation => (Palette::Balance, -6000.0, 6000.0),
            Quantity::Open(open) => {
                let [low, high] = open.words().range.map_or([0.0, 1.0], with_width);
                if open.is_difference() {
                    let most = low.abs().max(high.abs());
                    (Palette::Delta, -most, most)
                } else {
                    (Palette::Thermal, low, high)
                }
            }
        };
        Self {
            scale: match quantity {
                // From the clearest gyres to blooms at a coast it is a few hundred times as much.
                Quantity::Chlorophyll => Scale::Log,
                _ => Scale::Linear,
            },
            ..Self::linear(palette, display.stored(low), display.stored(high))
        }
    }

    /// Place of a stored value between `low` (0) and `high` (1), clamped; NaN stays NaN.
    pub fn position(&self, value: f64) -> f64 {
        let [value, low, high] = [value, self.low, self.high].map(|v| self.scale.spread(v));
        ((value - low) / (high - low)).clamp(0.0, 1.0)
    }

    /// The stored value at a place between `low` (0) and `high` (1).
    pub fn value_at(&self, place: f64) -> f64 {
        self.scale.between(self.low, self.high, place)
    }

    /// The nearest value of the range, which is not taken to rise.
    fn within(&self, value: f64) -> f64 {
        value.max(self.low).min(self.high)
    }

    /// Colour of a stored value, sRGB 0 to 1, straight between stops; black for NaN.
    pub fn colour(&self, value: f64) -> [f64; 3] {
        let position = self.position(value);
        if position.is_nan() {
            return [0.0; 3];
        }
        let Some((below, above, share)) = self.colours.around(self.within(value), self.scale)
        else {
            let place = if self.reversed {
                1.0 - position
            } else {
                position
            };
            return self.palette.colour_at(place);
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
        let (below, above, share) = stops.around(self.within(value), self.scale)?;
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
        if self.reversed && !self.colours.is_empty() {
            return bad("a palette is turned round, colour stops are written the other way round");
        }
        self.colours.validate()?;
        self.opacity.validate()?;
        self.size.validate()?;
        self.validate_scale()
    }

    /// Refuses what a logarithm has no place for.
    fn validate_scale(&self) -> Result<(), ContractError> {
        let firsts = [self.colours.span(), self.opacity.span(), self.size.span()];
        let firsts = firsts.into_iter().flatten().map(|(first, _)| first);
        let lowest = firsts.fold(self.low, f64::min);
        if self.scale == Scale::Linear || (lowest > 0.0 && self.high / self.low >= MIN_RATIO) {
            return Ok(());
        }
        let text = format!("{lowest} to {}", self.high);
        Err(ContractError::invalid(
            "range of colours",
            &text,
            "a logarithmic scale has no place for 0 or less, in the range or in stops, nor for a range without width; give \
             a range above 0, or a linear scale",
        ))
    }
}

/// A range that rises: of a single value as far to both sides as half of it, of hardly anything 0 to 1.
fn with_width([low, high]: [f64; 2]) -> [f64; 2] {
    /// Below, ranges come near the least that can be drawn.
    const LEAST: f64 = 1e-25;
    let size = low.abs().max(high.abs());
    if high - low > LEAST.max(1e-9 * size) {
        return [low, high];
    }
    if size < LEAST {
        return [0.0, 1.0];
    }
    [low - 0.5 * size, high + 0.5 * size]
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    #[test]
    fn open_quantities_are_drawn_over_the_range_of_their_values() {
        let plain = Quantity::open("river_flux", "m", "River flux").unwrap();
        let drawn = |range| TransferFunction::default_for(plain.over(range).unwrap());
        assert_eq!((drawn([2.0, 8.0]).low, drawn([2.0, 8.0]).high), (2.0, 8.0));
        for range in [
            [0.0, 0.0],
            [5.0, 5.0],
            [-1e20, 1e20],
            [-7e-25, 1e-30],
            [1e-30, 1e-30],
        ] {
            drawn(range).validate().unwrap();
        }
        TransferFunction::default_for(plain).validate().unwrap();
    }

    #[test]
    fn correlations_have_the_colours_of_differences_from_less_to_more_than_none() {
        let plain = Quantity::open("correlation", "1", "Correlation").unwrap();
        let drawn = TransferFunction::default_for(plain.over([-1.0, 1.0]).unwrap());
        assert_eq!((drawn.low, drawn.high), (-1.0, 1.0));
        assert!(drawn.palette.is_diverging());
    }

    #[test]
    fn the_middle_of_a_diverging_palette_is_no_flux() {
        let tf = TransferFunction::default_for(Quantity::CarbonFlux);
        assert_eq!(
            tf.colour(0.0),
            [240.0 / 255.0, 240.0 / 255.0, 238.0 / 255.0]
        );
        assert_eq!(tf.colour(-1.0), [17.0 / 255.0, 56.0 / 255.0, 127.0 / 255.0]);
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
        assert_eq!(plain.colour(0.0), reversed.colour(1.0));
        assert_eq!(plain.colour(0.25), reversed.colour(0.75));
        assert_ne!(plain.colour(0.25), reversed.colour(0.25));
    }

    #[test]
    fn stops_take_the_place_of_the_palette() {
        let tf = TransferFunction {
            colours: "0:#000000,4:#ffffff".parse().unwrap(),
            opacity: "1:0,3:1".parse().unwrap(),
            ..TransferFunction::linear(Palette::Ice, 1.0, 4.0)
        };
        assert_eq!(tf.colour(2.0), [0.5; 3]);
        assert_eq!(tf.colour(-9.0), [0.25; 3], "as at the range's end");
        assert_eq!(tf.colour(f64::NAN), [0.0; 3]);
        assert_eq!(
            [1.0, 2.0, 9.0].map(|v| tf.opacity(v)),
            [Some(0.0), Some(0.5), Some(1.0)]
        );
        assert_eq!(tf.size(2.0), None);
    }

    #[test]
    fn a_logarithmic_range_has_its_powers_of_ten_at_equal_distances() {
        let tf = TransferFunction {
            scale: Scale::Log,
            ..TransferFunction::linear(Palette::Gray, 0.01, 100.0)
        };
        tf.validate().unwrap();
        for (value, place) in [
            (0.01, 0.0),
            (0.1, 0.25),
            (1.0, 0.5),
            (10.0, 0.75),
            (100.0, 1.0),
        ] {
            assert!((tf.position(value) - place).abs() < 1e-12, "{value}");
            assert!((tf.colour(value)[0] - place).abs() < 1e-12, "{value}");
            assert!((tf.value_at(place) / value - 1.0).abs() < 1e-12, "{place}");
        }
        assert_eq!([-1.0, 0.0, 1e9].map(|v| tf.position(v)), [0.0, 0.0, 1.0]);
        assert!(tf.position(f64::NAN).is_nan());
        let stops = TransferFunction {
            colours: "0.01:#000000,1:#ffffff,100:#ffffff".parse().unwrap(),
            opacity: "0.1:0,10:1".parse().unwrap(),
            ..tf
        };
        assert!((stops.colour(0.1)[0] - 0.5).abs() < 1e-12);
        assert!((stops.opacity(1.0).unwrap() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn what_a_logarithm_has_no_place_for_is_refused() {
        let with = |low, high| TransferFunction {
            scale: Scale::Log,
            ..TransferFunction::linear(Palette::Ice, low, high)
        };
        for (low, high) in [(0.0, 1.0), (-1.0, 1.0), (-2.0, -1.0), (1.0, 1.0 + 1e-9)] {
            let refused = with(low, high).validate().unwrap_err().to_string();
            assert!(
                refused.contains("a linear scale"),
                "{low} to {high}: {refused}"
            );
        }
        let stops = TransferFunction {
            opacity: "0:1,2:0.5".parse().unwrap(),
            ..with(1.0, 2.0)
        };
        stops.validate().unwrap_err();
        with(1.0, 2.0).validate().unwrap();
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
            colours: "0:#000000,4:#ffffff".parse().unwrap(),
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
