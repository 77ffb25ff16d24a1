//! The time-major copy of a cube's values: of which runs of steps it is there, and of which steps each was made.
//!
//! A run is named by the digests of its steps. One whose name is not that of the steps in its place is none: readers take
//! the map-major values then, and a change of those steps removes it in the same commit.

use std::ops::Range;
use std::sync::Arc;

use contract::digest::Digest;
use icechunk::format::Path;
use icechunk::session::{Session, SessionErrorKind};
use zarrs::group::GroupBuilder;
use zarrs::storage::{AsyncReadableStorageTraits, AsyncWritableStorageTraits};

use crate::arrays::{self, DIGEST_BYTES, DIGEST_CHUNK, SERIES};
use crate::error::first_lines;
use crate::layout::RUN_STEPS;
use crate::{CubeError, Description, Step, axis};

/// Runs from the first step on: of which steps each was made, none where it is not there.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Runs(Vec<Option<Digest>>);

impl Runs {
    /// What a state of a cube has; nothing where it was never compacted.
    pub(crate) async fn read<S>(
        session: &Session,
        arrays: &Arc<S>,
        place: &str,
    ) -> Result<Self, CubeError>
    where
        S: AsyncReadableStorageTraits + 'static,
    {
        let path = Path::new(&format!("/{SERIES}"));
        let path = path.map_err(|e| CubeError::library(place, "naming the series", e))?;
        match session.get_node(&path).await {
            Ok(_group) => {}
            Err(e) if matches!(e.kind, SessionErrorKind::NodeNotFound { .. }) => {
                return Ok(Self::default());
            }
            Err(e) => return Err(CubeError::library(place, "looking for the series", e)),
        }
        let array = axis::open(arrays, &arrays::runs(1)?, place).await?;
        let runs = array.shape()[0];
        let chunk_bytes = (DIGEST_CHUNK * DIGEST_BYTES) as usize;
        let mut bytes: Vec<u8> = vec![];
        for chunk in 0..runs.div_ceil(DIGEST_CHUNK) {
            let index = [chunk, 0];
            let found = array.async_retrieve_chunk_if_exists::<Vec<u8>>(&index);
            let found = found.await.map_err(|e| CubeError::Chunk {
                array: arrays::name(&array),
                chunk: index.to_vec(),
                reason: first_lines(&e),
            })?;
            // One of which no run is there is not stored.
            bytes.extend(found.unwrap_or_else(|| vec![0; chunk_bytes]));
        }
        bytes.truncate((runs * DIGEST_BYTES) as usize);
        let digest = |bytes: &[u8]| {
            let bytes: [u8; DIGEST_BYTES as usize] = bytes.try_into().unwrap_or_default();
            bytes
                .iter()
                .any(|byte| *byte != 0)
                .then(|| Digest::from_bytes(bytes))
        };
        let chunks = bytes.chunks_exact(DIGEST_BYTES as usize);
        Ok(Self(chunks.map(digest).collect()))
    }

    /// How many there are, those that are not there among them.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// Those that are there, and what each was made of.
    pub(crate) fn made_of(&self) -> impl Iterator<Item = (usize, Digest)> {
        let names = self.0.iter().enumerate();
        names.filter_map(|(run, name)| name.map(|name| (run, name)))
    }

    /// Is a run there, and made of the steps that are in its place?
    pub(crate) fn is_of(&self, run: usize, steps: &[Step]) -> bool {
        let own = self.0.get(run).copied().flatten();
        own.is_some() && own == name_of(run, steps)
    }

    /// The first complete run of these steps that is not there.
    pub(crate) fn first_missing(&self, steps: &[Step]) -> Option<usize> {
        (0..steps.len() / RUN_STEPS).find(|run| !self.is_of(*run, steps))
    }

    /// Those that are still there when the steps are these, and the ones that are not any more.
    pub(crate) fn kept(&self, steps: &[Step]) -> (Self, Vec<usize>) {
        let mut kept = self.clone();
        let is_gone = |run: &usize| self.0[*run].is_some() && !self.is_of(*run, steps);
        let gone: Vec<usize> = (0..self.len()).filter(is_gone).collect();
        for run in &gone {
            kept.0[*run] = None;
        }
        kept.0.truncate(steps.len() / RUN_STEPS);
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

    /// Writes the group, its arrays and which runs there are.
    pub(crate) async fn write<S>(
        &self,
        store: &Arc<S>,
        description: &Description,
    ) -> Result<(), CubeError>
    where
        S: AsyncWritableStorageTraits + 'static,
    {
        let failed = |e: String| CubeError::library(SERIES, "writing", e);
        let group = GroupBuilder::new().build(Arc::clone(store), &format!("/{SERIES}"));
        let group = group.map_err(|e| failed(e.to_string()))?;
        let stored = group.async_store_metadata().await;
        stored.map_err(|e| failed(e.to_string()))?;
        let series = arrays::series(description, self.len())?;
        let series = series.with_storage(Arc::clone(store));
        let stored = series.async_store_metadata().await;
        stored.map_err(|e| failed(e.to_string()))?;
        let array = arrays::runs(self.len())?.with_storage(Arc::clone(store));
        let stored = array.async_store_metadata().await;
        stored.map_err(|e| failed(e.to_string()))?;
        for (chunk, names) in self.0.chunks(DIGEST_CHUNK as usize).enumerate() {
            let bytes = names.iter().flat_map(|name| match name {
                Some(name) => *name.as_bytes(),
                None => [0; DIGEST_BYTES as usize],
            });
            let mut bytes: Vec<u8> = bytes.collect();
            bytes.resize((DIGEST_CHUNK * DIGEST_BYTES) as usize, 0);
            let stored = array.async_store_chunk(&[chunk as u64, 0], bytes).await;
            stored.map_err(|e| failed(e.to_string()))?;
        }
        Ok(())
    }
}

/// Steps of a run.
pub(crate) fn steps_of(run: usize) -> Range<usize> {
    run * RUN_STEPS..(run + 1) * RUN_STEPS
}

/// The name of a run of these steps; none if it is not complete.
pub(crate) fn name_of(run: usize, steps: &[Step]) -> Option<Digest> {
    let own = steps.get(steps_of(run))?;
    let digests = own.iter().flat_map(|step| *step.values_sha256.as_bytes());
    Some(Digest::of(&digests.collect::<Vec<u8>>()))
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
        assert_eq!(runs.first_missing(&own), None);
        assert_eq!(name_of(3, &own), None, "it is not complete");
        own[RUN_STEPS].values_sha256 = Digest::of(b"revised");
        assert_eq!(runs.first_missing(&own), Some(1));
        let (kept, gone) = runs.kept(&own);
        assert_eq!(gone, [1]);
        assert!(kept.is_of(0, &own) && !kept.is_of(1, &own) && kept.is_of(2, &own));
        let (kept, gone) = runs.kept(&own[..=RUN_STEPS]);
        assert_eq!((kept.len(), gone), (1, vec![1, 2]));
    }
}
