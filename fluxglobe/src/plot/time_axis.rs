//! Time along an axis: years, or months where there are few years, with round ones marked.

use std::ops::Range;

use contract::time::{Period, TimeMs};

/// Years up to which months are marked.
const MONTHS_UP_TO: f64 = 4.0;
/// Most marks.
const MOST: f64 = 12.0;
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
    /// What is marked, in its unit.
    pub(super) marks: Vec<f64>,
}

impl TimeAxis {
    pub(super) fn over(start: TimeMs, end: TimeMs) -> Self {
        let years = year_of(end) - year_of(start);
        let (per_year, steps) = if years <= MONTHS_UP_TO {
            (12.0, &MONTHS[..])
        } else {
            (1.0, &YEARS[..])
        };
        let range = year_of(start) * per_year..year_of(end) * per_year;
        let length = range.end - range.start;
        let is_enough = |step: &&u32| length / f64::from(**step) <= MOST;
        let step = f64::from(*steps.iter().find(is_enough).unwrap_or(&1000));
        let first = (range.start / step - 1e-6).ceil() as i64;
        let last = (range.end / step + 1e-6).floor() as i64;
        Self {
            per_year,
            marks: (first..=last).map(|mark| mark as f64 * step).collect(),
            range,
        }
    }

    /// Where an instant lies.
    pub(super) fn at(&self, time: TimeMs) -> f64 {
        year_of(time) * self.per_year
    }

    /// What a place is called: `2000`, or `2000-03`.
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "plotters asks so")]
    pub(super) fn text(&self, place: &f64) -> String {
        if self.per_year < 2.0 {
            return format!("{place:.0}");
        }
        let months = place.round() as i64;
        format!("{}-{:02}", months.div_euclid(12), months.rem_euclid(12) + 1)
    }
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
        let texts =
            |axis: &TimeAxis| -> Vec<String> { axis.marks.iter().map(|m| axis.text(m)).collect() };
        let year = axis("2000", "2001");
        assert_eq!(texts(&year)[..2], ["2000-01", "2000-02"]);
        assert_eq!(texts(&year).last().unwrap(), "2001-01");
        let sixteen = axis("2002-07", "2018-07");
        assert_eq!(
            texts(&sixteen),
            [
                "2004", "2006", "2008", "2010", "2012", "2014", "2016", "2018"
            ]
        );
        let day = axis("2000-03-04", "2000-03-05");
        assert!(day.marks.is_empty() && day.range.start < day.range.end);
        assert!((year.at("2000-04".parse().unwrap()) - (2000.0 * 12.0 + 3.0)).abs() < 1e-9);
    }
}
