//! A change of a cube: steps are put, each with its values on the way at once, and committed together.
//!
//! Where a step lies in time is decided at the commit. If somebody else committed before, it is decided anew over the state
//! that is there then; the values are in the store already and are not sent again.

use std::collections::BTreeMap;
use std::sync::Arc;

use contract::time::{Period, TimeMs};
use futures::stream::{StreamExt as _, TryStreamExt as _};
use icechunk::format::manifest::ChunkPayload;
use icechunk::format::{ChunkIndices, Path};
use icechunk::session::{Session, SessionError, SessionErrorKind};
use tokio::sync::RwLock;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::frame::{EncodedObject, Encoder};
use crate::plain::{self, OBJECTS_AT_ONCE};
use crate::{CubeError, Repository, Step, axis, cf};

/// How often a commit is laid on top of those of others.
const ATTEMPTS: u32 = 50;

/// A change that is being made.
pub struct Edit<'a> {
    repository: &'a Repository,
    /// Sends chunks; what it knows of the newest state may be old by the time of the commit.
    uploads: Arc<RwLock<Session>>,
    encoder: Arc<Encoder>,
    path: Path,
    /// By the first instants of their periods.
    staged: BTreeMap<TimeMs, Staged>,
}

/// A step whose values are in the store, and which nothing names yet.
struct Staged {
    step: Step,
    /// By row and column of objects; none where no cell has data.
    objects: Vec<([u32; 2], Option<ChunkPayload>)>,
}

/// What a commit came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Committed {
    /// Names the state; [`Repository::tag`] gives it a name for people. None if all that was put was there already.
    pub snapshot: Option<String>,
    /// Steps that the cube has now.
    pub steps: usize,
    /// How often others had committed before it.
    pub rebased: u32,
}

/// Where each step of the next state comes from.
struct Plan {
    steps: Vec<Step>,
    /// For each step of the next state its place in the state before.
    old_places: Vec<Option<usize>>,
    /// Places of steps with staged values.
    staged: Vec<(usize, TimeMs)>,
}

impl<'a> Edit<'a> {
    /// Begins a change: nothing of it is seen before its commit.
    pub async fn begin(repository: &'a Repository) -> Result<Self, CubeError> {
        let variable = cf::variable(repository.description.quantity);
        let path = Path::new(&format!("/{variable}"));
        Ok(Self {
            repository,
            uploads: repository.session().await?,
            encoder: Arc::new(Encoder::new(&repository.description)?),
            path: path.map_err(|e| repository.failed("naming the values", &e))?,
            staged: BTreeMap::new(),
        })
    }

    /// Puts a step, in the place of one of the same period if there is one: `values` `[row, col]`, stored unit, NaN no data.
    /// They are in the store when this returns, and seen by nobody.
    pub async fn put(&mut self, period: Period, values: Arc<[f32]>) -> Result<Step, CubeError> {
        let grid = self.repository.description.grid;
        plain::check_length(&values, grid.cell_count())?;
        let objects: Vec<_> = plain::encoded(&self.encoder, &values)
            .map(|object| self.upload(object))
            .buffer_unordered(OBJECTS_AT_ONCE)
            .try_collect()
            .await?;
        let digested =
            tokio::task::spawn_blocking(move || storage::frames::digest_of(&grid, &values, period));
        let step = Step {
            period,
            values_sha256: digested
                .await
                .map_err(|e| self.repository.failed("naming the values", &e))?,
        };
        self.staged.insert(period.start, Staged { step, objects });
        Ok(step)
    }

    async fn upload(
        &self,
        object: Result<EncodedObject, CubeError>,
    ) -> Result<([u32; 2], Option<ChunkPayload>), CubeError> {
        let EncodedObject { index, content } = object?;
        let Some(content) = content else {
            return Ok((index, None));
        };
        let [row, col] = index;
        let session = self.uploads.read().await;
        // The place in time is not known yet; it is part of the request's label only.
        let writer = session.get_chunk_writer(&self.path, &ChunkIndices(vec![0, row, col]));
        drop(session);
        let failed = |e: SessionError| self.repository.failed("storing a chunk", &e);
        let payload = writer.map_err(failed)?(content).await.map_err(failed)?;
        Ok((index, Some(payload)))
    }

    /// Commits all that was put, whole or not at all.
    ///
    /// # Errors
    /// `Overlap` if a step covers a part of another one's period: nothing is committed then.
    pub async fn commit(self, message: &str) -> Result<Committed, CubeError> {
        for rebased in 0..ATTEMPTS {
            let session = self.repository.session().await?;
            let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&session)));
            let description = &self.repository.description;
            let before = axis::read(&arrays, description, &self.repository.place).await?;
            let plan = Plan::new(&before, &self.staged)?;
            let Some(first) = plan.first_change(&before) else {
                return Ok(Committed {
                    snapshot: None,
                    steps: before.len(),
                    rebased,
                });
            };
            if plan.steps.len() > before.len() {
                plain::write_length(&arrays, description, plan.steps.len()).await?;
            }
            self.place_values(&session, &plan).await?;
            axis::write(&arrays, description, &plan.steps, first).await?;
            let mut session = session.write().await;
            match session.commit(message).execute().await {
                Ok(snapshot) => {
                    return Ok(Committed {
                        snapshot: Some(snapshot.to_string()),
                        steps: plan.steps.len(),
                        rebased,
                    });
                }
                Err(error) if matches!(error.kind, SessionErrorKind::Conflict { .. }) => {
                    tracing::debug!(place = %self.repository.place, rebased, "others committed before");
                }
                Err(error) => return Err(self.repository.failed("committing", &error)),
            }
        }
        Err(CubeError::Contended {
            place: self.repository.place.clone(),
            attempts: ATTEMPTS,
        })
    }

    /// Gives the values their places in time: those that are there move by reference, those that were put are named.
    async fn place_values(&self, session: &RwLock<Session>, plan: &Plan) -> Result<(), CubeError> {
        let failed = |e: SessionError| self.repository.failed("placing values", &e);
        let mut session = session.write().await;
        let mut moved = vec![];
        for (new, old) in plan.moves() {
            for [row, col] in self.encoder.indices() {
                let there = ChunkIndices(vec![old as u32, row, col]);
                let payload = session.get_chunk_ref(&self.path, &there).await;
                let here = ChunkIndices(vec![new as u32, row, col]);
                moved.push((here, payload.map_err(failed)?));
            }
        }
        for (coordinates, payload) in moved {
            let set = session.set_chunk_ref(self.path.clone(), coordinates, payload);
            set.await.map_err(failed)?;
        }
        for (place, start) in &plan.staged {
            for (index, payload) in &self.staged[start].objects {
                let coordinates = ChunkIndices(vec![*place as u32, index[0], index[1]]);
                let set = session.set_chunk_ref(self.path.clone(), coordinates, payload.clone());
                set.await.map_err(failed)?;
            }
        }
        Ok(())
    }
}

impl Plan {
    /// Lays steps over those that are there.
    fn new(before: &[Step], staged: &BTreeMap<TimeMs, Staged>) -> Result<Self, CubeError> {
        let mut all: Vec<(Step, Option<usize>, bool)> = before
            .iter()
            .enumerate()
            .map(|(place, step)| (*step, Some(place), false))
            .collect();
        for staged in staged.values() {
            let step = staged.step;
            match before.binary_search_by_key(&step.period.start, |it| it.period.start) {
                Ok(place) if before[place].period == step.period => {
                    if before[place] != step {
                        all[place] = (step, Some(place), true);
                    }
                }
                _ => all.push((step, None, true)),
            }
        }
        all.sort_by_key(|(step, _, _)| step.period);
        for pair in all.windows(2) {
            let (one, next) = (pair[0].0.period, pair[1].0.period);
            if one.overlaps(next) {
                let is_new = pair[1].2;
                let (step, there) = if is_new { (next, one) } else { (one, next) };
                return Err(CubeError::Overlap { step, there });
            }
        }
        let staged = all
            .iter()
            .enumerate()
            .filter(|(_, (_, _, is_staged))| *is_staged)
            .map(|(place, (step, _, _))| (place, step.period.start))
            .collect();
        Ok(Self {
            old_places: all.iter().map(|(_, old, _)| *old).collect(),
            steps: all.into_iter().map(|(step, _, _)| step).collect(),
            staged,
        })
    }

    /// The first step that differs from the state before; none if nothing does.
    fn first_change(&self, before: &[Step]) -> Option<usize> {
        let differs =
            |(place, step): (usize, &Step)| (before.get(place) != Some(step)).then_some(place);
        self.steps.iter().enumerate().find_map(differs)
    }

    /// Steps that lie elsewhere now: their places, and those before.
    fn moves(&self) -> impl Iterator<Item = (usize, usize)> {
        let places = self.old_places.iter().enumerate();
        places.filter_map(|(new, old)| old.filter(|old| *old != new).map(|old| (new, old)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::digest::Digest;

    fn step(month: u32, values: &str) -> Step {
        Step {
            period: Period::month(2000, month).unwrap(),
            values_sha256: Digest::of(values.as_bytes()),
        }
    }

    fn plan(before: &[Step], put: &[Step]) -> Result<Plan, CubeError> {
        let staged = put.iter().map(|step| {
            let staged = Staged {
                step: *step,
                objects: vec![],
            };
            (step.period.start, staged)
        });
        Plan::new(before, &staged.collect())
    }

    #[test]
    fn steps_are_laid_in_the_order_of_time() {
        let before = [step(1, "a"), step(4, "d")];
        let plan = plan(&before, &[step(6, "f"), step(2, "b"), step(4, "new")]).unwrap();
        assert_eq!(
            plan.steps,
            [step(1, "a"), step(2, "b"), step(4, "new"), step(6, "f")]
        );
        assert_eq!(plan.old_places, [Some(0), None, Some(1), None]);
        assert_eq!(plan.first_change(&before), Some(1));
        assert_eq!(plan.moves().collect::<Vec<_>>(), [(2, 1)]);
        let places: Vec<usize> = plan.staged.iter().map(|(place, _)| *place).collect();
        assert_eq!(places, [1, 2, 3]);
    }

    #[test]
    fn what_is_there_already_is_no_change_and_an_append_moves_nothing() {
        let before = [step(1, "a"), step(2, "b")];
        assert_eq!(
            plan(&before, &[step(2, "b")])
                .unwrap()
                .first_change(&before),
            None
        );
        let appended = plan(&before, &[step(3, "c")]).unwrap();
        assert_eq!(appended.first_change(&before), Some(2));
        assert_eq!(appended.moves().count(), 0);
    }

    #[test]
    fn a_period_that_another_step_covers_in_part_is_refused_with_both() {
        let before = [step(1, "a")];
        let mut half = step(1, "x");
        half.period =
            Period::new("2000-01-16".parse().unwrap(), "2000-02-16".parse().unwrap()).unwrap();
        let Err(CubeError::Overlap { step, there }) = plan(&before, &[half]) else {
            panic!("it was taken");
        };
        assert_eq!((step, there), (half.period, before[0].period));
    }
}
