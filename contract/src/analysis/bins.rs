//! Parts of the year that steps are gathered in: months, seasons, days.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::time::{Period, TimeStep};

/// Names of the months.
const MONTHS: [&str; 12] = [
    "January",
    "February",
    "March",
    "April",
    "May",
    "June",
    "July",
    "August",
    "September",
    "October",
    "November",
    "December",
];
/// The seasons of climatologies, that of the year's start first.
const SEASONS: [&str; 4] = [
    "December to February",
    "March to May",
    "June to August",
    "September to November",
];
/// Days of the months of a leap year.
const DAYS: [u32; 12] = [31, 29, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];

/// What part of the year a step belongs to: by the middle of its period.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Default,
    Serialize,
    Deserialize,
    ToSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum CalendarBins {
    /// Twelve calendar months.
    #[default]
    Month,
    /// December to February and so on: four.
    Season,
    /// Calendar days, the 29th of February one of them: 366.
    Day,
}

impl CalendarBins {
    /// All of them, in the order they are offered.
    pub const ALL: [Self; 3] = [Self::Month, Self::Season, Self::Day];

    /// Name on the command line and in addresses.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Month => "month",
            Self::Season => "season",
            Self::Day => "day",
        }
    }

    /// Number of bins in a year.
    pub fn count(self) -> usize {
        match self {
            Self::Month => 12,
            Self::Season => 4,
            Self::Day => 366,
        }
    }

    /// Longest step that may lie in one bin, s: the longest bin with a day to spare, for steps of `30.4` days and the like.
    pub fn longest_step_s(self) -> f64 {
        let step = match self {
            Self::Month => TimeStep::Month,
            Self::Season => TimeStep::Season,
            Self::Day => TimeStep::Day,
        };
        step.longest_step_s().unwrap_or(f64::INFINITY)
    }

    /// The bin that the middle of a period lies in, from 0.
    pub fn of(self, period: Period) -> usize {
        let (month, day) = period.mid().month_day();
        match self {
            Self::Month => month as usize - 1,
            Self::Season => (month as usize % 12) / 3,
            Self::Day => {
                let before: u32 = DAYS.iter().take(month as usize - 1).sum();
                (before + day - 1) as usize
            }
        }
    }

    /// What people call a bin.
    pub fn title(self, bin: usize) -> String {
        match self {
            Self::Month => MONTHS[bin % 12].to_owned(),
            Self::Season => SEASONS[bin % 4].to_owned(),
            Self::Day => {
                let mut day = bin as u32 % 366;
                let mut month = 0;
                while day >= DAYS[month] {
                    day -= DAYS[month];
                    month += 1;
                }
                format!("{} {}", day + 1, MONTHS[month])
            }
        }
    }
}

impl Display for CalendarBins {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for CalendarBins {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let named = Self::ALL.into_iter().find(|bins| bins.as_str() == s);
        named.ok_or_else(|| ContractError::invalid("bins", s, "month, season or day"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn day(text: &str) -> Period {
        let start: crate::time::TimeMs = text.parse().unwrap();
        let end = crate::time::TimeMs::new(start.ms() + 86_400_000).unwrap();
        Period::new(start, end).unwrap()
    }

    #[test]
    fn every_day_of_a_year_has_its_bin_and_its_name() {
        for (text, [month, season, number], title) in [
            ("2001-01-01", [0, 0, 0], "1 January"),
            ("2001-02-28", [1, 0, 58], "28 February"),
            ("2004-02-29", [1, 0, 59], "29 February"),
            ("2001-03-01", [2, 1, 60], "1 March"),
            ("2001-11-30", [10, 3, 334], "30 November"),
            ("2001-12-01", [11, 0, 335], "1 December"),
            ("2001-12-31", [11, 0, 365], "31 December"),
        ] {
            let day = day(text);
            let found = CalendarBins::ALL.map(|bins| bins.of(day));
            assert_eq!(found, [month, season, number], "{text}");
            assert_eq!(CalendarBins::Day.title(number), title);
        }
        assert_eq!(CalendarBins::Season.title(0), "December to February");
        for bins in CalendarBins::ALL {
            assert_eq!(bins.as_str().parse::<CalendarBins>().unwrap(), bins);
        }
        assert!("week".parse::<CalendarBins>().is_err());
    }
}
