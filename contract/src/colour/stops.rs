//! Lists of stops that users give a transfer function: a value and what holds there, linear in between.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::Scale;
use crate::ContractError;

/// Most stops of one list.
pub const MAX_STOPS: usize = 16;
/// Largest magnitude of a value: far from the limits of the numbers that pictures are computed with.
pub const MAX_VALUE: f64 = 1e20;

/// An sRGB colour, `#rrggbb`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Rgb(pub [u8; 3]);

/// A share from 0 to 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Share(#[serde(with = "crate::exact")] f64);

/// What can hold at a stop.
pub trait AtStop: Copy + Default + FromStr<Err = ContractError> {
    /// What a list of them is called in errors.
    const LIST: &'static str;
    /// How such a list is written.
    const FORM: &'static str;
    /// Fewest stops of a list that is given at all.
    const LEAST: usize;
    /// Does it hold what its type promises, wherever it came from?
    fn is_valid(self) -> bool;
}

/// A value and what holds there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Stop<T>(#[serde(with = "crate::exact")] pub f64, pub T);

/// Up to [`MAX_STOPS`] stops whose values do not fall, two at one value for a jump; none where none were given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stops<T> {
    count: usize,
    /// Those beyond `count` are the default, so that equal lists are equal.
    stops: [Stop<T>; MAX_STOPS],
}

impl<T: Copy + Default> Default for Stops<T> {
    fn default() -> Self {
        Self {
            count: 0,
            stops: [Stop::default(); MAX_STOPS],
        }
    }
}

impl<T: AtStop> Stops<T> {
    /// A list of stops.
    ///
    /// # Errors
    /// Too few or too many of them, or values that fall or are no use in a picture.
    pub fn new(stops: &[Stop<T>]) -> Result<Self, ContractError> {
        let mut list = Self::default();
        let Some(room) = list.stops.get_mut(..stops.len()) else {
            return Err(too_many::<T>(stops.len()));
        };
        room.copy_from_slice(stops);
        list.count = stops.len();
        list.validate()?;
        Ok(list)
    }

    /// Were none given?
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The stops.
    pub fn as_slice(&self) -> &[Stop<T>] {
        &self.stops[..self.count]
    }

    /// The first and the last value, if there are stops.
    pub fn span(&self) -> Option<(f64, f64)> {
        let stops = self.as_slice();
        Some((stops.first()?.0, stops.last()?.0))
    }

    /// The same stops with other values, in which they still do not fall.
    ///
    /// # Errors
    /// Values that are no use in a picture.
    pub fn map_values(&self, value: impl Fn(f64) -> f64) -> Result<Self, ContractError> {
        let mut mapped = *self;
        for stop in &mut mapped.stops[..self.count] {
            stop.0 = value(stop.0);
        }
        mapped.validate()?;
        Ok(mapped)
    }

    /// What holds on either side of a value and how far it lies from the first to the second on a scale; the outermost
    /// beyond the ends, the later one at a jump. None without stops.
    pub fn around(&self, value: f64, scale: Scale) -> Option<(T, T, f64)> {
        let stops = self.as_slice();
        let (first, last) = (stops.first()?, stops.last()?);
        Some(match stops.iter().position(|stop| stop.0 > value) {
            Some(0) => (first.1, first.1, 0.0),
            Some(above) => {
                let (low, high) = (&stops[above - 1], &stops[above]);
                let [at, from, to] = [value, low.0, high.0].map(|v| scale.spread(v));
                (low.1, high.1, (at - from) / (to - from))
            }
            None => (last.1, last.1, 0.0),
        })
    }

    /// Checks a list that came from outside.
    ///
    /// # Errors
    /// The first rule that is broken, with what would be valid.
    pub fn validate(&self) -> Result<(), ContractError> {
        let stops = self.as_slice();
        let bad = |stop: &Stop<T>, reason: String| {
            Err(ContractError::invalid(
                T::LIST,
                &format!("{}", stop.0),
                reason,
            ))
        };
        for stop in stops {
            if !(-MAX_VALUE..=MAX_VALUE).contains(&stop.0) || !stop.1.is_valid() {
                return bad(stop, format!("a stop is {}", T::FORM));
            }
        }
        for pair in stops.windows(2) {
            if pair[1].0 < pair[0].0 {
                return bad(
                    &pair[1],
                    format!(
                        "values rise from stop to stop; {} lies before it",
                        pair[0].0
                    ),
                );
            }
        }
        for three in stops.windows(3) {
            if three[2].0 <= three[0].0 {
                return bad(
                    &three[2],
                    "two stops at one value make a jump, a third means nothing".to_owned(),
                );
            }
        }
        if (1..T::LEAST).contains(&stops.len()) {
            let count = stops.len().to_string();
            let reason = format!("at least {} stops are wanted, {}", T::LEAST, T::FORM);
            return Err(ContractError::invalid(T::LIST, &count, reason));
        }
        Ok(())
    }
}

fn too_many<T: AtStop>(count: usize) -> ContractError {
    ContractError::invalid(
        T::LIST,
        &count.to_string(),
        format!("at most {MAX_STOPS} stops are taken"),
    )
}

impl AtStop for Rgb {
    const LIST: &'static str = "colour stops";
    const FORM: &'static str = "VALUE:#rrggbb, such as -40:#11387f,0:#f0f0ee,40:#760e24";
    const LEAST: usize = 2;

    fn is_valid(self) -> bool {
        true
    }
}

impl AtStop for Share {
    const LIST: &'static str = "stops of opacity or size";
    const FORM: &'static str = "VALUE:SHARE with shares from 0 to 1, such as 0:0.1,40:1";
    const LEAST: usize = 1;

    fn is_valid(self) -> bool {
        (0.0..=1.0).contains(&self.0)
    }
}

impl Share {
    /// The number.
    pub fn get(self) -> f64 {
        self.0
    }
}

impl Display for Rgb {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let [r, g, b] = self.0;
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

impl FromStr for Rgb {
    type Err = ContractError;

    /// With or without the number sign, which begins a fragment in addresses.
    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let digits = s.strip_prefix('#').unwrap_or(s);
        let is_hex = digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_hexdigit());
        let number = if is_hex {
            u32::from_str_radix(digits, 16).ok()
        } else {
            None
        };
        let bad = || ContractError::invalid("colour", s, "#rrggbb, such as #11387f");
        let [_, r, g, b] = number.ok_or_else(bad)?.to_be_bytes();
        Ok(Self([r, g, b]))
    }
}

impl TryFrom<String> for Rgb {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        s.parse()
    }
}

impl From<Rgb> for String {
    fn from(colour: Rgb) -> Self {
        colour.to_string()
    }
}

impl Display for Share {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for Share {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let share = s.parse().ok().map(Self).filter(|share| share.is_valid());
        share.ok_or_else(|| ContractError::invalid("share", s, "a number from 0 to 1"))
    }
}

impl<T: AtStop + Display> Display for Stops<T> {
    /// As it is read, without the number signs of colours, which addresses cannot hold.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let text = |stop: &Stop<T>| format!("{}:{}", stop.0, stop.1).replace('#', "");
        let texts: Vec<_> = self.as_slice().iter().map(text).collect();
        f.write_str(&texts.join(","))
    }
}

impl<T: AtStop> FromStr for Stops<T> {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad =
            |text: &str| ContractError::invalid(T::LIST, text, format!("written {}", T::FORM));
        let mut list = Self::default();
        for text in s.split(',') {
            let Some(room) = list.stops.get_mut(list.count) else {
                return Err(too_many::<T>(s.split(',').count()));
            };
            let (value, at) = text.trim().split_once(':').ok_or_else(|| bad(text))?;
            let value: f64 = value.trim().parse().map_err(|_no_number| bad(text))?;
            *room = Stop(value, at.trim().parse()?);
            list.count += 1;
        }
        list.validate()?;
        Ok(list)
    }
}

impl<T: AtStop + Serialize> Serialize for Stops<T> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(self.as_slice())
    }
}

impl<'de, T: AtStop + Deserialize<'de>> Deserialize<'de> for Stops<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct List<T>(std::marker::PhantomData<T>);

        impl<'de, T: AtStop + Deserialize<'de>> Visitor<'de> for List<T> {
            type Value = Stops<T>;

            fn expecting(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
                write!(f, "at most {MAX_STOPS} stops")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Stops<T>, A::Error> {
                let mut list = Stops::default();
                while let Some(stop) = seq.next_element()? {
                    let Some(room) = list.stops.get_mut(list.count) else {
                        return Err(A::Error::custom(format!(
                            "at most {MAX_STOPS} stops are taken"
                        )));
                    };
                    *room = stop;
                    list.count += 1;
                }
                Ok(list)
            }
        }

        from.deserialize_seq(List(std::marker::PhantomData))
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    fn shares(text: &str) -> Result<Stops<Share>, ContractError> {
        text.parse()
    }

    fn at(stops: &Stops<Share>, value: f64) -> f64 {
        let (low, high, share) = stops.around(value, Scale::Linear).unwrap();
        low.get() + (high.get() - low.get()) * share
    }

    #[test]
    fn stops_hold_beyond_their_ends_and_run_straight_between_them() {
        let stops = shares("-10:0.25, 10:0.75").unwrap();
        for (value, expected) in [
            (-99.0, 0.25),
            (-10.0, 0.25),
            (0.0, 0.5),
            (10.0, 0.75),
            (99.0, 0.75),
        ] {
            assert_eq!(at(&stops, value), expected, "{value}");
        }
        assert!(
            Stops::<Share>::default()
                .around(0.0, Scale::Linear)
                .is_none()
        );
    }

    #[test]
    fn two_stops_at_one_value_are_a_jump() {
        let stops = shares("0:0,5:0,5:1,9:1").unwrap();
        assert_eq!(
            [4.999, 5.0, 7.0].map(|value| at(&stops, value)),
            [0.0, 1.0, 1.0]
        );
    }

    #[test]
    fn lists_that_mean_nothing_are_refused_with_what_is_valid() {
        let refused = |text: &str| shares(text).unwrap_err().to_string();
        for text in [
            "", "5", "a:1", "1:b", "1:2", "1:-0.1", "nan:1", "inf:1", "1e21:1", "1:nan", "0:1,",
        ] {
            let reason = refused(text);
            assert!(
                reason.contains("VALUE:SHARE") || reason.contains("from 0 to 1"),
                "{text}: {reason}"
            );
        }
        assert!(refused("1:0,0:1").contains("rise"));
        assert!(refused("1:0,1:1,1:0").contains("third"));
        let many = vec!["0:1"; 17].join(",");
        assert!(refused(&many).contains("at most 16"));
        let colours = |text: &str| text.parse::<Stops<Rgb>>().unwrap_err().to_string();
        assert!(colours("0:#ffffff").contains("at least 2"));
        for text in [
            "0:red,1:#000000",
            "0:#fff,1:#000000",
            "0:#gggggg,1:#000000",
            "0:#ffffff1,1:#000000",
        ] {
            assert!(colours(text).contains("#rrggbb"), "{text}");
        }
    }

    #[test]
    fn colours_need_no_number_sign() {
        let with: Stops<Rgb> = "0:#0a0B0c,1:#ffffff".parse().unwrap();
        let without: Stops<Rgb> = "0:0a0b0c,1:FFFFFF".parse().unwrap();
        assert_eq!(with, without);
        assert_eq!(with.as_slice()[0].1, Rgb([10, 11, 12]));
        assert_eq!(with.to_string().parse::<Stops<Rgb>>().unwrap(), with);
        assert!(!with.to_string().contains('#'));
    }

    #[test]
    fn json_is_a_plain_list_of_bounded_length() {
        let stops: Stops<Rgb> = "-0.1:#0a0b0c,1e-9:#ffffff".parse().unwrap();
        let json = serde_json::to_string(&stops).unwrap();
        assert_eq!(json, r##"[["-0.1","#0a0b0c"],["0.000000001","#ffffff"]]"##);
        assert_eq!(serde_json::from_str::<Stops<Rgb>>(&json).unwrap(), stops);
        let shares = shares("0:0.1,1:1").unwrap();
        let json = serde_json::to_string(&shares).unwrap();
        assert_eq!(json, r#"[["0","0.1"],["1","1"]]"#);
        assert_eq!(serde_json::from_str::<Stops<Share>>(&json).unwrap(), shares);
        let long = format!("[{}]", vec![r#"["0","1"]"#; 17].join(","));
        assert!(serde_json::from_str::<Stops<Share>>(&long).is_err());
        // What is well formed but means nothing is told by `validate`.
        let outside: Stops<Share> = serde_json::from_str(r#"[["0","1.5"]]"#).unwrap();
        assert!(outside.validate().is_err());
    }
}
