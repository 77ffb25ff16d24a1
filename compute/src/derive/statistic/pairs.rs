//! Two products in one cell: their values at all steps in, how they go together out, by the functions that series have.

use std::ops::Range;
use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{CorrelationRow, MapCorrelation, MapOptions};
use contract::manifest::Manifest;
use contract::quantity::Display;
use contract::time::{Period, TimeStep};

use crate::analysis::common_steps::{CommonSteps, Covered};
use crate::analysis::correlation::{LEAST_PAIRS, correlation_at};

/// What correlations of all cells have in common.
#[derive(Debug, Clone)]
pub(super) struct Pairs {
    /// Steps of each product that are read.
    pub(super) reads: [Range<usize>; 2],
    pub(super) asked: MapCorrelation,
    step: TimeStep,
    common: Arc<CommonSteps>,
    /// How each is shown: series are of what people read, and so are these.
    shown: [Display; 2],
}

impl Pairs {
    /// Those of some steps of two versions.
    ///
    /// # Errors
    /// A lag beyond 400 steps, or one that leaves fewer than three pairs; steps that have no common ones, or none at equal distances
    /// where there is a lag; seasons of steps longer than months.
    pub(super) fn of(
        sources: [&Manifest; 2],
        reads: [Range<usize>; 2],
        options: &MapOptions,
        asked: &MapCorrelation,
    ) -> Result<Self, ContractError> {
        asked.check()?;
        let periods = [0, 1].map(|side: usize| periods_of(sources[side], &reads[side]));
        let covered = [0, 1].map(|side: usize| Covered {
            product: &sources[side].product,
            periods: &periods[side],
        });
        let mut common = CommonSteps::of(covered, options.step)?;
        let lag_steps = asked.lag_steps;
        common.check_lag(lag_steps.unsigned_abs())?;
        if asked.deseasonalise {
            common = common.without_seasons()?;
        }
        let most = common.most_pairs(lag_steps);
        if most < LEAST_PAIRS {
            let text = format!("{} at lag {lag_steps}", options.statistic);
            let reason = format!(
                "a correlation needs {LEAST_PAIRS} pairs of steps ({}), and {} and {} have {most}: ask for shorter steps, or for a lag nearer to 0",
                options.step, sources[0].product, sources[1].product
            );
            return Err(ContractError::invalid("statistic", &text, reason));
        }
        Ok(Self {
            reads,
            asked: asked.clone(),
            step: options.step,
            common: Arc::new(common),
            shown: sources.map(|source| source.quantity.display()),
        })
    }

    /// From the first common step to the last.
    pub(super) fn extent(&self) -> Period {
        self.common.extent()
    }

    /// Pairs of a cell that lacks nothing.
    pub(super) fn most(&self) -> usize {
        self.common.most_pairs(self.asked.lag_steps)
    }

    /// Do both say the same of the same values?
    pub(super) fn is_same(&self, other: &Self) -> bool {
        (&self.reads, &self.asked, self.step) == (&other.reads, &other.asked, other.step)
    }

    /// How a cell's values of both products go together; `values` are one for each step of the versions, stored unit, NaN no data.
    pub(super) fn row(&self, values: [&[f32]; 2]) -> CorrelationRow {
        let [first, second] = [0, 1].map(|side: usize| {
            let shown = self.shown[side];
            let own = values[side][self.reads[side].clone()].iter();
            own.map(|value| shown.shown(f64::from(*value)))
                .collect::<Vec<f64>>()
        });
        let [first, second] = self.common.beside([&first, &second]);
        correlation_at(&first, &second, self.asked.lag_steps)
    }
}

fn periods_of(source: &Manifest, read: &Range<usize>) -> Vec<Period> {
    let steps = source.steps[read.clone()].iter();
    steps.map(|step| step.period).collect()
}
