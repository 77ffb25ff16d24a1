//! Steps of several days that are counted from the first of January, as the makers of such composites count them: the last one of a year
//! ends with it.

use contract::time::{Period, TimeMs};

use super::calendar::CalendarDate;

const DAY_MS: i64 = 86_400_000;
/// Shortest rest of a year that is a step of its own, as a share of a whole one: five days of eight are, and thirteen of 32. Weeks that
/// begin on the last days of a year go on over New Year.
const LEAST_REST: f64 = 1.0 / 3.0;

/// What is left of the year of a date, ms, where one of the steps of so many days that are counted from 1 January begins there; none of a
/// rest that is too short for a step.
pub(super) fn rest_ms(start: CalendarDate, days: u32) -> Option<i64> {
    let first_of = |year: i32| {
        let first = CalendarDate {
            year,
            month: 1,
            day: 1,
            second: 0.0,
            ..start
        };
        first.count_ms()
    };
    let (start_ms, step_ms) = (start.count_ms()?, i64::from(days) * DAY_MS);
    let is_counted = days > 1 && (start_ms - first_of(start.year)?) % step_ms == 0;
    let rest_ms = first_of(start.year + 1)? - start_ms;
    (is_counted && rest_ms as f64 >= step_ms as f64 * LEAST_REST).then_some(rest_ms)
}

/// Do whole steps, in one order of time or the other, follow each other over a New Year that lies within one of them? Then they are not
/// counted anew there.
pub(super) fn is_passed(steps: &[Period]) -> bool {
    let year = |time_ms: i64| TimeMs::new(time_ms).map(|time| time.year_month().0);
    steps.windows(2).any(|pair| {
        let (one, other) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
        one.end == other.start && year(one.start.ms()) != year(one.end.ms() - 1)
    })
}

/// What is told of steps of so many days of which one is shorter, since it ends with its year.
pub(super) fn told(name: &str, days: u32, steps: &[Period]) -> Option<String> {
    let is_cut = |step: &&Period| {
        let is_short = step.end.ms() - step.start.ms() < i64::from(days) * DAY_MS;
        is_short && TimeMs::from_ymd(step.end.year_month().0, 1, 1) == Ok(step.end)
    };
    let cut = steps.iter().find(is_cut).filter(|_| days > 1)?;
    Some(format!(
        "{name}: steps of {days} days are counted from 1 January: that from {} ends with its year",
        cut.start
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::cf::calendar::Calendar;

    /// Days that are left of a year.
    fn rest(calendar: Calendar, (year, month, day): (i32, u32, u32), days: u32) -> Option<i64> {
        let start = CalendarDate {
            year,
            month,
            day,
            second: 0.0,
            calendar,
        };
        let rest_ms = rest_ms(start, days)?;
        assert_eq!(rest_ms % DAY_MS, 0);
        Some(rest_ms / DAY_MS)
    }

    #[test]
    fn the_last_composite_of_a_year_has_what_is_left_of_it() {
        let of = |date, days| rest(Calendar::Standard, date, days);
        assert_eq!(of((2001, 12, 27), 8), Some(5));
        assert_eq!(of((2004, 12, 26), 8), Some(6));
        assert_eq!(of((2001, 12, 19), 16), Some(13));
        assert_eq!(of((2001, 12, 19), 32), Some(13));
        assert_eq!(of((2001, 12, 27), 5), Some(5));
        // Counted from elsewhere, or a rest that is none.
        for (date, days) in [
            ((2001, 12, 28), 8),
            ((2004, 12, 27), 8),
            ((2001, 12, 31), 7),
            ((2004, 12, 31), 5),
            ((2001, 12, 31), 1),
        ] {
            assert_eq!(of(date, days), None, "{date:?} {days}");
        }
        assert_eq!(rest(Calendar::NoLeap, (2004, 12, 27), 8), Some(5));
        assert_eq!(rest(Calendar::Days360, (2001, 12, 23), 8), Some(8));
    }

    #[test]
    fn steps_that_follow_each_other_over_new_year_are_not_counted_anew() {
        let step = |start: &str, end: &str| {
            Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
        };
        let last = step("2001-12-27", "2002-01-04");
        let (next, anew) = (
            step("2002-01-04", "2002-01-12"),
            step("2002-01-01", "2002-01-09"),
        );
        assert!(is_passed(&[last, next]) && is_passed(&[next, last]));
        assert!(!is_passed(&[last, anew]) && !is_passed(&[last]));
        let year = step("2001-12-27", "2002-01-01");
        assert!(!is_passed(&[year, anew]), "it ends with its year");
        assert!(
            told("time", 8, &[anew, year])
                .unwrap()
                .contains("2001-12-27")
        );
        assert_eq!(told("time", 8, &[last, next]), None);
        assert_eq!(told("time", 5, &[year]), None);
    }
}
