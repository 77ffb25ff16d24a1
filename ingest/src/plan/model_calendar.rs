//! Steps of a calendar of models, in which all years or all months are alike: which of them are steps of the real calendar too, and
//! what is said of those that are.

use contract::time::{Period, TimeMs};

use super::Planning;
use super::refused::refused;
use crate::error::Rejection;
use crate::plan::cf::calendar::Calendar;

const DAY_MS: i64 = 86_400_000;

/// Notes that steps were taken for those of the real calendar, and what that changes.
///
/// # Errors
/// Months of 30 days, of which a step is no whole month: its days are no days of the real calendar.
pub(super) fn check(
    planning: &mut Planning<'_>,
    name: &str,
    calendar: Calendar,
    periods: &[Period],
) -> Result<(), Rejection> {
    if calendar.is_real() {
        return Ok(());
    }
    let part = periods.iter().find(|period| !is_of_months(**period));
    if let (Calendar::Days360, Some(part)) = (calendar, part) {
        let detail = format!(
            "is in the calendar 360_day, and has a step of {part}, which is no whole month: days of months of 30 days are no days of the real calendar; give means over whole months or years"
        );
        return Err(refused(name, detail));
    }
    planning.assume(format!("{name}: {}", told(calendar, periods)));
    Ok(())
}

/// That it is another calendar, and how much time its steps gain, lose or lack in the real one.
fn told(calendar: Calendar, periods: &[Period]) -> String {
    let what = match calendar {
        Calendar::Days360 => "of months of 30 days",
        Calendar::AllLeap => "with a 29 February in every year",
        _ => "without a 29 February",
    };
    let name = calendar.name();
    let mut said = vec![format!(
        "is in the calendar {name}, {what}; its dates are taken for the real ones"
    )];
    let other = |period: &&Period| {
        own_days(calendar, **period).is_some_and(|own| (own - days(**period)).abs() > 1e-6)
    };
    if let Some(first) = periods.iter().find(other) {
        let (real, own) = (days(*first), own_days(calendar, *first).unwrap_or_default());
        said.push(format!(
            "{} of {} steps are of another length there (that from {} of {real} days for {own}), which sums over time count",
            periods.iter().filter(other).count(),
            periods.len(),
            first.start
        ));
    }
    let missing = missing_days(calendar, periods);
    if let Some(first) = missing.first() {
        said.push(format!(
            "29 February is in no step ({} from {} on)",
            missing.len(),
            first.start
        ));
    }
    said.join("; ")
}

/// Days of a step.
fn days(period: Period) -> f64 {
    (period.end.ms() - period.start.ms()) as f64 / DAY_MS as f64
}

/// As many of the calendar; none of steps of at most a day, which keep their length.
fn own_days(calendar: Calendar, period: Period) -> Option<f64> {
    let number = |time: TimeMs| {
        let ((year, month), (_, day)) = (time.year_month(), time.month_day());
        calendar.day_number(year, month, day)
    };
    let is_long = period.end.ms() - period.start.ms() > DAY_MS;
    let of_day = |time: TimeMs| time.ms().rem_euclid(DAY_MS) as f64 / DAY_MS as f64;
    let length = || {
        let days = number(period.end)? - number(period.start)?;
        Some(days as f64 + of_day(period.end) - of_day(period.start))
    };
    is_long.then(length).flatten()
}

/// Each 29 February between the first and the last step that no step holds, of a calendar that has none.
fn missing_days(calendar: Calendar, periods: &[Period]) -> Vec<Period> {
    let (start, end) = (
        periods.iter().map(|period| period.start).min(),
        periods.iter().map(|period| period.end).max(),
    );
    let (Calendar::NoLeap, Some(start), Some(end)) = (calendar, start, end) else {
        return vec![];
    };
    let leap_day = |year: i32| {
        let (from, to) = (TimeMs::from_ymd(year, 2, 29), TimeMs::from_ymd(year, 3, 1));
        Period::new(from.ok()?, to.ok()?).ok()
    };
    let is_missing = |day: &Period| {
        let is_between = start <= day.start && day.end <= end;
        is_between && !periods.iter().any(|period| period.overlaps(*day))
    };
    let years = start.year_month().0..=end.year_month().0;
    years.filter_map(leap_day).filter(is_missing).collect()
}

fn is_of_months(period: Period) -> bool {
    let is_first = |time: TimeMs| {
        let (year, month) = time.year_month();
        TimeMs::from_ymd(year, month, 1) == Ok(time)
    };
    is_first(period.start) && is_first(period.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn period(start: &str, end: &str) -> Period {
        Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
    }

    fn months(year: i32) -> Vec<Period> {
        let month = |month| Period::month(year, month).unwrap();
        (1..=12).map(month).collect()
    }

    #[test]
    fn what_the_real_calendar_has_more_or_less_is_told() {
        for (calendar, year, wanted) in [
            (
                Calendar::NoLeap,
                2004,
                Some(
                    "1 of 12 steps are of another length there (that from 2004-02-01T00:00:00Z of 29 days for 28)",
                ),
            ),
            (Calendar::NoLeap, 2005, None),
            (Calendar::AllLeap, 2004, None),
            (
                Calendar::AllLeap,
                2005,
                Some(
                    "1 of 12 steps are of another length there (that from 2005-02-01T00:00:00Z of 28 days for 29)",
                ),
            ),
            (
                Calendar::Days360,
                2005,
                Some(
                    "8 of 12 steps are of another length there (that from 2005-01-01T00:00:00Z of 31 days for 30)",
                ),
            ),
        ] {
            let said = told(calendar, &months(year));
            assert!(said.contains(calendar.name()), "{said}");
            match wanted {
                Some(wanted) => assert!(said.contains(wanted), "{said}"),
                None => assert!(!said.contains("another length"), "{said}"),
            }
            assert!(said.len() < 280, "{said}");
        }
        let days = [
            period("2004-02-28", "2004-02-29"),
            period("2004-03-01", "2004-03-02"),
        ];
        let said = told(Calendar::NoLeap, &days);
        assert!(
            said.ends_with("29 February is in no step (1 from 2004-02-29T00:00:00Z on)"),
            "{said}"
        );
        let said = told(Calendar::NoLeap, &days[..1]);
        assert!(said.ends_with("taken for the real ones"), "{said}");
    }

    #[test]
    fn whole_months_are_told_from_their_parts() {
        let seasons = period("2004-12-01", "2005-03-01");
        assert!(is_of_months(seasons) && months(2004).into_iter().all(is_of_months));
        assert!(!is_of_months(period("2004-12-01", "2004-12-31")));
        assert!(!is_of_months(period("2004-12-01T12:00:00Z", "2005-01-01")));
    }
}
