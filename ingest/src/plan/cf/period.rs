//! Which period a step covers, from a stated length and the place of the stamp in it.

use contract::time::{Period, TimeMs};
use serde::Deserialize;

use super::calendar::CalendarDate;
use super::year_end;
use crate::inspect::file::description::Attributes;

const DAY_MS: i64 = 86_400_000;
const HOUR_MS: i64 = 3_600_000;
/// What is wrong with a date that leads out of what can be stored.
const TOO_FAR: &str = "leads past the years 1 to 9998";

/// How long the steps of a product are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub(crate) enum Covers {
    /// The calendar month that holds the stamp.
    Month,
    /// The calendar year that holds the stamp.
    Year,
    /// This many days from the start of the stamp's day; the last of those that are counted from 1 January ends with its year.
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

/// Where in its period a stamp stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum StampAt {
    Start,
    Middle,
    End,
}

impl Covers {
    /// The period of this length that a stamp names: the month or year that holds it, else the one that starts with it
    /// (days at its midnight).
    pub(crate) fn period(self, stamp: CalendarDate) -> Result<Period, String> {
        self.period_at(stamp, None)
    }

    /// The same, but days go on over New Year.
    pub(crate) fn period_over_new_year(self, stamp: CalendarDate) -> Result<Period, String> {
        self.step(stamp, None, false)
    }

    /// The period of this length in which a stamp stands where it is said.
    pub(crate) fn period_at(
        self,
        stamp: CalendarDate,
        at: Option<StampAt>,
    ) -> Result<Period, String> {
        self.step(stamp, at, true)
    }

    /// The same of all stamps of a file, in its order. Days go on over New Year where the stamps do.
    pub(crate) fn periods_at(
        self,
        stamps: &[CalendarDate],
        at: Option<StampAt>,
    ) -> Result<Vec<Period>, String> {
        let steps = |ends_with_year: bool| {
            let step = |stamp: &CalendarDate| self.step(*stamp, at, ends_with_year);
            stamps.iter().map(step).collect::<Result<Vec<_>, _>>()
        };
        let whole = steps(false)?;
        if year_end::is_passed(&whole) {
            return Ok(whole);
        }
        steps(true)
    }

    /// What is told of steps of this length that are shorter, since they end with their year.
    pub(crate) fn told(self, name: &str, steps: &[Period]) -> Option<String> {
        match self {
            Self::Days(days) => year_end::told(name, days, steps),
            Self::Month | Self::Year | Self::Hours(_) => None,
        }
    }

    /// The period of a stamp; days that are counted from 1 January end with their year, if they are to.
    fn step(
        self,
        stamp: CalendarDate,
        at: Option<StampAt>,
        ends_with_year: bool,
    ) -> Result<Period, String> {
        let after = |start: CalendarDate, ms: i64| between(start, later(start, ms)?);
        let named = match at {
            // An end is the first instant that does not belong to the period.
            Some(StampAt::End) => before(stamp)?,
            _ => stamp,
        };
        let text = |e: contract::ContractError| e.to_string();
        match (self, at) {
            (Self::Month, _) => Period::month(named.year, named.month).map_err(text),
            (Self::Year, _) => Period::year(named.year).map_err(text),
            (Self::Days(count), at) => {
                let first = CalendarDate {
                    second: 0.0,
                    ..named
                };
                let days = match at {
                    None | Some(StampAt::Start) => 0,
                    // Of an even number the stamp is the midnight in the middle, of an odd one its middle day.
                    Some(StampAt::Middle) => i64::from(count) / 2,
                    Some(StampAt::End) => i64::from(count) - 1,
                };
                let start = later(first, -days * DAY_MS)?;
                let ms = i64::from(count) * DAY_MS;
                let rest_ms = year_end::rest_ms(start, count).filter(|_| ends_with_year);
                after(start, rest_ms.map_or(ms, |rest_ms| rest_ms.min(ms)))
            }
            (Self::Hours(count), at) => {
                let ms = i64::from(count) * HOUR_MS;
                let early_ms = match at {
                    None | Some(StampAt::Start) => 0,
                    Some(StampAt::Middle) => ms / 2,
                    Some(StampAt::End) => ms,
                };
                after(later(stamp, -early_ms)?, ms)
            }
        }
    }
}

/// The period from one date to another of the same calendar, in the real one.
///
/// Of a calendar of models it is as long as the real one has it, but for a step of at most a day beside a 29 February that its
/// calendar lacks: such a step stays as long as it is, so that none is two days long and the day is missing.
///
/// # Errors
/// A date is no day of the real calendar, or the first one is not before the other.
pub(crate) fn between(start: CalendarDate, end: CalendarDate) -> Result<Period, String> {
    let from = instant(start)?;
    let own_ms = end
        .count_ms()
        .zip(start.count_ms())
        .map(|(end_ms, start_ms)| end_ms - start_ms)
        .filter(|ms| *ms <= DAY_MS && !start.calendar.is_real());
    let (from, to) = match own_ms {
        // With the day that it ends: the next one may be a 29 February that the real calendar lacks.
        Some(ms) if end.second <= 0.0 => (from, time(from.ms() + ms)?),
        Some(ms) => {
            let to = instant(end)?;
            (time(to.ms() - ms)?, to)
        }
        None => (from, instant(end)?),
    };
    Period::new(from, to).map_err(|e| e.to_string())
}

fn time(ms: i64) -> Result<TimeMs, String> {
    TimeMs::new(ms).map_err(|e| e.to_string())
}

/// The date so much later in its own calendar.
fn later(date: CalendarDate, ms: i64) -> Result<CalendarDate, String> {
    let why = || match date.count_ms() {
        Some(_) => format!("{date} {TOO_FAR}"),
        None => format!("{date} is no day of its calendar"),
    };
    date.later(ms).ok_or_else(why)
}

/// The date just before: the day before for a midnight.
fn before(date: CalendarDate) -> Result<CalendarDate, String> {
    if date.second > 0.0 {
        return Ok(date);
    }
    later(date, -DAY_MS)
}

fn midnight(date: CalendarDate) -> Result<TimeMs, String> {
    let missing = |_| {
        let date = CalendarDate {
            second: 0.0,
            ..date
        };
        format!(
            "{date} is a day of the calendar {} and none of the real one; give means over whole months or years, or times of the real calendar",
            date.calendar.name()
        )
    };
    TimeMs::from_ymd(date.year, date.month, date.day).map_err(missing)
}

/// The instant of a date, to the millisecond.
pub(crate) fn instant(date: CalendarDate) -> Result<TimeMs, String> {
    TimeMs::new(midnight(date)?.ms() + (date.second * 1000.0).round() as i64)
        .map_err(|e| e.to_string())
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
    use crate::plan::cf::calendar::Calendar;

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
    fn a_stamp_stands_where_it_is_said() {
        let period =
            |covers: Covers, stamp, at| covers.period_at(stamp, Some(at)).unwrap().to_string();
        let noon = |year, month, day| CalendarDate {
            second: 43_200.0,
            ..stamp(year, month, day)
        };
        let month = "2010-01-01T00:00:00Z/2010-02-01T00:00:00Z";
        assert_eq!(
            period(Covers::Month, stamp(2010, 2, 1), StampAt::End),
            month
        );
        assert_eq!(
            period(Covers::Month, stamp(2010, 1, 31), StampAt::End),
            month
        );
        assert_eq!(
            period(Covers::Month, stamp(2010, 1, 1), StampAt::Start),
            month
        );
        let year = "2009-01-01T00:00:00Z/2010-01-01T00:00:00Z";
        assert_eq!(period(Covers::Year, stamp(2010, 1, 1), StampAt::End), year);
        let eight = "2010-01-01T00:00:00Z/2010-01-09T00:00:00Z";
        assert_eq!(
            period(Covers::Days(8), stamp(2010, 1, 5), StampAt::Middle),
            eight
        );
        assert_eq!(
            period(Covers::Days(8), stamp(2010, 1, 9), StampAt::End),
            eight
        );
        let five = "2010-01-01T00:00:00Z/2010-01-06T00:00:00Z";
        assert_eq!(
            period(Covers::Days(5), noon(2010, 1, 3), StampAt::Middle),
            five
        );
        assert_eq!(
            period(Covers::Days(5), stamp(2010, 1, 3), StampAt::Middle),
            five
        );
        let six_hours = "2010-01-01T09:00:00Z/2010-01-01T15:00:00Z";
        assert_eq!(
            period(Covers::Hours(6), noon(2010, 1, 1), StampAt::Middle),
            six_hours
        );
    }

    #[test]
    fn steps_of_a_calendar_without_leap_days_are_of_their_own_days() {
        let noleap = |month, day, hour: f64| CalendarDate {
            second: hour * 3600.0,
            calendar: Calendar::NoLeap,
            ..stamp(2004, month, day)
        };
        let period = |covers: Covers, stamp, at| {
            let period = covers.period_at(stamp, Some(at)).unwrap().to_string();
            period.replace(":00:00Z", "").replace("2004-", "")
        };
        let day = Covers::Days(1);
        // 29 February is missing, whichever way a day is named.
        for (stamp, at) in [
            (noleap(2, 28, 12.0), StampAt::Middle),
            (noleap(2, 28, 0.0), StampAt::Start),
            (noleap(3, 1, 0.0), StampAt::End),
        ] {
            assert_eq!(period(day, stamp, at), "02-28T00/02-29T00", "{at:?}");
        }
        let six_hours = period(Covers::Hours(6), noleap(3, 1, 0.0), StampAt::Middle);
        assert_eq!(six_hours, "02-29T21/03-01T03");
        // Five days of the file follow each other without a gap, and the real calendar has six of them there.
        let five = |month, day| period(Covers::Days(5), noleap(month, day, 0.0), StampAt::Start);
        assert_eq!(
            [five(2, 25), five(3, 2)],
            ["02-25T00/03-02T00", "03-02T00/03-07T00"]
        );
    }

    #[test]
    fn days_that_the_real_calendar_lacks_are_named() {
        let of = |calendar, month, day| {
            let date = CalendarDate {
                calendar,
                ..stamp(2001, month, day)
            };
            Covers::Days(1).period(date)
        };
        for (calendar, day, name) in [
            (
                Calendar::Days360,
                30,
                "2001-02-30 is a day of the calendar 360_day",
            ),
            (
                Calendar::AllLeap,
                29,
                "2001-02-29 is a day of the calendar all_leap",
            ),
        ] {
            let refused = of(calendar, 2, day).unwrap_err();
            assert!(refused.starts_with(name), "{refused}");
        }
        assert!(of(Calendar::AllLeap, 3, 1).is_ok());
        // It ends where a day begins that is none.
        let last = of(Calendar::AllLeap, 2, 28).unwrap().to_string();
        assert_eq!(last, "2001-02-28T00:00:00Z/2001-03-01T00:00:00Z");
        let month = CalendarDate {
            calendar: Calendar::Days360,
            ..stamp(2001, 2, 30)
        };
        assert_eq!(
            Covers::Month.period(month).unwrap(),
            Period::month(2001, 2).unwrap()
        );
    }

    #[test]
    fn composites_of_days_end_with_their_year_unless_their_stamps_go_on() {
        let eight = Covers::Days(8);
        let cut = "2001-12-27T00:00:00Z/2002-01-01T00:00:00Z";
        for (date, at) in [
            (stamp(2001, 12, 27), None),
            (stamp(2001, 12, 27), Some(StampAt::Start)),
            (stamp(2001, 12, 31), Some(StampAt::Middle)),
        ] {
            assert_eq!(eight.period_at(date, at).unwrap().to_string(), cut);
        }
        let last = |stamps: &[CalendarDate]| {
            let periods = eight.periods_at(stamps, None).unwrap();
            (periods[0].to_string(), eight.told("time", &periods))
        };
        let (found, told) = last(&[stamp(2001, 12, 27), stamp(2002, 1, 1)]);
        assert!(found == cut && told.is_some(), "{found} {told:?}");
        let whole = "2001-12-27T00:00:00Z/2002-01-04T00:00:00Z".to_owned();
        assert_eq!(
            last(&[stamp(2001, 12, 27), stamp(2002, 1, 4)]),
            (whole, None)
        );
    }

    #[test]
    fn unknown_lengths_are_refused() {
        for text in ["fortnight", "0 days", "-1 days", "2 months", "", "x days"] {
            assert!(Covers::try_from(text.to_owned()).is_err(), "{text}");
        }
    }
}
