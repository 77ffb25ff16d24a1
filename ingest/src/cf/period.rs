//! Which period a step covers: from a stated length, from neighbouring stamps, or from a file's coverage attributes.

use contract::time::{Period, TimeMs};
use serde::Deserialize;

use super::calendar::CalendarDate;
use crate::file::description::Attributes;

const DAY_MS: i64 = 86_400_000;

/// How long the steps of a product are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub(crate) enum Covers {
    /// The calendar month that holds the stamp.
    Month,
    /// The calendar year that holds the stamp.
    Year,
    /// This many days from the start of the stamp's day.
    Days(u32),
    /// This many hours from the stamp.
    Hours(u32),
}

impl TryFrom<String> for Covers {
    type Error = String;

    /// `month`, `year`, `day`, `8 days`, `6 hours`.
    fn try_from(text: String) -> Result<Self, Self::Error> {
        let bad = || {
            format!(
                "covers = {text:?} is not known; use month, year, day, or such as \"8 days\" or \"6 hours\""
            )
        };
        let (count, word) = match text.split_once([' ', '-']) {
            Some((count, word)) => (count.parse().map_err(|_no_number| bad())?, word),
            None => (1, text.as_str()),
        };
        match (count, word.trim_end_matches('s')) {
            (1, "month") => Ok(Self::Month),
            (1, "year") => Ok(Self::Year),
            (n @ 1..=366, "day") => Ok(Self::Days(n)),
            (n @ 1..=8784, "hour") => Ok(Self::Hours(n)),
            _ => Err(bad()),
        }
    }
}

impl Covers {
    /// The period of this length that a stamp names.
    pub(crate) fn period(self, stamp: CalendarDate) -> Result<Period, String> {
        let text = |e: contract::ContractError| e.to_string();
        let after = |start: TimeMs, ms: i64| {
            Period::new(start, TimeMs::new(start.ms() + ms).map_err(text)?).map_err(text)
        };
        match self {
            Self::Month => Period::month(stamp.year, stamp.month).map_err(text),
            Self::Year => Period::year(stamp.year).map_err(text),
            Self::Days(count) => after(midnight(stamp)?, i64::from(count) * DAY_MS),
            Self::Hours(count) => after(instant(stamp)?, i64::from(count) * 3_600_000),
        }
    }
}

fn midnight(date: CalendarDate) -> Result<TimeMs, String> {
    let missing = |_| {
        format!(
            "{}-{:02}-{:02} is no day of the real calendar; only monthly steps can be read from this one",
            date.year, date.month, date.day
        )
    };
    TimeMs::from_ymd(date.year, date.month, date.day).map_err(missing)
}

/// The instant of a date, to the millisecond.
pub(crate) fn instant(date: CalendarDate) -> Result<TimeMs, String> {
    TimeMs::new(midnight(date)?.ms() + (date.second * 1000.0).round() as i64)
        .map_err(|e| e.to_string())
}

/// How long steps are, from the distance of their stamps; none if that does not tell.
pub(crate) fn of_spacing(stamps: &[CalendarDate]) -> Option<Covers> {
    let times: Vec<i64> = stamps
        .iter()
        .map(|s| instant(*s).map(TimeMs::ms))
        .collect::<Result<_, _>>()
        .ok()?;
    let (first, rest) = times.split_first()?;
    let spacings: Vec<i64> = std::iter::once(first)
        .chain(rest)
        .zip(rest)
        .map(|(a, b)| b - a)
        .collect();
    let (low, high) = (*spacings.iter().min()?, *spacings.iter().max()?);
    let months: Vec<i64> = stamps
        .iter()
        .map(|s| i64::from(s.year) * 12 + i64::from(s.month))
        .collect();
    let each_in_the_next_month = months.windows(2).all(|pair| pair[1] == pair[0] + 1);
    match (low, high) {
        _ if each_in_the_next_month && low >= 27 * DAY_MS => Some(Covers::Month),
        (low, high) if low >= 364 * DAY_MS && high <= 367 * DAY_MS => Some(Covers::Year),
        (low, high) if low != high || low <= 0 => None,
        (ms, _) if ms % DAY_MS == 0 => u32::try_from(ms / DAY_MS)
            .ok()
            .filter(|n| *n <= 366)
            .map(Covers::Days),
        (ms, _) if ms % 3_600_000 == 0 => u32::try_from(ms / 3_600_000)
            .ok()
            .filter(|n| *n <= 8784)
            .map(Covers::Hours),
        _ => None,
    }
}

/// How long the one step of a file is, from the attributes that say so.
pub(crate) fn of_attributes(attributes: &Attributes) -> Option<Covers> {
    let names = ["time_coverage_resolution", "time_coverage_duration"];
    let text = names
        .into_iter()
        .find_map(|name| attributes.text(name).filter(|t| t.starts_with('P')))?;
    match text {
        "P1M" => Some(Covers::Month),
        "P1Y" => Some(Covers::Year),
        _ => {
            let days: u32 = text.strip_prefix('P')?.strip_suffix('D')?.parse().ok()?;
            (1..=366).contains(&days).then_some(Covers::Days(days))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cf::calendar::Calendar;

    fn stamp(year: i32, month: u32, day: u32) -> CalendarDate {
        CalendarDate {
            year,
            month,
            day,
            second: 0.0,
            calendar: Calendar::Standard,
        }
    }

    #[test]
    fn a_stamp_anywhere_in_a_month_names_the_month() {
        for day in [1, 15, 29] {
            assert_eq!(
                Covers::Month.period(stamp(2000, 2, day)).unwrap(),
                Period::month(2000, 2).unwrap()
            );
        }
        let week = Covers::try_from("8 days".to_owned())
            .unwrap()
            .period(stamp(2000, 2, 26))
            .unwrap();
        assert_eq!(
            week.to_string(),
            "2000-02-26T00:00:00Z/2000-03-05T00:00:00Z"
        );
    }

    #[test]
    fn spacing_tells_months_days_and_years_apart() {
        let months: Vec<_> = (1..=12).map(|m| stamp(2001, m, 15)).collect();
        assert_eq!(of_spacing(&months), Some(Covers::Month));
        let days: Vec<_> = (1..=20).map(|d| stamp(2001, 2, d)).collect();
        assert_eq!(of_spacing(&days), Some(Covers::Days(1)));
        let years: Vec<_> = (1999..=2004).map(|y| stamp(y, 7, 1)).collect();
        assert_eq!(of_spacing(&years), Some(Covers::Year));
        assert_eq!(
            of_spacing(&[stamp(2001, 1, 1), stamp(2001, 1, 4), stamp(2001, 1, 5)]),
            None
        );
        assert_eq!(of_spacing(&[stamp(2001, 1, 1)]), None);
    }

    #[test]
    fn unknown_lengths_are_refused() {
        for text in ["fortnight", "0 days", "-1 days", "2 months", "", "x days"] {
            assert!(Covers::try_from(text.to_owned()).is_err(), "{text}");
        }
    }
}
