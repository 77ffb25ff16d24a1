//! Why a statistic of a series cannot be said.

/// A statistic that is not defined for what it was asked of.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Undefined {
    /// No step has data.
    #[error("no step holds data")]
    NoData,
    /// Too few steps have data.
    #[error("{what} needs {needed} values, and there are {found}")]
    TooFew {
        /// The statistic.
        what: &'static str,
        /// How many it needs.
        needed: usize,
        /// How many there are.
        found: usize,
    },
    /// The values lie too close in time.
    #[error("{what} needs {needed_years} years of values, and they span {found_years:.1}")]
    TooShort {
        /// The statistic.
        what: &'static str,
        /// How many years it needs.
        needed_years: f64,
        /// From the first to the last value.
        found_years: f64,
    },
    /// Every value is the same.
    #[error("all {count} values are equal: {what} is not defined")]
    Constant {
        /// The statistic.
        what: &'static str,
        /// Number of values.
        count: usize,
    },
    /// One of two series is the same at every step that both have.
    #[error("all {count} values of {side} are equal: a correlation is not defined")]
    ConstantSide {
        /// Which of the two.
        side: &'static str,
        /// Pairs of values.
        count: usize,
    },
    /// A step covers more than a part of the year.
    #[error("steps of {step_days:.0} days have no {bin}: {what} needs shorter ones")]
    StepTooLong {
        /// The statistic.
        what: &'static str,
        /// Length of the longest step.
        step_days: f64,
        /// Part of the year.
        bin: &'static str,
    },
    /// The base period has no data.
    #[error("no step with data lies in {base}; the series covers {covered}")]
    NothingInBase {
        /// Base period.
        base: String,
        /// Years of the series.
        covered: String,
    },
    /// Steps lie so that more than one answer fits them.
    #[error("{what} cannot be told from these steps: they lie in too few parts of the year")]
    Undetermined {
        /// The statistic.
        what: &'static str,
    },
    /// More values than are compared pair by pair.
    #[error(
        "{what} of {found} values compares too many pairs; of at most {most} it can be asked: ask for months or years"
    )]
    TooMany {
        /// The statistic.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        most: usize,
    },
}
