//! Parts of the year that normals are of.

use contract::analysis::{CalendarBins, MapOptions};
use contract::time::{Period, TimeStep};

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

    /// That of a period, by its middle.
    pub(super) fn of_period(self, period: Period) -> usize {
        match self {
            Self::Bins(bins) => bins.of(period),
            Self::Whole => 0,
        }
    }
}
