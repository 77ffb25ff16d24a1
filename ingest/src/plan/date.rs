//! Dates in attributes and file names.

use contract::event::RejectReason;
use contract::time::{Period, TimeMs};

use crate::cf::calendar::{Calendar, CalendarDate};
use crate::profile::pattern;
use crate::rejection::Rejection;

const DAY_MS: i64 = 86_400_000;
const MONTHS: [&str; 12] = [
    "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
];

/// Midnight of a day of the real calendar.
pub(super) fn day(year: i32, month: u32, day: u32) -> CalendarDate {
    CalendarDate {
        year,
        month,
        day,
        second: 0.0,
        calendar: Calendar::ProlepticGregorian,
    }
}

/// An instant as a date.
pub(super) fn of_instant(time: TimeMs) -> CalendarDate {
    let (year, month) = time.year_month();
    let start_ms = Period::month(year, month).map_or(time.ms(), |p| p.start.ms());
    let ms = time.ms() - start_ms;
    CalendarDate {
        second: (ms % DAY_MS) as f64 / 1000.0,
        ..day(year, month, (ms / DAY_MS) as u32 + 1)
    }
}

/// `2010-01-01`, `20100101T000000Z`, `01-JAN-2010 00:00:00` and the like.
pub(super) fn of_attribute(text: &str) -> Option<CalendarDate> {
    if let Ok(time) = text.parse::<TimeMs>() {
        return Some(of_instant(time));
    }
    let digits: Vec<u32> = text.chars().map_while(|c| c.to_digit(10)).collect();
    let number =
        |range: std::ops::Range<usize>| Some(digits.get(range)?.iter().fold(0, |n, d| n * 10 + d));
    if digits.len() >= 8 {
        return TimeMs::from_ymd(number(0..4)? as i32, number(4..6)?, number(6..8)?)
            .ok()
            .map(of_instant);
    }
    let mut parts = text.get(..11)?.split('-');
    let (day, month, year) = (
        parts.next()?,
        parts.next()?.to_ascii_lowercase(),
        parts.next()?,
    );
    let month = MONTHS.iter().position(|m| *m == month)? as u32 + 1;
    TimeMs::from_ymd(year.parse().ok()?, month, day.parse().ok()?)
        .ok()
        .map(of_instant)
}

/// The date in a file name that fits a pattern; `year` where the name has none.
pub(super) fn of_file_name(
    pattern: &str,
    file_name: &str,
    year: Option<i32>,
) -> Result<CalendarDate, Rejection> {
    let bad = || {
        let detail = format!(
            "does not fit the profile's pattern {pattern:?}; rename it or give the profile that fits"
        );
        Rejection::new(RejectReason::Time, "file name", detail)
    };
    let found = pattern::date(pattern, file_name).ok_or_else(bad)?;
    let named = found.year.map(|year| year as i32);
    let year = named.or(year).ok_or_else(bad)?;
    if let Some(day_of_year) = found.day_of_year {
        let first = TimeMs::from_ymd(year, 1, 1).map_err(|_no_year| bad())?;
        let time = TimeMs::new(first.ms() + i64::from(day_of_year - 1) * DAY_MS);
        return time.map(of_instant).map_err(|_far| bad());
    }
    Ok(day(
        year,
        found.month.ok_or_else(bad)?,
        found.day.unwrap_or(1),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_in_attributes_are_read_in_the_ways_people_write_them() {
        for text in [
            "2010-01-05",
            "20100105T000000Z",
            "05-JAN-2010 00:00:00.000000",
            "20100105",
            "2010-01-05T00:00:00Z",
        ] {
            let found = of_attribute(text).unwrap();
            assert_eq!(
                (found.year, found.month, found.day, found.second),
                (2010, 1, 5, 0.0),
                "{text}"
            );
        }
        for text in ["", "soon", "99999999", "5-JAN-2010", "٢٠١٠-01-01"] {
            assert!(of_attribute(text).is_none(), "{text}");
        }
    }

    #[test]
    fn a_file_name_gives_month_or_day_of_year() {
        let found = of_file_name("M{year}{day_of_year}*", "M2001060.nc", None).unwrap();
        assert_eq!((found.year, found.month, found.day), (2001, 3, 1));
        let found = of_file_name("s{month}.nc", "s07.nc", Some(2011)).unwrap();
        assert_eq!((found.year, found.month), (2011, 7));
        assert!(
            of_file_name("{year}{month}*", "nothing.nc", None)
                .unwrap_err()
                .detail
                .contains("pattern")
        );
    }
}
