//! Dates in attributes and file names.

use chrono::{DateTime, NaiveDate, NaiveDateTime, NaiveTime};
use contract::event::RejectReason;
use contract::time::{Period, TimeMs};

use crate::error::Rejection;
use crate::plan::cf::calendar::{Calendar, CalendarDate};
use crate::plan::cf::period;
use crate::plan::profile::pattern;

const DAY_MS: i64 = 86_400_000;
/// Longest text that is read as a date.
const MAX_DATE_BYTES: usize = 40;
/// Days with a time, as people write them.
const CLOCKS: [&str; 9] = [
    "%Y%m%dT%H%M%S%.f",
    "%Y%m%dT%H%M",
    "%Y%m%d%H%M%S",
    "%Y-%m-%dT%H:%M:%S%.f",
    "%Y-%m-%dT%H:%M",
    "%Y-%m-%d %H:%M:%S%.f",
    "%Y-%m-%d %H:%M",
    "%d-%b-%Y %H:%M:%S%.f",
    "%d-%b-%Y %H:%M",
];
/// Days without one, and how long each is.
const DAYS: [(usize, &str); 3] = [(8, "%Y%m%d"), (10, "%Y-%m-%d"), (11, "%d-%b-%Y")];

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

/// `2010-01-01`, `20100101T000000Z`, `01-JAN-2010 00:00:00` and the like, to the second; without an offset it is UTC. Text
/// that is not understood to its end is no date.
pub(super) fn of_attribute(text: &str) -> Option<CalendarDate> {
    let text = text.trim();
    if text.len() > MAX_DATE_BYTES || !text.is_ascii() {
        return None;
    }
    if let Ok(time) = text.parse::<TimeMs>() {
        return Some(of_instant(time));
    }
    let time = |ms| TimeMs::new(ms).ok().map(of_instant);
    let with_offset = CLOCKS
        .iter()
        .find_map(|clock| DateTime::parse_from_str(text, &format!("{clock}%#z")).ok());
    if let Some(instant) = with_offset {
        return time(instant.timestamp_millis());
    }
    let plain = text
        .trim_end_matches("UTC")
        .trim_end_matches(['Z', 'z'])
        .trim_end();
    let clock = CLOCKS
        .iter()
        .find_map(|clock| NaiveDateTime::parse_from_str(plain, clock).ok());
    if let Some(clock) = clock {
        return time(clock.and_utc().timestamp_millis());
    }
    let day = DAYS
        .iter()
        .filter(|(len, _)| *len == plain.len())
        .find_map(|(_, day)| NaiveDate::parse_from_str(plain, day).ok())?;
    time(day.and_time(NaiveTime::MIN).and_utc().timestamp_millis())
}

/// The first instant after what a text names, ISO 8601 or as people write it: a day, a month or a year without a time is its whole.
pub(super) fn end_of_attribute(text: &str) -> Option<TimeMs> {
    let named = period::instant(of_attribute(text)?).ok()?;
    let text = text.trim();
    let (year, month) = named.year_month();
    let whole = match text.len() {
        4 => Period::year(year),
        7 => Period::month(year, month),
        8 | 10 | 11 if !text.contains(':') => return TimeMs::new(named.ms() + DAY_MS).ok(),
        _ => return Some(named),
    };
    Some(whole.ok()?.end)
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
    let at_hour = |date| CalendarDate {
        second: f64::from(found.hour.unwrap_or(0)) * 3600.0,
        ..date
    };
    if let Some(day_of_year) = found.day_of_year {
        let first = TimeMs::from_ymd(year, 1, 1).map_err(|_no_year| bad())?;
        let time = TimeMs::new(first.ms() + i64::from(day_of_year - 1) * DAY_MS);
        return time.map(of_instant).map(at_hour).map_err(|_far| bad());
    }
    let month = found.month.ok_or_else(bad)?;
    Ok(at_hour(day(year, month, found.day.unwrap_or(1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<(i32, u32, u32, f64)> {
        of_attribute(text).map(|d| (d.year, d.month, d.day, d.second))
    }

    #[test]
    fn dates_in_attributes_are_read_in_the_ways_people_write_them() {
        for text in [
            "2010-01-05",
            "20100105T000000Z",
            "05-JAN-2010 00:00:00.000000",
            "05-Jan-2010",
            "20100105",
            "2010-01-05T00:00:00Z",
            "2010-01-05 00:00",
            "2010-01-05 00:00:00 UTC",
        ] {
            assert_eq!(read(text), Some((2010, 1, 5, 0.0)), "{text}");
        }
        for text in [
            "",
            "soon",
            "99999999",
            "5-JAN-2010",
            "٢٠١٠-01-01",
            "2010-01-05 at noon",
            "20100105T",
            "2010001000500000",
        ] {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn the_time_of_day_is_kept() {
        for text in [
            "20231231T120000Z",
            "20231231T120000",
            "20231231T1200Z",
            "20231231120000",
            "2023-12-31T12:00:00.000Z",
            "2023-12-31 12:00:00",
            "31-DEC-2023 12:00:00.000000",
            "2023-12-31T14:30:00+02:30",
            "20231231T143000+0230",
        ] {
            assert_eq!(read(text), Some((2023, 12, 31, 43_200.0)), "{text}");
        }
    }

    #[test]
    fn a_day_a_month_and_a_year_end_after_their_whole() {
        let end = |text| end_of_attribute(text).map(|end| end.to_string());
        for (text, wanted) in [
            ("20231231", "2024-01-01T00:00:00Z"),
            ("2023-12-31", "2024-01-01T00:00:00Z"),
            ("31-Dec-2023", "2024-01-01T00:00:00Z"),
            ("2023-02", "2023-03-01T00:00:00Z"),
            ("2023", "2024-01-01T00:00:00Z"),
            ("20231231T120000Z", "2023-12-31T12:00:00Z"),
        ] {
            assert_eq!(end(text).as_deref(), Some(wanted), "{text}");
        }
        assert_eq!(end("soon"), None);
    }

    #[test]
    fn a_file_name_gives_month_or_day_of_year() {
        let found = of_file_name("M{year}{day_of_year}*", "M2001060.nc", None).unwrap();
        assert_eq!((found.year, found.month, found.day), (2001, 3, 1));
        let found = of_file_name("{year}{month}{day}{hour}*", "2001063018.nc", None).unwrap();
        assert_eq!((found.day, found.second), (30, 64_800.0));
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
