//! Time along an axis: years, months where there are few years or days where there are few months, with round ones marked.

use std::ops::Range;

use contract::time::{Period, TimeMs};

use super::marked::Marks;

/// Years up to which months are marked.
const MONTHS_UP_TO: f64 = 4.0;
/// Days up to which days are marked.
const DAYS_UP_TO: f64 = 62.0;
const DAY_MS: i64 = 86_400_000;
/// Most marks.
const MOST: f64 = 12.0;
/// Days between marks.
const DAYS: [u32; 6] = [1, 2, 3, 5, 7, 10];
/// Months between marks.
const MONTHS: [u32; 4] = [1, 2, 3, 6];
/// Years between marks.
const YEARS: [u32; 7] = [1, 2, 5, 10, 20, 50, 100];

/// An axis over a period.
#[derive(Debug, Clone)]
pub(super) struct TimeAxis {
    /// Units in a year: 12 of months, 1 of years.
    per_year: f64,
    /// The ends, in its unit.
    pub(super) range: Range<f64>,
    /// What is marked, in its unit, and its texts: `2000`, `2000-03` or `2000-03-15`.
    pub(super) marks: Marks,
}

impl TimeAxis {
    pub(super) fn over(start: TimeMs, end: TimeMs) -> Self {
        let years = year_of(end) - year_of(start);
        let per_year = if years <= MONTHS_UP_TO { 12.0 } else { 1.0 };
        let range = year_of(start) * per_year..year_of(end) * per_year;
        let marks = if (end.ms() - start.ms()) as f64 <= DAYS_UP_TO * DAY_MS as f64 {
            days(start, end, per_year)
        } else {
            units(&range, per_year)
        };
        Self {
            per_year,
            marks: Marks::new(marks),
            range,
        }
    }

    /// Where an instant lies.
    pub(super) fn at(&self, time: TimeMs) -> f64 {
        year_of(time) * self.per_year
    }
}

/// The smallest step that makes few enough marks.
fn step(length: f64, steps: &[u32]) -> u32 {
    let is_enough = |step: &&u32| length / f64::from(**step) <= MOST;
    *steps.iter().find(is_enough).unwrap_or(&1000)
}

/// Round months or years.
fn units(range: &Range<f64>, per_year: f64) -> Vec<(f64, String)> {
    let is_months = per_year > 1.0;
    let steps = if is_months { &MONTHS[..] } else { &YEARS[..] };
    let step = f64::from(step(range.end - range.start, steps));
    let first = (range.start / step - 1e-6).ceil() as i64;
    let last = (range.end / step + 1e-6).floor() as i64;
    let places = (first..=last).map(|mark| mark as f64 * step);
    let text = |place: f64| {
        if !is_months {
            return format!("{place:.0}");
        }
        let months = place.round() as i64;
        format!("{}-{:02}", months.div_euclid(12), months.rem_euclid(12) + 1)
    };
    places.map(|place| (place, text(place))).collect()
}

/// Days from the first whole one on; the start where no day begins.
fn days(start: TimeMs, end: TimeMs, per_year: f64) -> Vec<(f64, String)> {
    let step = step((end.ms() - start.ms()) as f64 / DAY_MS as f64, &DAYS);
    let first = start.ms().div_euclid(DAY_MS) + i64::from(start.ms().rem_euclid(DAY_MS) > 0);
    let last = end.ms().div_euclid(DAY_MS);
    let days = (first..=last).step_by(step as usize);
    let instants = days.filter_map(|day| TimeMs::new(day * DAY_MS).ok());
    let marks: Vec<(f64, String)> = instants
        .map(|day| (year_of(day) * per_year, day.to_string()[..10].to_owned()))
        .collect();
    if marks.is_empty() {
        return vec![(year_of(start) * per_year, start.to_string())];
    }
    marks
}

/// The year of an instant, months of equal length, so that each begins at a twelfth.
fn year_of(time: TimeMs) -> f64 {
    let (year, month) = time.year_month();
    let share = Period::month(year, month).map_or(0.0, |period| {
        (time.ms() - period.start.ms()) as f64 / (period.end.ms() - period.start.ms()) as f64
    });
    f64::from(year) + (f64::from(month - 1) + share) / 12.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(start: &str, end: &str) -> TimeAxis {
        TimeAxis::over(start.parse().unwrap(), end.parse().unwrap())
    }

    #[test]
    fn few_years_are_marked_by_month_and_many_by_round_years() {
        let year = axis("2000", "2001");
        assert_eq!(year.marks.texts()[..2], ["2000-01", "2000-02"]);
        assert_eq!(year.marks.texts().last(), Some(&"2001-01"));
        let sixteen = axis("2002-07", "2018-07");
        assert_eq!(
            sixteen.marks.texts(),
            [
                "2004", "2006", "2008", "2010", "2012", "2014", "2016", "2018"
            ]
        );
        let months = axis("2000-01", "2000-04");
        assert_eq!(
            months.marks.texts(),
            ["2000-01", "2000-02", "2000-03", "2000-04"]
        );
        assert!((year.at("2000-04".parse().unwrap()) - (2000.0 * 12.0 + 3.0)).abs() < 1e-9);
    }

    #[test]
    fn few_days_are_marked_by_day_and_whatever_is_shorter_by_its_start() {
        let ten = axis("2009-01-01", "2009-01-11");
        let texts = ten.marks.texts();
        assert_eq!((texts.len(), texts[0]), (11, "2009-01-01"));
        assert_eq!(texts.last(), Some(&"2009-01-11"));
        let across = axis("2009-01-30T12:00:00Z", "2009-02-28");
        let texts = across.marks.texts();
        assert_eq!(texts[..3], ["2009-01-31", "2009-02-03", "2009-02-06"]);
        assert!(texts.len() <= 13, "{texts:?}");
        let hours = axis("2000-03-04T01:00:00Z", "2000-03-04T02:00:00Z");
        assert_eq!(hours.marks.texts(), ["2000-03-04T01:00:00Z"]);
        assert!(hours.range.start < hours.range.end);
    }
}
