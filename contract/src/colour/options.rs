//! What users change of a quantity's usual transfer function, in the unit people read; a transfer function of stored
//! values out.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use super::{Palette, Rgb, Scale, Share, Stops, TransferFunction};
use crate::ContractError;
use crate::quantity::Quantity;

/// A range of values in the unit people read, `LOW:HIGH`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShownRange {
    /// Value of the first colour.
    pub low: f64,
    /// Value of the last colour.
    pub high: f64,
}

/// Changes of a transfer function; those absent leave the usual.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TransferOptions {
    /// Another palette.
    pub palette: Option<Palette>,
    /// Another range; that of colour stops without it.
    pub range: Option<ShownRange>,
    /// Another way to spread values over it.
    pub scale: Option<Scale>,
    /// Colours in place of a palette's.
    pub colours: Stops<Rgb>,
    /// Opacity in place of the usual.
    pub opacity: Stops<Share>,
    /// Sizes in place of the usual.
    pub size: Stops<Share>,
    /// The palette's last colour first.
    pub reversed: bool,
}

impl TransferOptions {
    /// Is everything left as it is?
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// The transfer function of a quantity with these changes.
    ///
    /// # Errors
    /// Options that exclude each other, or a limit that is broken.
    pub fn over(&self, quantity: Quantity) -> Result<TransferFunction, ContractError> {
        self.changed(quantity, &TransferFunction::default_for(quantity))
    }

    /// That of the speed of a vector whose parts are of a quantity, with these changes.
    ///
    /// # Errors
    /// As [`Self::over`].
    pub fn over_speed(&self, quantity: Quantity) -> Result<TransferFunction, ContractError> {
        self.changed(quantity, &TransferFunction::of_speed(quantity))
    }

    fn changed(
        &self,
        quantity: Quantity,
        usual: &TransferFunction,
    ) -> Result<TransferFunction, ContractError> {
        if let Some(palette) = self.palette
            && !self.colours.is_empty()
        {
            let reason = "colour stops take a palette's place: give one of the two";
            return Err(ContractError::invalid("palette", palette.as_str(), reason));
        }
        let display = quantity.display();
        let stored = |shown: f64| display.stored(shown);
        let range = self.range.map(|range| (range.low, range.high));
        let (low, high) = match range.or(self.colours.span()) {
            Some((low, high)) => (stored(low), stored(high)),
            None => (usual.low, usual.high),
        };
        let transfer = TransferFunction {
            palette: self.palette.unwrap_or(usual.palette),
            low,
            high,
            scale: self.scale(quantity, usual)?,
            reversed: self.reversed,
            colours: self.colours.map_values(stored)?,
            opacity: self.opacity.map_values(stored)?,
            size: self.size.map_values(stored)?,
        };
        transfer.validate()?;
        Ok(transfer)
    }

    fn scale(&self, quantity: Quantity, usual: &TransferFunction) -> Result<Scale, ContractError> {
        let scale = self.scale.unwrap_or(usual.scale);
        let display = quantity.display();
        if scale == Scale::Log && display.offset != 0.0 {
            let reason = format!(
                "{} has a zero that was agreed upon, and so no logarithm; leave it linear",
                display.unit
            );
            return Err(ContractError::invalid("scale", scale.as_str(), reason));
        }
        Ok(scale)
    }
}

impl Display for ShownRange {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.low, self.high)
    }
}

impl FromStr for ShownRange {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let number = |text: &str| text.trim().parse().ok().filter(|v: &f64| v.is_finite());
        let range = s.split_once(':').and_then(|(low, high)| {
            let (low, high) = (number(low)?, number(high)?);
            (low < high).then_some(Self { low, high })
        });
        let reason = "LOW:HIGH, two numbers that rise, such as -40:40";
        range.ok_or_else(|| ContractError::invalid("range", s, reason))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options() -> TransferOptions {
        TransferOptions::default()
    }

    #[test]
    fn without_options_the_transfer_function_is_the_usual_one() {
        for quantity in Quantity::ALL {
            let usual = TransferFunction::default_for(quantity);
            assert_eq!(options().over(quantity).unwrap(), usual);
        }
        assert!(options().is_default());
    }

    #[test]
    fn options_are_in_the_unit_people_read() {
        let warm = TransferOptions {
            range: Some("10:30".parse().unwrap()),
            opacity: "10:0.1,30:1".parse().unwrap(),
            ..options()
        };
        let transfer = warm.over(Quantity::SeaSurfaceTemperature).unwrap();
        assert!((transfer.low - 283.15).abs() < 1e-9 && (transfer.high - 303.15).abs() < 1e-9);
        assert!((transfer.opacity(293.15).unwrap() - 0.55).abs() < 1e-9);
        assert!(!warm.is_default());
    }

    #[test]
    fn colour_stops_bring_their_own_range_unless_one_is_given() {
        let stops = TransferOptions {
            colours: "5:#000000,25:#ffffff".parse().unwrap(),
            ..options()
        };
        let of = |options: &TransferOptions| options.over(Quantity::WindSpeed).unwrap();
        assert_eq!((of(&stops).low, of(&stops).high), (5.0, 25.0));
        let narrow = TransferOptions {
            range: Some("10:20".parse().unwrap()),
            ..stops
        };
        assert_eq!((of(&narrow).low, of(&narrow).high), (10.0, 20.0));
    }

    #[test]
    fn a_scale_is_the_quantitys_own_unless_one_is_named() {
        let of = |options: TransferOptions, quantity| options.over(quantity);
        let log = TransferOptions {
            scale: Some(Scale::Log),
            range: Some("0.5:20".parse().unwrap()),
            ..options()
        };
        assert_eq!(of(log, Quantity::WindSpeed).unwrap().scale, Scale::Log);
        let usual = of(options(), Quantity::Chlorophyll).unwrap();
        assert_eq!(usual.scale, Scale::Log);
        let zero = TransferOptions {
            range: Some("0:2".parse().unwrap()),
            ..options()
        };
        let refused = of(zero, Quantity::Chlorophyll).unwrap_err().to_string();
        assert!(refused.contains("a linear scale"), "{refused}");
        let linear = TransferOptions {
            scale: Some(Scale::Linear),
            ..zero
        };
        assert_eq!(
            of(linear, Quantity::Chlorophyll).unwrap().scale,
            Scale::Linear
        );
        let warm = TransferOptions {
            range: Some("1:30".parse().unwrap()),
            ..log
        };
        let refused = of(warm, Quantity::SeaSurfaceTemperature).unwrap_err();
        assert!(refused.to_string().contains("leave it linear"), "{refused}");
        assert!(!log.is_default());
    }

    #[test]
    fn options_that_exclude_each_other_are_refused() {
        let both = TransferOptions {
            palette: Some(Palette::Ice),
            colours: "5:#000000,25:#ffffff".parse().unwrap(),
            ..options()
        };
        let refused = both.over(Quantity::WindSpeed).unwrap_err().to_string();
        assert!(refused.contains("one of the two"), "{refused}");
        let reversed = TransferOptions {
            palette: None,
            reversed: true,
            ..both
        };
        assert!(reversed.over(Quantity::WindSpeed).is_err());
        // A jump alone has no range of its own.
        let jump = TransferOptions {
            colours: "5:#000000,5:#ffffff".parse().unwrap(),
            ..options()
        };
        assert!(jump.over(Quantity::WindSpeed).is_err());
    }

    #[test]
    fn ranges_must_rise() {
        for text in [
            "", "5", "5:", "5:5", "5:4", "a:b", "nan:1", "0:inf", "0:1:2",
        ] {
            let refused = text.parse::<ShownRange>().unwrap_err().to_string();
            assert!(refused.contains("LOW:HIGH"), "{text}: {refused}");
        }
        let range: ShownRange = "-40:40.5".parse().unwrap();
        assert_eq!(range.to_string().parse::<ShownRange>().unwrap(), range);
    }
}
