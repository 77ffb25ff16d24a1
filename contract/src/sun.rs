//! Where the light of a picture comes from: a place in the sky of every map, or the real sun of an instant.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::time::TimeMs;

/// 2000-01-01T12:00:00Z, milliseconds since 1970: the epoch of the formulas.
const J2000_MS: f64 = 946_728_000_000.0;
/// Milliseconds of a day.
const DAY_MS: f64 = 86_400_000.0;
/// Days of a Julian century.
const CENTURY_DAYS: f64 = 36_525.0;
/// The subsolar point is rounded to this part of a degree: it moves as far in 2.4 seconds, and instants that no eye
/// tells apart are one picture.
const PARTS_PER_DEG: f64 = 100.0;

/// Where the light comes from, in the frame of east, north and up at every place of a map; for globe views the same
/// frame at the point below the camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sun {
    /// Clockwise from north, degrees.
    #[serde(with = "crate::exact")]
    pub azimuth_deg: f64,
    /// Above the horizon, degrees, 5 to 90. Particles of map tiles are lit as by one no lower than 20, whose shadows stay near them.
    #[serde(with = "crate::exact")]
    pub elevation_deg: f64,
    /// The real sun, if it is shown: globe views are lit from there, maps have day and night by it and keep the slant
    /// of their shadows from the two angles above, so that tiles agree.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subsolar: Option<Subsolar>,
}

/// The place where the sun stands overhead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subsolar {
    /// Longitude, degrees east.
    #[serde(with = "crate::exact")]
    pub lon_deg: f64,
    /// Latitude, degrees north: the sun's declination.
    #[serde(with = "crate::exact")]
    pub lat_deg: f64,
}

/// The sun that somebody asks for: `time`, or `AZIMUTH,ELEVATION` in degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SunChoice {
    /// The real one of the picture's instant.
    OfTime,
    /// One that keeps its place in the sky.
    Fixed {
        /// Clockwise from north, degrees.
        azimuth_deg: f64,
        /// Above the horizon, degrees.
        elevation_deg: f64,
    },
}

impl SunChoice {
    /// The sun of a picture of this instant, in place of `sun`.
    pub fn instead_of(self, sun: Sun, time: TimeMs) -> Sun {
        match self {
            Self::OfTime => Sun {
                subsolar: Some(Subsolar::at(time)),
                ..sun
            },
            Self::Fixed {
                azimuth_deg,
                elevation_deg,
            } => Sun {
                azimuth_deg,
                elevation_deg,
                subsolar: None,
            },
        }
    }
}

impl std::str::FromStr for SunChoice {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        if s == "time" {
            return Ok(Self::OfTime);
        }
        let valid = "time, or azimuth and elevation in degrees such as 315,40";
        let bad = || ContractError::invalid("sun", s, valid);
        let (azimuth, elevation) = s.split_once(',').ok_or_else(bad)?;
        let degrees = |text: &str| text.trim().parse().map_err(|_no_number| bad());
        let sun = Sun {
            azimuth_deg: degrees(azimuth)?,
            elevation_deg: degrees(elevation)?,
            subsolar: None,
        };
        sun.validate()?;
        Ok(Self::Fixed {
            azimuth_deg: sun.azimuth_deg,
            elevation_deg: sun.elevation_deg,
        })
    }
}

impl std::fmt::Display for SunChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OfTime => f.write_str("time"),
            Self::Fixed {
                azimuth_deg,
                elevation_deg,
            } => write!(f, "{azimuth_deg},{elevation_deg}"),
        }
    }
}

impl Sun {
    pub(crate) fn validate(&self) -> Result<(), ContractError> {
        let bad = |reason: &str| Err(ContractError::invalid("sun", &format!("{self:?}"), reason));
        if !self.azimuth_deg.is_finite() || self.azimuth_deg.abs() > 36_000.0 {
            return bad("the azimuth is in degrees clockwise from north, such as 315");
        }
        if !(5.0..=90.0).contains(&self.elevation_deg) {
            return bad("the sun stands 5 to 90 degrees above the horizon");
        }
        match self.subsolar {
            Some(Subsolar { lon_deg, lat_deg })
                if !(-180.0..=180.0).contains(&lon_deg) || !(-90.0..=90.0).contains(&lat_deg) =>
            {
                bad("the sun stands over -180 to 180 degrees east, -90 to 90 degrees north")
            }
            _ => Ok(()),
        }
    }
}

impl Subsolar {
    /// Where the sun stands overhead at an instant, rounded to 1/100 degree; good to that in the centuries round 2000.
    ///
    /// Source: Meeus (1998), Astronomical Algorithms, 2nd edition: chapter 25, "low accuracy" (apparent right ascension
    /// and declination, eq. 25.2 to 25.8), and eq. 12.4 (sidereal time at Greenwich). Universal time stands for
    /// dynamical time: a minute moves the declination by less than 0.001 degree.
    pub fn at(time: TimeMs) -> Self {
        let days = (time.ms() as f64 - J2000_MS) / DAY_MS;
        let t = days / CENTURY_DAYS;
        let mean_longitude = 280.466_46 + t * (36_000.769_83 + t * 0.000_303_2);
        let anomaly = (357.529_11 + t * (35_999.050_29 - t * 0.000_153_7)).to_radians();
        let center = (1.914_602 - t * (0.004_817 + t * 0.000_014)) * anomaly.sin()
            + (0.019_993 - t * 0.000_101) * (2.0 * anomaly).sin()
            + 0.000_289 * (3.0 * anomaly).sin();
        let node = (125.04 - 1_934.136 * t).to_radians();
        let nutation = -0.004_78 * node.sin();
        let longitude = (mean_longitude + center - 0.005_69 + nutation).to_radians();
        let obliquity = (23.439_291_1 - 0.013_004_17 * t + 0.002_56 * node.cos()).to_radians();
        let declination = (obliquity.sin() * longitude.sin()).asin().to_degrees();
        let ascension = (obliquity.cos() * longitude.sin()).atan2(longitude.cos());
        let sidereal = 280.460_618_37
            + 360.985_647_366_29 * days
            + 0.000_387_933 * t * t
            + nutation * obliquity.cos();
        let lon_deg = crate::grid::wrap_lon_deg(ascension.to_degrees() - sidereal);
        Self {
            lon_deg: crate::grid::wrap_lon_deg(rounded(lon_deg)),
            lat_deg: rounded(declination),
        }
    }
}

fn rounded(degrees: f64) -> f64 {
    // No negative zero: it would be another name for the same place.
    (degrees * PARTS_PER_DEG).round() / PARTS_PER_DEG + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time: &str) -> Subsolar {
        Subsolar::at(time.parse().unwrap())
    }

    #[test]
    fn the_declination_is_that_of_the_almanac_at_solstices_and_equinoxes() {
        // Instants from the U.S. Naval Observatory, "Earth's Seasons".
        for (instant, lat_deg) in [
            ("2000-03-20T07:35:00Z", 0.0),
            ("2000-06-21T01:48:00Z", 23.44),
            ("2000-09-22T17:28:00Z", 0.0),
            ("2000-12-21T13:37:00Z", -23.44),
            ("2024-06-20T20:51:00Z", 23.44),
            ("2024-09-22T12:44:00Z", 0.0),
        ] {
            let found = at(instant).lat_deg;
            assert!((found - lat_deg).abs() < 0.02, "{instant}: {found}");
        }
    }

    #[test]
    fn the_equation_of_time_is_that_of_the_almanac() {
        // Minutes that the sun is ahead of the clock; a minute is a quarter of a degree.
        for (noon, ahead_min) in [
            ("2000-02-11T12:00:00Z", -14.24),
            ("2000-04-15T12:00:00Z", -0.06),
            ("2000-05-14T12:00:00Z", 3.66),
            ("2000-07-26T12:00:00Z", -6.54),
            ("2000-11-03T12:00:00Z", 16.43),
        ] {
            let found = at(noon).lon_deg;
            assert!((found + ahead_min / 4.0).abs() < 0.1, "{noon}: {found}");
        }
    }

    #[test]
    fn the_worked_example_of_the_book_comes_out() {
        // Meeus, examples 25.a and 28.a: 1992 October 13, 0h; declination -7.785, equation of time 13 min 42.6 s.
        let sun = at("1992-10-13");
        assert!((sun.lat_deg - -7.785).abs() < 0.011, "{sun:?}");
        assert!(
            (sun.lon_deg - (180.0 - 13.711 / 4.0)).abs() < 0.02,
            "{sun:?}"
        );
    }

    #[test]
    fn suns_are_asked_for_in_words() {
        let parse = |text: &str| text.parse::<SunChoice>();
        assert_eq!(parse("time").unwrap(), SunChoice::OfTime);
        assert_eq!(parse("135,30").unwrap().to_string(), "135,30");
        for bad in [
            "", "noon", "135", "135,30,1", "135,1", "nan,30", "1,inf", "a,b",
        ] {
            let text = parse(bad).unwrap_err().to_string();
            assert!(text.starts_with("sun "), "{text}");
        }
        let fixed = parse("90,45").unwrap();
        let time = "2000-06-21T12:00:00Z".parse().unwrap();
        let day = SunChoice::OfTime.instead_of(fixed.instead_of(sun(), time), time);
        assert!((day.azimuth_deg - 90.0).abs() < 1e-9 && day.subsolar.is_some());
        assert_eq!(fixed.instead_of(day, time).subsolar, None);
    }

    fn sun() -> Sun {
        Sun {
            azimuth_deg: 315.0,
            elevation_deg: 40.0,
            subsolar: None,
        }
    }

    #[test]
    fn the_sun_moves_west_by_a_turn_a_day() {
        let (noon, later) = (at("2000-06-01T12:00:00Z"), at("2000-06-01T18:00:00Z"));
        let west = crate::grid::wrap_lon_deg(noon.lon_deg - later.lon_deg);
        assert!((west - 90.0).abs() < 0.05, "{west}");
    }
}
