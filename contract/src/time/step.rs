//! Steps of time: what a row of an answer covers, whatever is asked for.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Period, TimeMs};
use crate::ContractError;

const DAY_MS: i64 = 86_400_000;
/// Most rows of an answer: 270 years of days.
const MAX_BINS: usize = 100_000;

/// What one row of an answer covers: a budget's, a statistic's, a Hovmöller diagram's, a mean that a trend is drawn through.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum TimeStep {
    /// The product's own steps.
    Native,
    /// Days, UTC.
    Day,
    /// Weeks from Monday on (ISO 8601).
    Week,
    /// Calendar months.
    Month,
    /// December to February, March to May, June to August, September to November.
    Season,
    /// Calendar years.
    Year,
    /// The whole asked period.
    Total,
}

impl TimeStep {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Native,
        Self::Day,
        Self::Week,
        Self::Month,
        Self::Season,
        Self::Year,
        Self::Total,
    ];

    /// Name on the command line and in addresses.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Native => "native",
            Self::Day => "day",
            Self::Week => "week",
            Self::Month => "month",
            Self::Season => "season",
            Self::Year => "year",
            Self::Total => "total",
        }
    }

    /// Longest of a product's steps that are gathered in bins of it, s: the longest bin with a little to spare, for steps of 30.4
    /// days and the like. None where any step will do.
    pub fn longest_step_s(self) -> Option<f64> {
        let days = match self {
            Self::Native | Self::Total => return None,
            Self::Day => 1.5,
            Self::Week => 7.5,
            Self::Month => 32.0,
            Self::Season => 93.0,
            Self::Year => 365.25 * 1.01,
        };
        Some(days * DAY_MS as f64 / 1000.0)
    }

    /// The bin that holds an instant, as long as the calendar makes it; none for those that no calendar makes.
    ///
    /// # Errors
    /// It reaches beyond the years 1 to 9999.
    pub fn calendar(self, time: TimeMs) -> Result<Option<Period>, ContractError> {
        let (year, month) = time.year_month();
        let days = |first: i64, count: i64| {
            let start = TimeMs::new(first * DAY_MS)?;
            Period::new(start, TimeMs::new((first + count) * DAY_MS)?)
        };
        let day = time.ms().div_euclid(DAY_MS);
        let bin = match self {
            Self::Native | Self::Total => return Ok(None),
            Self::Day => days(day, 1)?,
            // 1 January 1970 was a Thursday.
            Self::Week => days(day - (day + 3).rem_euclid(7), 7)?,
            Self::Month => Period::month(year, month)?,
            Self::Season => season(year, month)?,
            Self::Year => Period::year(year)?,
        };
        Ok(Some(bin))
    }

    /// Whole bins without a gap, from the one that holds the first instant of `window` to the one that holds its last, in the
    /// order of time: at most 3.7 million, the days of all years that an instant can name. `window` itself where no calendar
    /// makes them.
    pub fn whole_bins(self, window: Period) -> Vec<Period> {
        let mut bins: Vec<Period> = vec![];
        let mut at = window.start;
        while at < window.end {
            // The last years that an instant can name have no bin that ends in them.
            let Ok(bin) = self.calendar(at) else { break };
            let bin = bin.unwrap_or(window);
            bins.push(bin);
            at = bin.end;
        }
        bins
    }

    /// Bins of `window` in the order of time, cut at its ends. Native ones are `native`, cut alike: those that have no
    /// time in the window are left out.
    ///
    /// # Errors
    /// More than 100 000, or beyond the years 1 to 9999.
    pub fn bins(
        self,
        window: Period,
        native: impl IntoIterator<Item = Period>,
    ) -> Result<Vec<Period>, ContractError> {
        let cut = |bin: Period| Period {
            start: bin.start.max(window.start),
            end: bin.end.min(window.end),
        };
        let mut bins: Vec<Period> = vec![];
        if self == Self::Native {
            let inside = native.into_iter().filter(|step| step.overlaps(window));
            bins.extend(inside.map(cut).take(MAX_BINS + 1));
        } else {
            let mut at = window.start;
            while at < window.end && bins.len() <= MAX_BINS {
                let bin = cut(self.calendar(at)?.unwrap_or(window));
                at = bin.end;
                bins.push(bin);
            }
        }
        if bins.len() <= MAX_BINS {
            return Ok(bins);
        }
        let reason = format!("{window} has more than {MAX_BINS} of them: ask for longer ones");
        Err(ContractError::invalid("step", self.as_str(), reason))
    }
}

/// The season of a month.
fn season(year: i32, month: u32) -> Result<Period, ContractError> {
    let (year, first) = match month {
        1 | 2 => (year - 1, 12),
        _ => (year, month / 3 * 3),
    };
    let next = match first {
        12 => (year + 1, 3),
        _ => (year, first + 3),
    };
    Period::new(
        TimeMs::from_ymd(year, first, 1)?,
        TimeMs::from_ymd(next.0, next.1, 1)?,
    )
}

impl Display for TimeStep {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for TimeStep {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|step| step.as_str() == s);
        let reason = "use native, day, week, month, season, year or total";
        found.ok_or_else(|| ContractError::invalid("step", s, reason))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn period(start: &str, end: &str) -> Period {
        Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
    }

    fn calendar(step: TimeStep, time: &str) -> Period {
        step.calendar(time.parse().unwrap()).unwrap().unwrap()
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        for step in TimeStep::ALL {
            assert_eq!(step.to_string().parse::<TimeStep>().unwrap(), step);
            let json = serde_json::to_string(&step).unwrap();
            assert_eq!(json, format!("\"{step}\""));
        }
        assert!("decade".parse::<TimeStep>().is_err());
    }

    #[test]
    fn seasons_and_weeks_are_those_of_the_calendar() {
        let season = |time| calendar(TimeStep::Season, time);
        assert_eq!(season("2000-01-31"), period("1999-12-01", "2000-03-01"));
        assert_eq!(season("2000-02-29"), period("1999-12-01", "2000-03-01"));
        assert_eq!(season("2000-03-01"), period("2000-03-01", "2000-06-01"));
        assert_eq!(season("2000-08-31"), period("2000-06-01", "2000-09-01"));
        assert_eq!(season("2000-11-30"), period("2000-09-01", "2000-12-01"));
        assert_eq!(season("2000-12-01"), period("2000-12-01", "2001-03-01"));
        let week = |time| calendar(TimeStep::Week, time);
        // 24 November 2025 is a Monday, and so was 29 December 1969.
        assert_eq!(week("2025-11-30"), period("2025-11-24", "2025-12-01"));
        assert_eq!(week("2025-11-24"), period("2025-11-24", "2025-12-01"));
        assert_eq!(week("1970-01-01"), period("1969-12-29", "1970-01-05"));
    }

    #[test]
    fn bins_tile_the_window() {
        let window = period("1999-11-16T06:00:00Z", "2001-02-03");
        for (step, count) in [
            (TimeStep::Day, 445),
            (TimeStep::Week, 64),
            (TimeStep::Month, 16),
            (TimeStep::Season, 6),
            (TimeStep::Year, 3),
            (TimeStep::Total, 1),
        ] {
            let bins = step.bins(window, []).unwrap();
            assert_eq!(bins.len(), count, "{step}");
            assert_eq!(bins[0].start, window.start);
            assert_eq!(bins[count - 1].end, window.end);
            assert!(bins.windows(2).all(|two| two[0].end == two[1].start));
        }
    }

    #[test]
    fn bins_are_cut_at_the_ends_of_the_window() {
        let window = period("2000-01-16", "2000-03-02");
        let months = TimeStep::Month.bins(window, []).unwrap();
        let cut = [
            period("2000-01-16", "2000-02-01"),
            period("2000-02-01", "2000-03-01"),
            period("2000-03-01", "2000-03-02"),
        ];
        assert_eq!(months, cut);
        let window = period("1999-12-31", "2001-01-01");
        let years = TimeStep::Year.bins(window, []).unwrap();
        assert_eq!(
            years,
            [
                period("1999-12-31", "2000-01-01"),
                Period::year(2000).unwrap()
            ]
        );
    }

    #[test]
    fn whole_bins_reach_beyond_the_window() {
        let window = period("1999-11-16T06:00:00Z", "2000-02-03");
        let months = TimeStep::Month.whole_bins(window);
        assert_eq!(months.len(), 4);
        assert_eq!(months[0].start, "1999-11-01".parse().unwrap());
        assert_eq!(months[3].end, "2000-03-01".parse().unwrap());
        assert_eq!(TimeStep::Total.whole_bins(window), [window]);
        // A bin that ends in the year 10000 cannot be said.
        let last = period("9998-06-01", "9999-12-31");
        assert_eq!(TimeStep::Year.whole_bins(last).len(), 1);
    }

    #[test]
    fn native_bins_are_the_steps_cut_at_the_window() {
        let steps = [
            period("2000-01-01", "2000-02-01"),
            period("2000-02-01", "2000-03-01"),
            period("2000-04-01", "2000-05-01"),
        ];
        let window = period("2000-02-10", "2000-04-11");
        let bins = TimeStep::Native.bins(window, steps).unwrap();
        assert_eq!(
            bins,
            [
                period("2000-02-10", "2000-03-01"),
                period("2000-04-01", "2000-04-11")
            ]
        );
    }

    #[test]
    fn more_rows_than_anybody_reads_are_refused() {
        let window = period("0001", "9999");
        let refused = TimeStep::Day.bins(window, []).unwrap_err();
        assert!(refused.to_string().contains("longer ones"), "{refused}");
        assert!(TimeStep::Year.bins(window, []).is_ok());
    }
}
