//! Instants and the periods that product steps cover: UTC, milliseconds, ISO 8601 at the edge.

mod step;
mod text;
mod words;

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use chrono::{DateTime, Datelike as _, Months, NaiveDate, NaiveDateTime, Utc};
use serde::{Deserialize, Serialize, Serializer};
use utoipa::ToSchema;

use crate::ContractError;

pub use step::TimeStep;
use text::IsoText;

/// An instant, milliseconds since 1970-01-01T00:00:00Z; shown and parsed as ISO 8601.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Deserialize, ToSchema)]
#[serde(try_from = "String")]
#[schema(value_type = String, format = DateTime, description = "An instant, ISO 8601 UTC.")]
pub struct TimeMs(i64);

/// Years that an instant may lie in: what ISO 8601 writes with four digits.
const YEARS: std::ops::RangeInclusive<i32> = 1..=9999;

impl TimeMs {
    /// An instant from milliseconds since 1970.
    ///
    /// # Errors
    /// Outside the years 1 to 9999.
    pub fn new(ms: i64) -> Result<Self, ContractError> {
        let valid = DateTime::from_timestamp_millis(ms).is_some_and(|t| YEARS.contains(&t.year()));
        if valid {
            Ok(Self(ms))
        } else {
            Err(bad_time(&ms.to_string()))
        }
    }

    /// Milliseconds since 1970.
    pub fn ms(self) -> i64 {
        self.0
    }

    /// Midnight at the start of a day.
    ///
    /// # Errors
    /// No such day, or outside the years 1 to 9999.
    pub fn from_ymd(year: i32, month: u32, day: u32) -> Result<Self, ContractError> {
        let date = NaiveDate::from_ymd_opt(year, month, day).filter(|d| YEARS.contains(&d.year()));
        let midnight = date.and_then(|d| d.and_hms_opt(0, 0, 0));
        midnight
            .map(|t| Self(t.and_utc().timestamp_millis()))
            .ok_or_else(|| bad_time(&format!("{year}-{month}-{day}")))
    }

    /// Year and month (1 to 12) of the instant.
    pub fn year_month(self) -> (i32, u32) {
        let t = self.utc();
        (t.year(), t.month())
    }

    /// Month (1 to 12) and day of the month (1 to 31) of the instant.
    pub fn month_day(self) -> (u32, u32) {
        let t = self.utc();
        (t.month(), t.day())
    }

    fn utc(self) -> DateTime<Utc> {
        DateTime::from_timestamp_millis(self.0).expect("range is checked at construction")
    }
}

fn bad_time(text: &str) -> ContractError {
    ContractError::invalid(
        "time",
        text,
        "ISO 8601 UTC, such as 2000-01, 2000-01-16, 2000-01-16T12:00 or 2000-01-16T12:00:00Z",
    )
}

/// An instant to the minute, with or without an offset, as one with seconds; none of any other form.
fn with_seconds(s: &str) -> Option<String> {
    const TO_THE_MINUTE: &[u8] = b"0000-00-00T00:00";
    let (minute, offset) = s.split_at_checked(TO_THE_MINUTE.len())?;
    let fits = |(byte, form): (u8, &u8)| match form {
        b'0' => byte.is_ascii_digit(),
        sign => byte == *sign,
    };
    let is_minute = minute.bytes().zip(TO_THE_MINUTE).all(fits);
    let is_offset = offset.is_empty() || offset.starts_with(['Z', '+', '-']);
    (is_minute && is_offset).then(|| format!("{minute}:00{offset}"))
}

impl Display for TimeMs {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(IsoText::of(self.utc()).as_str())
    }
}

impl Serialize for TimeMs {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(IsoText::of(self.utc()).as_str())
    }
}

impl FromStr for TimeMs {
    type Err = ContractError;

    /// Parses a year, a month, a day or an instant, with seconds or to the minute, as tables print it; without an offset it is UTC, and a
    /// shorter form means its start.
    fn from_str(s: &str) -> Result<Self, Self::Err> {
        if s.len() > 40 || !s.is_ascii() {
            return Err(bad_time(s));
        }
        let completed = with_seconds(s);
        let instant = completed.as_deref().unwrap_or(s);
        if let Ok(t) = DateTime::parse_from_rfc3339(instant) {
            return Self::new(t.timestamp_millis());
        }
        if let Ok(t) = NaiveDateTime::parse_from_str(instant, "%Y-%m-%dT%H:%M:%S%.f") {
            return Self::new(t.and_utc().timestamp_millis());
        }
        let day = match s.len() {
            4 => format!("{s}-01-01"),
            7 => format!("{s}-01"),
            10 => s.to_owned(),
            _ => return Err(bad_time(s)),
        };
        let date = NaiveDate::parse_from_str(&day, "%Y-%m-%d").map_err(|_unparsed| bad_time(s))?;
        Self::from_ymd(date.year(), date.month(), date.day())
    }
}

impl TryFrom<String> for TimeMs {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        s.parse()
    }
}

impl From<TimeMs> for String {
    fn from(t: TimeMs) -> Self {
        t.to_string()
    }
}

/// The half-open period `[start, end)` that one step of a product covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Period {
    /// First instant.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
}

impl Period {
    /// A period from its two ends.
    ///
    /// # Errors
    /// The end is not after the start.
    pub fn new(start: TimeMs, end: TimeMs) -> Result<Self, ContractError> {
        if start < end {
            Ok(Self { start, end })
        } else {
            Err(ContractError::invalid(
                "period",
                &format!("{start}/{end}"),
                "the end must come after the start",
            ))
        }
    }

    /// A calendar month with its true length; `month` is 1 to 12.
    ///
    /// # Errors
    /// No such month.
    pub fn month(year: i32, month: u32) -> Result<Self, ContractError> {
        Self::months(year, month, 1)
    }

    /// A calendar year.
    ///
    /// # Errors
    /// Outside the years 1 to 9998.
    pub fn year(year: i32) -> Result<Self, ContractError> {
        Self::months(year, 1, 12)
    }

    fn months(year: i32, month: u32, count: u32) -> Result<Self, ContractError> {
        let bad = || bad_time(&format!("{year}-{month:02}"));
        let first = NaiveDate::from_ymd_opt(year, month, 1).ok_or_else(bad)?;
        let next = first
            .checked_add_months(Months::new(count))
            .ok_or_else(bad)?;
        Self::new(
            TimeMs::from_ymd(first.year(), first.month(), 1)?,
            TimeMs::from_ymd(next.year(), next.month(), 1)?,
        )
    }

    /// Length, seconds.
    pub fn seconds(self) -> f64 {
        (self.end.0 - self.start.0) as f64 / 1000.0
    }

    /// The middle, where a step's mean value is taken to hold.
    pub fn mid(self) -> TimeMs {
        TimeMs(self.start.0 + (self.end.0 - self.start.0) / 2)
    }

    /// Do two periods share an instant?
    pub fn overlaps(self, other: Self) -> bool {
        self.start < other.end && other.start < self.end
    }
}

impl Display for Period {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.start, self.end)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these values are exact")]
mod tests {
    use super::*;

    #[test]
    fn months_have_their_true_length() {
        assert_eq!(Period::month(2000, 2).unwrap().seconds(), 29.0 * 86_400.0);
        assert_eq!(Period::month(1900, 2).unwrap().seconds(), 28.0 * 86_400.0);
        assert_eq!(Period::year(2000).unwrap().seconds(), 366.0 * 86_400.0);
        assert_eq!(
            Period::month(2000, 12).unwrap().end.to_string(),
            "2001-01-01T00:00:00Z"
        );
    }

    #[test]
    fn short_forms_mean_their_start() {
        let parse = |s: &str| s.parse::<TimeMs>().unwrap().to_string();
        assert_eq!(parse("2000"), "2000-01-01T00:00:00Z");
        assert_eq!(parse("2000-03"), "2000-03-01T00:00:00Z");
        assert_eq!(parse("2000-03-04"), "2000-03-04T00:00:00Z");
        assert_eq!(parse("2000-03-04T05:06:07"), "2000-03-04T05:06:07Z");
        assert_eq!(
            parse("2000-03-04T05:06:07.250+02:00"),
            "2000-03-04T03:06:07.250Z"
        );
    }

    #[test]
    fn instants_to_the_minute_are_read_as_tables_print_them() {
        let parse = |s: &str| s.parse::<TimeMs>().unwrap().to_string();
        assert_eq!(parse("2000-01-01T12:00"), "2000-01-01T12:00:00Z");
        assert_eq!(parse("2000-01-01T12:34Z"), "2000-01-01T12:34:00Z");
        assert_eq!(parse("2000-01-01T12:34+02:00"), "2000-01-01T10:34:00Z");
        assert_eq!(parse("2000-01-01T12:34-02:30"), "2000-01-01T15:04:00Z");
    }

    #[test]
    fn nonsense_times_are_refused() {
        for s in [
            "",
            "now",
            "2000-13",
            "2000-02-30",
            "99999",
            "٢٠٠٠",
            "2000-01-01T25:00:00Z",
            "2000-01-01T12",
            "2000-01-01T12:",
            "2000-01-01T12:0",
            "2000-01-01T24:00",
            "2000-01-01T12:60",
            "2000-02-30T12:00",
            "2000-01-01T12:00:",
            "2000-01-01T12:00x",
            "2000-01-01T12:00+",
            "2000-01-01T12:00Z ",
            "2000-01-01T 1:00",
            "-200-01-01T12:00",
            "0000-01-01T12:00",
            "-0001-01-01",
        ] {
            assert!(s.parse::<TimeMs>().is_err(), "{s}");
        }
    }
}
