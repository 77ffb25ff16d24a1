//! Steps that two series have in common: the periods of both in, values of both beside each other out.

use contract::ContractError;
use contract::analysis::CalendarBins;
use contract::product::ProductId;
use contract::time::{Period, TimeStep};

use super::climatology::{less_their_months_exactly, months_of};
use super::line::{Holes, Line};
use super::timeline::{Bins, bins_over, longest_s, no_shorter};

/// What a series covers.
#[derive(Debug, Clone, Copy)]
pub struct Covered<'a> {
    /// What it is a series of.
    pub product: &'a ProductId,
    /// In the order of time, at least one.
    pub periods: &'a [Period],
}

impl Covered<'_> {
    fn in_words(&self) -> String {
        let (first, last) = (self.periods.first(), self.periods.last());
        let all = first.zip(last).map(|(first, last)| Period {
            start: first.start,
            end: last.end,
        });
        let all = all.map_or_else(|| "nothing".to_owned(), |all| all.to_string());
        format!("{} covers {all}", self.product)
    }
}

/// Steps that two series have in common: found once for all pairs of series over the same steps.
#[derive(Debug)]
pub struct CommonSteps {
    step: TimeStep,
    /// Bins that both cover, at least one. Native steps that one has, or that both lack, stay in their places between those of both;
    /// those of both alone where steps lie on no line.
    periods: Vec<Period>,
    /// All bins of each series.
    bins: [Bins; 2],
    /// Of each series, which of its own bins each period is; none that it lacks.
    own: [Vec<Option<usize>>; 2],
    /// Steps that both lack.
    holes: Holes,
    /// Calendar month of each period, from 0, where the mean of each is taken off.
    months: Option<Vec<usize>>,
}

impl CommonSteps {
    /// Those of two series in means of `step`.
    ///
    /// # Errors
    /// One value for all; steps that are longer than the means; nothing that both cover.
    pub fn of(sides: [Covered<'_>; 2], step: TimeStep) -> Result<Self, ContractError> {
        let refused = |reason: String| ContractError::invalid("step", step.as_str(), reason);
        if step == TimeStep::Total {
            let reason = "one value does not vary: ask for shorter ones";
            return Err(refused(reason.to_owned()));
        }
        for side in &sides {
            if no_shorter(side.periods, step) != step {
                let product = side.product;
                let reason =
                    format!("the steps of {product} are longer: ask for longer ones or native");
                return Err(refused(reason));
            }
        }
        let [a, b] = sides.map(|side| bins_over(side.periods, step));
        let in_both = |bin: &&Period| b.binary_search(bin).is_ok();
        let common: Vec<Period> = a.iter().filter(in_both).copied().collect();
        if common.is_empty() {
            let [a, b] = sides.map(|side| side.in_words());
            return Err(refused(format!("no step is common to both: {a}, {b}")));
        }
        let periods = match step {
            TimeStep::Native => on_line(&a, &b, common),
            _ => common,
        };
        let bins = sides.map(|side| Bins::over(side.periods, step));
        let own = bins.each_ref().map(|bins| {
            let place = |period: &Period| bins.periods().binary_search(period).ok();
            periods.iter().map(place).collect()
        });
        Ok(Self {
            step,
            holes: Holes::between(&periods),
            periods,
            bins,
            own,
            months: None,
        })
    }

    /// The same with the mean of each calendar month taken off both.
    ///
    /// # Errors
    /// Steps that are longer than months.
    pub fn without_seasons(self) -> Result<Self, ContractError> {
        if longest_s(&self.periods) > CalendarBins::Month.longest_step_s() {
            let reason = "seasons can be taken off steps of months or shorter ones";
            return Err(ContractError::invalid("step", self.step.as_str(), reason));
        }
        Ok(Self {
            months: Some(months_of(&self.periods)),
            ..self
        })
    }

    /// Can one series be moved so many steps against the other?
    ///
    /// # Errors
    /// Some, where the steps lie on no line.
    pub fn check_lag(&self, most: u32) -> Result<(), ContractError> {
        if most == 0 || matches!(self.holes, Holes::Line(_)) {
            return Ok(());
        }
        let reason = "gaps lie between the steps of both, whose lengths or distances are unequal: ask for lag 0, or for steps of the calendar";
        Err(ContractError::invalid("lag", &most.to_string(), reason))
    }

    /// From the first common step to the last.
    pub fn extent(&self) -> Period {
        let (first, last) = (self.periods[0], self.periods[self.periods.len() - 1]);
        Period {
            start: first.start,
            end: last.end,
        }
    }

    /// Pairs that there would be at a lag if no value were missing.
    pub fn most_pairs(&self, lag_steps: i32) -> usize {
        let steps = match &self.holes {
            Holes::Line(line) => line.steps.len(),
            Holes::Apart(apart) => apart.len(),
        };
        steps.saturating_sub(lag_steps.unsigned_abs() as usize)
    }

    /// Values of both series beside each other, one for each common step in the order of time, NaN where a series lacks it.
    ///
    /// `values` are one for each period of the series, NaN no data, any unit.
    pub fn beside(&self, values: [&[f64]; 2]) -> [Vec<f64>; 2] {
        [0, 1].map(|side| {
            let means = self.bins[side].means(values[side]);
            let own = self.own[side].iter();
            let of_own = own.map(|place| place.map_or(f64::NAN, |place| means[place]));
            let mut common: Vec<f64> = of_own.collect();
            if let Some(months) = &self.months {
                common = less_their_months_exactly(months, &common);
            }
            self.holes.spread(&common)
        })
    }
}

/// All steps from the first of those that two series have in common to the last, of either and of none; `common` where they
/// lie on no line.
fn on_line(a: &[Period], b: &[Period], common: Vec<Period>) -> Vec<Period> {
    let (Some(first), Some(last)) = (common.first(), common.last()) else {
        return common;
    };
    let is_between = |step: &&Period| *first <= **step && **step <= *last;
    let both = a.iter().chain(b).filter(is_between);
    let mut steps: Vec<Period> = both.copied().collect();
    steps.sort_unstable();
    steps.dedup();
    let line = Line::of(&steps).or_else(|| Line::of(&common));
    line.map_or(common, |line| line.steps)
}

#[cfg(test)]
mod tests;
