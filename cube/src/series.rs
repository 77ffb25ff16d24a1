//! The time-major copy of a cube's values: of which runs of steps it is there, and of which steps each was made.
//!
//! A run is named by the digests of its steps. One whose name is not that of the steps in its place is none: readers take
//! the map-major values then, and a change of those steps removes it in the same commit.

use std::ops::Range;
use std::sync::Arc;

use contract::digest::Digest;
use icechunk::format::Path;
use icechunk::session::{Session, SessionErrorKind};
use serde_json::{Map, Value};
use zarrs::storage::{AsyncReadableStorageTraits, AsyncWritableStorageTraits};

use crate::arrays::{self, Definition};
use crate::layout::RUN_STEPS;
use crate::{CubeError, Step, group, names};

/// So many steps more are worth making the last run anew.
pub(crate) const LEAST_NEW: usize = 16;

/// Runs from the first step on: of which steps each was made, none where it is not there.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Runs(Vec<Option<Digest>>);

impl Runs {
    /// What a state of a cube has in a group; nothing where it was never compacted.
    pub(crate) async fn read<S>(
        session: &Session,
        arrays: &Arc<S>,
        group: &str,
        place: &str,
    ) -> Result<Self, CubeError>
    where
        S: AsyncReadableStorageTraits + 'static,
    {
        let path = Path::new(&format!("/{group}"));
        let path = path.map_err(|e| CubeError::library(place, "naming the series", e))?;
        match session.get_node(&path).await {
            Ok(_group) => {}
            Err(e) if matches!(e.kind, SessionErrorKind::NodeNotFound { .. }) => {
                return Ok(Self::default());
            }
            Err(e) => return Err(CubeError::library(place, "looking for the series", e)),
        }
        names::read(arrays, &arrays::runs(group, 1)?, place, &|_chunk| None)
            .await
            .map(Self)
    }

    /// How many there are, those that are not there among them.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// Of which steps one was made; none where it is not there.
    pub(crate) fn name(&self, run: usize) -> Option<Digest> {
        self.0.get(run).copied().flatten()
    }

    /// Those that are there, and what each was made of.
    pub(crate) fn made_of(&self) -> impl Iterator<Item = (usize, Digest)> {
        let names = self.0.iter().enumerate();
        names.filter_map(|(run, name)| name.map(|name| (run, name)))
    }

    /// How many of the steps in its place a run holds, the first ones: all of them, those that there were when it was made,
    /// or none since they are others by now.
    pub(crate) fn held_count(&self, run: usize, steps: &[Step]) -> usize {
        let Some(name) = self.name(run) else {
            return 0;
        };
        let all = steps_of(run, steps).len();
        let is_named = |count: &usize| name_of_first(*count, run, steps) == Some(name);
        (1..=all).rev().find(is_named).unwrap_or(0)
    }

    /// Does a run hold all steps that are in its place?
    pub(crate) fn is_of(&self, run: usize, steps: &[Step]) -> bool {
        let own = self.name(run);
        own.is_some() && own == name_of(run, steps)
    }

    /// Runs of these steps that are to be made, ascending: complete ones that are not there, and the last one where it lacks many.
    /// What is made anew with every [`LEAST_NEW`] steps at first, and later with half as many again, is written less than four times in all.
    pub(crate) fn missing(&self, steps: &[Step]) -> impl Iterator<Item = usize> {
        let complete = steps.len() / RUN_STEPS;
        let missing = (0..complete).filter(move |run| !self.is_of(*run, steps));
        let held = self.held_count(complete, steps);
        let new = steps.len() % RUN_STEPS - held;
        missing.chain((new >= LEAST_NEW.max(held / 2)).then_some(complete))
    }

    /// The first of them.
    pub(crate) fn first_missing(&self, steps: &[Step]) -> Option<usize> {
        self.missing(steps).next()
    }

    /// Those that are still there when the steps are these, and the ones that are not any more.
    pub(crate) fn kept(&self, steps: &[Step]) -> (Self, Vec<usize>) {
        let mut kept = self.clone();
        let is_gone = |run: &usize| self.0[*run].is_some() && self.held_count(*run, steps) == 0;
        let gone: Vec<usize> = (0..self.len()).filter(is_gone).collect();
        for run in &gone {
            kept.0[*run] = None;
        }
        kept.0.truncate(steps.len().div_ceil(RUN_STEPS));
        (kept, gone)
    }

    /// The same with one that was made.
    pub(crate) fn with(mut self, run: usize, name: Digest) -> Self {
        if self.0.len() <= run {
            self.0.resize(run + 1, None);
        }
        self.0[run] = Some(name);
        self
    }

    /// Writes a group with its attributes, the array that runs are in, and which there are.
    pub(crate) async fn write<S>(
        &self,
        store: &Arc<S>,
        (name, attributes): (&str, Map<String, Value>),
        array: Definition,
    ) -> Result<(), CubeError>
    where
        S: AsyncWritableStorageTraits + 'static,
    {
        group::write_group(store, name, attributes).await?;
        let array = array.with_storage(Arc::clone(store));
        let stored = array.async_store_metadata().await;
        stored.map_err(|e| CubeError::library(name, "writing", e))?;
        let own = arrays::runs(name, self.len())?;
        names::write(store, own, (&self.0, 0), &|_chunk| false).await
    }
}

/// Steps in the place of a run.
pub(crate) fn steps_of(run: usize, steps: &[Step]) -> Range<usize> {
    let end = |run: usize| (run * RUN_STEPS).min(steps.len());
    end(run)..end(run + 1)
}

/// The name of a run of all these steps that are in its place; none if there are none.
pub(crate) fn name_of(run: usize, steps: &[Step]) -> Option<Digest> {
    name_of_first(steps_of(run, steps).len(), run, steps)
}

/// The name of a run of the first ones of the steps in its place; none if they are fewer, or none.
pub(crate) fn name_of_first(count: usize, run: usize, steps: &[Step]) -> Option<Digest> {
    let own = steps[steps_of(run, steps)].get(..count)?;
    let digests = own.iter().flat_map(|step| *step.values_sha256.as_bytes());
    (count > 0).then(|| Digest::of(&digests.collect::<Vec<u8>>()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::time::{Period, TimeMs};

    fn steps(count: usize) -> Vec<Step> {
        let day = |day: i64| TimeMs::new(day * 86_400_000).unwrap();
        let step = |at: usize| Step {
            period: Period::new(day(at as i64), day(at as i64 + 1)).unwrap(),
            values_sha256: Digest::of(&at.to_le_bytes()),
        };
        (0..count).map(step).collect()
    }

    #[test]
    fn a_run_is_there_while_its_steps_are_those_that_it_was_made_of() {
        let mut own = steps(3 * RUN_STEPS + 5);
        let mut runs = Runs::default();
        for run in 0..3 {
            assert_eq!(runs.first_missing(&own), Some(run));
            runs = runs.with(run, name_of(run, &own).unwrap());
        }
        assert_eq!(runs.first_missing(&own), None, "five more are too few");
        assert_eq!(name_of(4, &own), None, "it has no step");
        own[RUN_STEPS].values_sha256 = Digest::of(b"revised");
        assert_eq!(runs.first_missing(&own), Some(1));
        let (kept, gone) = runs.kept(&own);
        assert_eq!(gone, [1]);
        assert!(kept.is_of(0, &own) && !kept.is_of(1, &own) && kept.is_of(2, &own));
        let (kept, gone) = runs.kept(&own[..RUN_STEPS]);
        assert_eq!((kept.len(), gone), (1, vec![1, 2]));
    }

    #[test]
    fn the_last_run_holds_what_there_was_and_is_made_anew_when_much_has_come() {
        let mut own = steps(2 * RUN_STEPS);
        let mut runs = Runs::default();
        let mut made = vec![];
        for count in 1..=own.len() {
            if let Some(run) = runs.first_missing(&own[..count]) {
                runs = runs.with(run, name_of(run, &own[..count]).unwrap());
                made.push(count);
            }
            let held = (0..2).map(|run| runs.held_count(run, &own[..count]));
            let held: usize = held.sum();
            assert!(
                count - held < LEAST_NEW.max(RUN_STEPS / 3),
                "{count} {held}"
            );
        }
        assert_eq!(
            made,
            [16, 32, 48, 72, 108, 128, 144, 160, 176, 200, 236, 256]
        );
        let at_200 = Runs::default().with(1, name_of(1, &own[..200]).unwrap());
        assert_eq!(at_200.held_count(1, &own), 72);
        assert_eq!(at_200.held_count(1, &own[..199]), 0, "a step is gone");
        assert!(at_200.kept(&own).1.is_empty());
        own[150].values_sha256 = Digest::of(b"revised");
        assert_eq!(at_200.held_count(1, &own), 0);
        assert_eq!(at_200.kept(&own).1, [1]);
    }
}
