//! Numbers of a time axis (`days since 1900-01-01`) to calendar dates, in the calendars of CF.
//!
//! Dates are kept as year, month, day and seconds of the day, since 30 February exists in the 360-day calendar.

use std::fmt::{Display, Formatter};

use chrono::{Datelike as _, NaiveDate};

const DAY_S: f64 = 86_400.0;
const DAY_MS: i64 = 86_400_000;
/// Largest distance from the reference date, days: past year 9999 nothing is stored.
const MAX_DAYS: f64 = 4_000_000.0;

/// A calendar of CF.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Calendar {
    /// Julian before 1582-10-15, Gregorian from then on; also the default.
    Standard,
    ProlepticGregorian,
    /// No 29 February.
    NoLeap,
    /// A 29 February in every year.
    AllLeap,
    /// Twelve months of 30 days.
    Days360,
}

/// A date in some calendar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CalendarDate {
    pub(crate) year: i32,
    pub(crate) month: u32,
    pub(crate) day: u32,
    /// Seconds since midnight, 0 to below 86 400.
    pub(crate) second: f64,
    pub(crate) calendar: Calendar,
}

/// A unit of a time axis: step and reference date.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TimeUnit {
    step: CalendarStep,
    reference: CalendarDate,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum CalendarStep {
    Seconds(f64),
    /// So many of them are a second: whole ones are divided without a rounding.
    PartsOfSecond(f64),
    Months(i32),
}

impl Calendar {
    pub(crate) fn parse(name: Option<&str>) -> Result<Self, String> {
        match name.unwrap_or("standard").to_ascii_lowercase().as_str() {
            "standard" | "gregorian" | "" => Ok(Self::Standard),
            "proleptic_gregorian" => Ok(Self::ProlepticGregorian),
            "noleap" | "365_day" => Ok(Self::NoLeap),
            "all_leap" | "366_day" => Ok(Self::AllLeap),
            "360_day" => Ok(Self::Days360),
            other => Err(format!(
                "calendar {other:?} is not known; give the time in a profile"
            )),
        }
    }

    /// Is it that of the days on which things were measured, and not one of models?
    pub(crate) fn is_real(self) -> bool {
        matches!(self, Self::Standard | Self::ProlepticGregorian)
    }

    /// Its name in the conventions.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::ProlepticGregorian => "proleptic_gregorian",
            Self::NoLeap => "noleap",
            Self::AllLeap => "all_leap",
            Self::Days360 => "360_day",
        }
    }

    /// Days of a year, of one without a leap day where there are both.
    pub(crate) fn year_days(self) -> i64 {
        match self {
            Self::Standard | Self::ProlepticGregorian | Self::NoLeap => 365,
            Self::AllLeap => 366,
            Self::Days360 => 360,
        }
    }

    /// Days since an origin of the calendar's own; none of a day that it does not have.
    pub(crate) fn day_number(self, year: i32, month: u32, day: u32) -> Option<i64> {
        match self {
            Self::ProlepticGregorian => {
                NaiveDate::from_ymd_opt(year, month, day).map(|d| d.num_days_from_ce().into())
            }
            Self::Standard if (year, month, day) >= (1582, 10, 15) => {
                NaiveDate::from_ymd_opt(year, month, day).map(|d| d.num_days_from_ce().into())
            }
            Self::Standard => julian_day_number(year, month, day),
            Self::NoLeap => {
                let day_of_year = NaiveDate::from_ymd_opt(2001, month, day)?.ordinal0();
                Some(i64::from(year) * 365 + i64::from(day_of_year))
            }
            Self::AllLeap => {
                let day_of_year = NaiveDate::from_ymd_opt(2000, month, day)?.ordinal0();
                Some(i64::from(year) * 366 + i64::from(day_of_year))
            }
            Self::Days360 => {
                let valid = (1..=12).contains(&month) && (1..=30).contains(&day);
                valid
                    .then(|| i64::from(year) * 360 + i64::from(month - 1) * 30 + i64::from(day - 1))
            }
        }
    }

    fn date(self, day_number: i64, second: f64) -> Option<CalendarDate> {
        let (year, month, day) = match self {
            Self::ProlepticGregorian | Self::Standard => {
                let date = NaiveDate::from_num_days_from_ce_opt(i32::try_from(day_number).ok()?)?;
                if self == Self::Standard && date < NaiveDate::from_ymd_opt(1582, 10, 15)? {
                    return None; // nothing measured is that old
                }
                (date.year(), date.month(), date.day())
            }
            Self::NoLeap => {
                let year = i32::try_from(day_number.div_euclid(365)).ok()?;
                let date = NaiveDate::from_yo_opt(2001, day_number.rem_euclid(365) as u32 + 1)?;
                (year, date.month(), date.day())
            }
            Self::AllLeap => {
                let year = i32::try_from(day_number.div_euclid(366)).ok()?;
                let date = NaiveDate::from_yo_opt(2000, day_number.rem_euclid(366) as u32 + 1)?;
                (year, date.month(), date.day())
            }
            Self::Days360 => {
                let (year, day) = (
                    day_number.div_euclid(360),
                    day_number.rem_euclid(360) as u32,
                );
                (i32::try_from(year).ok()?, day / 30 + 1, day % 30 + 1)
            }
        };
        (1..=9998).contains(&year).then_some(CalendarDate {
            year,
            month,
            day,
            second,
            calendar: self,
        })
    }
}

impl CalendarDate {
    /// Milliseconds on the count of its calendar, from an origin of the calendar's own; none of a day that it does not have.
    pub(crate) fn count_ms(self) -> Option<i64> {
        let days = self.calendar.day_number(self.year, self.month, self.day)?;
        days.checked_mul(DAY_MS)?
            .checked_add((self.second * 1000.0).round() as i64)
    }

    /// The date so much later on that count; none outside the years 1 to 9998.
    pub(crate) fn later(self, ms: i64) -> Option<Self> {
        let count_ms = self.count_ms()?.checked_add(ms)?;
        let second = count_ms.rem_euclid(DAY_MS) as f64 / 1000.0;
        self.calendar.date(count_ms.div_euclid(DAY_MS), second)
    }
}

/// `2000-02-30`, and the time of day where it is no midnight.
impl Display for CalendarDate {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:04}-{:02}-{:02}", self.year, self.month, self.day)?;
        let second = self.second.round() as i64;
        if second == 0 {
            return Ok(());
        }
        let (hour, minute) = (second / 3600, second / 60 % 60);
        write!(f, "T{hour:02}:{minute:02}:{:02}", second % 60)
    }
}

/// Days since 0000-12-31 of the proleptic Gregorian calendar, for a date of the Julian calendar.
fn julian_day_number(year: i32, month: u32, day: u32) -> Option<i64> {
    let is_leap = year.rem_euclid(4) == 0;
    // Any leap or common Gregorian year tells which days exist.
    let day_of_year =
        NaiveDate::from_ymd_opt(if is_leap { 2000 } else { 2001 }, month, day)?.ordinal();
    let past = i64::from(year) - 1;
    // 1 January of year 1 (Julian) is 30 December of year 0 (Gregorian): two days earlier.
    Some(past * 365 + past.div_euclid(4) + i64::from(day_of_year) - 2)
}

impl TimeUnit {
    /// Reads `STEP since DATE`.
    pub(crate) fn parse(text: &str, calendar: Calendar) -> Result<Self, String> {
        let bad = || {
            format!(
                "time unit {text:?} is not of the form \"days since 1970-01-01\"; give the time in a profile"
            )
        };
        let lower = text.trim().to_ascii_lowercase();
        let (step, date) = lower.split_once(" since ").ok_or_else(bad)?;
        let step = match step.trim() {
            "seconds" | "second" | "sec" | "secs" | "s" => CalendarStep::Seconds(1.0),
            "milliseconds" | "millisecond" | "msec" | "msecs" | "ms" => {
                CalendarStep::PartsOfSecond(1e3)
            }
            "microseconds" | "microsecond" | "microsec" | "microsecs" | "usec" | "us" => {
                CalendarStep::PartsOfSecond(1e6)
            }
            "nanoseconds" | "nanosecond" | "nanosec" | "nanosecs" | "nsec" | "ns" => {
                CalendarStep::PartsOfSecond(1e9)
            }
            "minutes" | "minute" | "min" | "mins" => CalendarStep::Seconds(60.0),
            "hours" | "hour" | "hr" | "hrs" | "h" => CalendarStep::Seconds(3600.0),
            "days" | "day" | "d" => CalendarStep::Seconds(DAY_S),
            "weeks" | "week" => CalendarStep::Seconds(7.0 * DAY_S),
            "months" | "month" => CalendarStep::Months(1),
            "years" | "year" | "common_years" | "common_year" => CalendarStep::Months(12),
            _ => return Err(bad()),
        };
        let reference = parse_reference(date.trim(), calendar).ok_or_else(bad)?;
        Ok(Self { step, reference })
    }

    /// Does a number of the axis say an instant? Months and years are not equally long, so that a part of one is a time within it and no more.
    pub(crate) fn is_instant(self, number: f64) -> bool {
        match self.step {
            CalendarStep::Months(per_step) => (number * f64::from(per_step)).fract() == 0.0,
            CalendarStep::Seconds(_) | CalendarStep::PartsOfSecond(_) => true,
        }
    }

    /// The date of a number of the axis, or what is wrong.
    pub(crate) fn date(self, number: f64) -> Result<CalendarDate, String> {
        let bad = || {
            let read = match self.reference.calendar {
                Calendar::Standard => {
                    "15 October 1582 (before which this calendar is Julian) to the year 9998"
                }
                _ => "the years 1 to 9998",
            };
            format!("time {number} lies outside {read} or is no number; give the time in a profile")
        };
        let CalendarDate {
            year,
            month,
            day,
            second,
            calendar,
        } = self.reference;
        let after_s = match self.step {
            CalendarStep::Seconds(step_s) => number * step_s,
            CalendarStep::PartsOfSecond(parts) => number / parts,
            // Calendar months and years, as people who write them mean it; UDUNITS would take 30.44 days.
            CalendarStep::Months(per_step) => {
                if !(number.is_finite() && number.abs() < 120_000.0) {
                    return Err(bad());
                }
                let months = i64::from(year) * 12 + i64::from(month) - 1
                    + (number * f64::from(per_step)).floor() as i64;
                let year = i32::try_from(months.div_euclid(12)).map_err(|_far| bad())?;
                let month = months.rem_euclid(12) as u32 + 1;
                let number = calendar.day_number(year, month, 1).ok_or_else(bad)?;
                return calendar
                    .date(number + i64::from(day.min(28)) - 1, second)
                    .ok_or_else(bad);
            }
        };
        // To whole milliseconds: a sum of parts of a day may end a hair before its midnight, and would name the day before.
        let total_ms = ((after_s + second) * 1e3).round();
        let day_ms = DAY_MS as f64;
        let days = (total_ms / day_ms).floor();
        if !days.is_finite() || days.abs() > MAX_DAYS {
            return Err(bad());
        }
        let start = calendar.day_number(year, month, day).ok_or_else(bad)?;
        calendar
            .date(start + days as i64, (total_ms - days * day_ms) / 1e3)
            .ok_or_else(bad)
    }
}

/// `1970-1-1`, `1970-01-01 00:00:00`, `1970-01-01T00:00:00Z`, with an offset from UTC or without.
fn parse_reference(text: &str, calendar: Calendar) -> Option<CalendarDate> {
    let (date, clock) = text.split_once(['t', ' ']).unwrap_or((text, ""));
    let mut parts = date.splitn(3, '-').map(str::parse::<i32>);
    let (year, month, day) = (
        parts.next()?.ok()?,
        parts.next()?.ok()?,
        parts.next()?.ok()?,
    );
    let clock = clock
        .trim()
        .trim_end_matches("utc")
        .trim_end_matches('z')
        .trim();
    let (clock, offset_s) = split_offset(clock)?;
    let mut fields = clock.split(':').map(|f| {
        if f.is_empty() {
            Some(0.0)
        } else {
            f.parse::<f64>().ok()
        }
    });
    let mut field = || {
        fields
            .next()
            .unwrap_or(Some(0.0))
            .filter(|v| (0.0..=60.0).contains(v))
    };
    let second = field()? * 3600.0 + field()? * 60.0 + field()? - offset_s;
    let (month, day) = (u32::try_from(month).ok()?, u32::try_from(day).ok()?);
    calendar.day_number(year, month, day)?;
    Some(CalendarDate {
        year,
        month,
        day,
        second,
        calendar,
    })
}

/// Splits `00:00:00 +2:30` into the clock and seconds east of UTC.
fn split_offset(clock: &str) -> Option<(&str, f64)> {
    let Some(at) = clock.find(['+', '-']) else {
        return Some((clock, 0.0));
    };
    let (clock, offset) = clock.split_at(at);
    let sign = if offset.starts_with('-') { -1.0 } else { 1.0 };
    let digits = &offset[1..];
    let (hours, minutes) = match digits.split_once(':') {
        Some((hours, minutes)) => (hours, minutes),
        None if digits.len() == 4 => digits.split_at_checked(2)?,
        None => (digits, "0"),
    };
    let seconds = hours.parse::<f64>().ok()? * 3600.0 + minutes.parse::<f64>().ok()? * 60.0;
    (seconds.abs() < DAY_S).then_some((clock.trim(), sign * seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn date(unit: &str, calendar: &str, number: f64) -> String {
        let calendar = Calendar::parse(Some(calendar)).unwrap();
        let d = TimeUnit::parse(unit, calendar)
            .unwrap()
            .date(number)
            .unwrap();
        format!("{:04}-{:02}-{:02} {}", d.year, d.month, d.day, d.second)
    }

    /// Expected dates are those of Python's cftime 1.6 (`cftime.num2date`).
    #[test]
    fn dates_are_those_of_cftime() {
        assert_eq!(
            date(
                "seconds since 1970-01-01 00:00:00",
                "gregorian",
                978_350_400.0
            ),
            "2001-01-01 43200"
        );
        assert_eq!(
            date("days since 1900-1-1", "standard", 37_255.0),
            "2002-01-01 0"
        );
        assert_eq!(
            date("days since 1-1-1", "standard", 730_121.0),
            "2000-01-01 0"
        );
        assert_eq!(
            date("days since 1-1-1", "proleptic_gregorian", 730_119.0),
            "2000-01-01 0"
        );
        assert_eq!(
            date("days since 2000-01-01", "noleap", 59.0),
            "2000-03-01 0"
        );
        assert_eq!(
            date("days since 2000-01-01", "360_day", 59.5),
            "2000-02-30 43200"
        );
        assert_eq!(
            date("hours since 1999-12-31 12:00", "standard", 12.0),
            "2000-01-01 0"
        );
        assert_eq!(
            date("Days since 1970-01-01T00:00:00Z", "standard", 0.25),
            "1970-01-01 21600"
        );
    }

    /// Offsets are counted in the calendar of the file, whatever is subtracted or added.
    #[test]
    fn calendars_of_models_count_their_own_days() {
        for (calendar, number, expected) in [
            ("noleap", 365.0 * 4.0, "2004-01-01 0"),
            ("365_day", -306.0, "1999-03-01 0"),
            ("all_leap", 366.0, "2001-01-01 0"),
            ("366_day", 366.0 + 59.0, "2001-02-29 0"),
            ("360_day", 360.0 + 29.0, "2001-01-30 0"),
        ] {
            let found = date("days since 2000-01-01", calendar, number);
            assert_eq!(found, expected, "{calendar} {number}");
        }
        let calendar = Calendar::parse(Some("noleap")).unwrap();
        let unit = TimeUnit::parse("days since 2004-02-28", calendar).unwrap();
        let (last, first) = (unit.date(0.0).unwrap(), unit.date(1.0).unwrap());
        assert_eq!(
            (last.later(DAY_MS), first.later(-DAY_MS)),
            (Some(first), Some(last))
        );
        assert_eq!(first.to_string(), "2004-03-01");
        assert!(TimeUnit::parse("days since 2004-02-29", calendar).is_err());
    }

    #[test]
    fn dates_of_the_julian_calendar_are_refused_as_such() {
        let of = |calendar: &str| {
            let calendar = Calendar::parse(Some(calendar)).unwrap();
            let unit = TimeUnit::parse("days since 850-01-01", calendar).unwrap();
            unit.date(237_426.0).map(|date| date.year)
        };
        let refused = of("standard").unwrap_err();
        assert!(refused.contains("15 October 1582"), "{refused}");
        assert_eq!(of("proleptic_gregorian"), Ok(1500));
    }

    /// Numbers of 64 bits as other programs write them, whole seconds to the bit.
    #[test]
    fn parts_of_a_second_are_counted() {
        for (step, per_second) in [
            ("milliseconds", 1e3),
            ("microseconds", 1e6),
            ("nanoseconds", 1e9),
        ] {
            let unit = format!("{step} since 1970-01-01");
            let found = date(&unit, "standard", 978_350_401.0 * per_second);
            assert_eq!(found, "2001-01-01 43201", "{step}");
        }
    }

    #[test]
    fn parts_of_a_second_are_counted_too() {
        for (unit, number) in [
            ("milliseconds since 1970-01-01", 1_577_923_200_000.0),
            ("microseconds since 1970-01-01", 1_577_923_200_000_000.0),
            ("nanoseconds since 1970-01-01", 1_577_923_200_000_000_000.0),
            ("us since 2020-01-01T12:00:00", 43_200_000_000.0),
            ("ns since 2020-01-01 18:00", 21_600_000_000_000.0),
        ] {
            assert_eq!(date(unit, "standard", number), "2020-01-02 0", "{unit}");
        }
    }

    /// As a program that adds up hours writes them: the sum ends a hair before its midnights.
    #[test]
    fn a_sum_of_parts_of_a_day_names_the_day_that_begins() {
        let (mut sum, mut below) = (0.0, 0);
        for hour in 1..=24 * 400 {
            sum += 1.0 / 24.0;
            if hour % 24 == 0 {
                let whole = f64::from(hour / 24);
                below += u32::from(sum < whole);
                let (own, exact) = (
                    date("days since 2001-01-01", "standard", sum),
                    date("days since 2001-01-01", "standard", whole),
                );
                assert_eq!(own, exact, "{sum}");
            }
        }
        assert!(below > 0, "no sum lies below its midnight");
    }

    #[test]
    fn a_reference_with_an_offset_is_turned_to_utc() {
        assert_eq!(
            date("hours since 2000-01-01 00:00:00 +2:00", "standard", 2.0),
            "2000-01-01 0"
        );
        assert_eq!(
            date("hours since 2000-01-01 00:00:00 -0330", "standard", 0.0),
            "2000-01-01 12600"
        );
    }

    #[test]
    fn months_since_are_calendar_months() {
        assert_eq!(
            date("months since 2010-1-1 0:0:0", "standard", 2.0),
            "2010-03-01 0"
        );
        assert_eq!(
            date("months since 2010-11-1", "standard", 3.0),
            "2011-02-01 0"
        );
        assert_eq!(
            date("years since 1999-01-01", "standard", 1.0),
            "2000-01-01 0"
        );
    }

    #[test]
    fn placeholders_and_nonsense_are_refused() {
        let unit = TimeUnit::parse("Days since 1970-01-01 00:00:00", Calendar::Standard).unwrap();
        for number in [1e9, f64::NAN, f64::INFINITY, -1e6, 1e300] {
            assert!(unit.date(number).is_err(), "{number}");
        }
        for text in [
            "fortnights since 1970-01-01",
            "days",
            "days since",
            "days since 1970-13-01",
            "days since 1970-02-30",
            "",
        ] {
            assert!(TimeUnit::parse(text, Calendar::Standard).is_err(), "{text}");
        }
        assert!(Calendar::parse(Some("lunar")).is_err());
    }
}
