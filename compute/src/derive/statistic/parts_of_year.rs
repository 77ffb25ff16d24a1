//! Parts of the year that normals are of.

use contract::analysis::{CalendarBins, MapOptions};
use contract::time::{Period, TimeStep};

/// Title of the day that not every year has.
const LEAP_DAY: &str = "29 February";
/// 28 days, s.
const LONGEST_SHORT_FEBRUARY_S: f64 = 28.0 * 86_400.0;

/// What the steps, or the means, that one normal is made of have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PartsOfYear {
    /// The month or the season of their middles.
    Bins(CalendarBins),
    /// Nothing: whole years are all alike.
    Whole,
}

impl PartsOfYear {
    /// Those of what is asked for: means of seasons and of years lie in no smaller part.
    pub(super) fn of(options: &MapOptions) -> Self {
        match options.anomaly_step {
            Some(TimeStep::Season) => Self::Bins(CalendarBins::Season),
            Some(TimeStep::Year) => Self::Whole,
            _ => Self::Bins(options.bins),
        }
    }

    /// How many there are.
    pub(super) fn count(self) -> usize {
        match self {
            Self::Bins(bins) => bins.count(),
            Self::Whole => 1,
        }
    }

    /// Has a year this part? 29 February few have.
    pub(super) fn is_in_year(self, part: usize, year: i32) -> bool {
        match self {
            Self::Bins(CalendarBins::Day) if CalendarBins::Day.title(part) == LEAP_DAY => {
                Period::month(year, 2).is_ok_and(|month| month.seconds() > LONGEST_SHORT_FEBRUARY_S)
            }
            Self::Bins(_) | Self::Whole => true,
        }
    }

    /// That of a period, by its middle.
    pub(super) fn of_period(self, period: Period) -> usize {
        match self {
            Self::Bins(bins) => bins.of(period),
            Self::Whole => 0,
        }
    }
}
