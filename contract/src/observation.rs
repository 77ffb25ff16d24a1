//! Observations: single measurements of buoys, ships, stations and profiles, with what makes each one itself.

mod query;

use std::fmt::{Display, Formatter};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::grid::LonLatDeg;
use crate::product::ProductId;
use crate::time::TimeMs;
pub use query::{
    Filter, MAX_LIMIT, MAX_PLACES, Page, Platform, PlatformList, TrackPoint, TrackQuery,
};

/// Deepest and highest place of a measurement, m below the surface.
const DEPTH_M: std::ops::RangeInclusive<f64> = -1000.0..=12_000.0;

/// What carries the instruments.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum PlatformKind {
    /// Stays where it is moored: one place, a series in time.
    Buoy,
    /// Moves: a track.
    Ship,
    /// On land or a tower.
    Station,
    /// One place and time, many depths.
    Profile,
}

/// How far a value may be trusted: the primary flags of IOC Manuals and Guides 54, volume 3 (2013). Missing values are
/// no observations.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Passed the required tests (1).
    Good,
    /// Not tested, or the outcome is unknown (2).
    NotEvaluated,
    /// Failed a test that is not decisive (3).
    Questionable,
    /// Failed a decisive test (4).
    Bad,
}

/// One measured value. Platform, dataset, property, time and depth together name it: the same name again replaces it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// The data set that it belongs to.
    pub dataset: ProductId,
    /// Name of the buoy, ship, station or cast in its data set.
    pub platform: String,
    /// What the platform is.
    pub kind: PlatformKind,
    /// When.
    pub time: TimeMs,
    /// Longitude, degrees east, -180 to 180.
    pub lon_deg: f64,
    /// Latitude, degrees north.
    pub lat_deg: f64,
    /// Below the sea surface, m; negative above it.
    pub depth_m: f64,
    /// What was measured: a CF standard name where there is one (`sea_surface_temperature`).
    pub property: String,
    /// The value in `unit`.
    pub value: f64,
    /// Unit in udunits spelling; `1` for plain numbers.
    pub unit: String,
    /// May it be trusted?
    pub quality: Quality,
}

impl PlatformKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Buoy, Self::Ship, Self::Station, Self::Profile];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Buoy => "buoy",
            Self::Ship => "ship",
            Self::Station => "station",
            Self::Profile => "profile",
        }
    }
}

impl Display for PlatformKind {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl std::str::FromStr for PlatformKind {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|kind| kind.as_str() == s);
        found.ok_or_else(|| {
            ContractError::invalid("platform kind", s, "buoy, ship, station or profile")
        })
    }
}

impl Quality {
    /// All of them, best first.
    pub const ALL: [Self; 4] = [
        Self::Good,
        Self::NotEvaluated,
        Self::Questionable,
        Self::Bad,
    ];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::NotEvaluated => "not_evaluated",
            Self::Questionable => "questionable",
            Self::Bad => "bad",
        }
    }

    /// Its number in the primary scheme, 1 to 4.
    pub fn flag(self) -> u8 {
        match self {
            Self::Good => 1,
            Self::NotEvaluated => 2,
            Self::Questionable => 3,
            Self::Bad => 4,
        }
    }

    /// The quality of a number of the primary scheme.
    ///
    /// # Errors
    /// Not 1 to 4.
    pub fn from_flag(flag: u8) -> Result<Self, ContractError> {
        let found = Self::ALL.into_iter().find(|quality| quality.flag() == flag);
        found.ok_or_else(|| {
            ContractError::invalid("quality flag", &flag.to_string(), "1, 2, 3 or 4")
        })
    }
}

impl Display for Quality {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl std::str::FromStr for Quality {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|quality| quality.as_str() == s);
        found.ok_or_else(|| {
            let valid = "good, not_evaluated, questionable or bad";
            ContractError::invalid("quality", s, valid)
        })
    }
}

impl Observation {
    /// Checks every limit of an observation that came from outside.
    ///
    /// # Errors
    /// The first limit that is broken, with what would be valid.
    pub fn validate(&self) -> Result<(), ContractError> {
        let printable = |text: &str, most: usize| {
            (1..=most).contains(&text.len()) && !text.chars().any(char::is_control)
        };
        if !printable(&self.platform, 64) {
            return Err(ContractError::invalid(
                "platform",
                &self.platform,
                "1 to 64 printable bytes",
            ));
        }
        if !(1..=64).contains(&self.property.len())
            || !self
                .property
                .bytes()
                .all(|b| matches!(b, b'a'..=b'z' | b'0'..=b'9' | b'_'))
        {
            return Err(ContractError::invalid(
                "property",
                &self.property,
                "1 to 64 of a-z, 0-9 and _",
            ));
        }
        if !printable(&self.unit, 32) {
            return Err(ContractError::invalid(
                "unit",
                &self.unit,
                "1 to 32 printable bytes",
            ));
        }
        LonLatDeg::new(self.lon_deg, self.lat_deg)?;
        if !DEPTH_M.contains(&self.depth_m) {
            let text = self.depth_m.to_string();
            return Err(ContractError::invalid(
                "depth",
                &text,
                "-1000 to 12000 m below the surface",
            ));
        }
        if !self.value.is_finite() {
            let text = self.value.to_string();
            return Err(ContractError::invalid(
                "value",
                &text,
                "a finite number; leave missing values out",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observation() -> Observation {
        Observation {
            dataset: "buoys".parse().unwrap(),
            platform: "44005".to_owned(),
            kind: PlatformKind::Buoy,
            time: "2012-01-01T00:50:00Z".parse().unwrap(),
            lon_deg: -69.1,
            lat_deg: 43.2,
            depth_m: 0.6,
            property: "sea_surface_temperature".to_owned(),
            value: 280.4,
            unit: "K".to_owned(),
            quality: Quality::NotEvaluated,
        }
    }

    #[test]
    fn limits_are_held() {
        observation().validate().unwrap();
        let broken: [fn(&mut Observation); 7] = [
            |o| o.platform = String::new(),
            |o| o.platform = "a\nb".to_owned(),
            |o| o.property = "SST; DROP TABLE".to_owned(),
            |o| o.unit = "x".repeat(33),
            |o| o.lat_deg = 90.5,
            |o| o.depth_m = f64::NAN,
            |o| o.value = f64::INFINITY,
        ];
        for change in broken {
            let mut observation = observation();
            change(&mut observation);
            assert!(observation.validate().is_err(), "{observation:?}");
        }
    }

    #[test]
    fn flags_are_those_of_the_primary_scheme() {
        for flag in 1..=4 {
            assert_eq!(Quality::from_flag(flag).unwrap().flag(), flag);
        }
        assert!(Quality::from_flag(9).is_err());
    }

    #[test]
    fn qualities_are_named_alike_in_questions_and_answers() {
        for quality in Quality::ALL {
            let text = quality.to_string();
            assert_eq!(text.parse::<Quality>().unwrap(), quality);
            assert_eq!(serde_json::to_value(quality).unwrap(), text);
        }
        assert!("excellent".parse::<Quality>().is_err());
    }
}
