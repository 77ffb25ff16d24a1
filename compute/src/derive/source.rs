//! The steps that carbon is accumulated over, and the hash of everything that each accumulated step is made of.

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::time::{Period, TimeMs};
use serde::Serialize;

use crate::ComputeError;

/// Version of the way carbon is accumulated: it changes when its bits do, or what is kept beside them.
///
/// 2: the steps and the time that each sum holds.
const METHOD: u32 = 2;

/// A step of the source and the part of it after the start.
#[derive(Debug, Clone, Copy)]
pub(super) struct SourceStep<'a> {
    pub(super) step: &'a Step,
    /// From the start on; the whole period except perhaps in the first step.
    pub(super) period: Period,
    /// Hash of this step's and all earlier steps' fields and periods: equal hashes, equal accumulated values.
    pub(super) made_of: Digest,
}

/// What an accumulated step depends on.
#[derive(Serialize)]
struct MadeOf<'a> {
    kind: &'static str,
    method: u32,
    before: Option<Digest>,
    period: Period,
    #[serde(rename = "frame")]
    field: &'a ObjectKey,
}

/// The steps that end after the start, the first cut at it.
pub(super) fn steps_since(
    source: &Manifest,
    start: Option<TimeMs>,
) -> Result<Vec<SourceStep<'_>>, ComputeError> {
    let (_window, inside) = source.steps_inside(start, None)?;
    let mut steps: Vec<SourceStep<'_>> = vec![];
    for step in inside {
        let from = start.map_or(step.period.start, |start| start.max(step.period.start));
        let period = Period::new(from, step.period.end)?;
        let made_of = Digest::of_json(&MadeOf {
            kind: "accumulated",
            method: METHOD,
            before: steps.last().map(|step| step.made_of),
            period,
            field: &step.field,
        });
        steps.push(SourceStep {
            step,
            period,
            made_of,
        });
    }
    Ok(steps)
}
