//! One commit: a plan laid over the state that is there, unless others changed that meanwhile.

use std::collections::BTreeMap;
use std::sync::Arc;

use icechunk::format::manifest::ChunkPayload;
use icechunk::format::{ChunkIndices, Path};
use icechunk::session::{SessionError, SessionErrorKind};
use serde_json::{Map, Value};
use zarrs_icechunk::AsyncIcechunkStore;

use crate::arrays::{SERIES, STEP_START};
use crate::blocks::RunAxis;
use crate::field::SeriesEncoder;
use crate::levels::{self, Levels, MadeOf};
use crate::parts::{Parts, Track};
use crate::plan::Plan;
use crate::staged::AllStaged;
use crate::state::State;
use crate::{CubeError, Description, Repository, Step, arrays, axis, cf, group, plain};

/// Where a chunk comes to lie in an array, and what it refers to; none where no cell has data.
type Placed = (Path, ChunkIndices, Option<ChunkPayload>);

pub(crate) struct Layer<'a> {
    pub(crate) repository: &'a Repository,
    /// What the cube is of afterwards.
    pub(crate) description: &'a Description,
    /// Arrays that steps have chunks in.
    pub(crate) parts: &'a Parts,
    pub(crate) state: &'a State,
    pub(crate) plan: &'a Plan,
    pub(crate) staged: &'a AllStaged,
    /// Is the new state made beside the newest one, which stays what it is?
    pub(crate) is_beside: bool,
}

impl Layer<'_> {
    /// The snapshot that was made; none if others committed before.
    pub(crate) async fn commit(&self, message: &str) -> Result<Option<String>, CubeError> {
        let Self {
            description,
            state,
            plan,
            ..
        } = self;
        let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&state.session)));
        let is_anew = !state.describes_same_cells(description);
        let (before, placed) = if is_anew {
            self.clear().await?;
            plain::write_frame_of_reference(&arrays, description).await?;
            (0, vec![])
        } else {
            (state.steps.len(), self.moved().await?)
        };
        if !is_anew && state.description.as_ref() != Some(description) {
            group::write_group(&arrays, "", levels::with_levels(description)).await?;
        }
        if plan.steps.len() < before {
            self.cut_off().await?;
        }
        if plan.steps.len() != before || self.tells_values_anew() {
            plain::write_length(&arrays, description, plan.steps.len()).await?;
        }
        let none = Levels::default();
        let levels = if is_anew { &none } else { &state.levels };
        if self.parts.has_levels() {
            let count = plan.steps.len();
            levels
                .make_room(&state.session, &arrays, description, count)
                .await?;
        }
        self.place(placed).await?;
        if !is_anew {
            self.drop_runs(&arrays).await?;
        }
        let compared = if is_anew { &[] } else { &state.steps[..] };
        let was_sum = !is_anew && self.drop_step_start().await?;
        let first = was_sum.then_some(0).or(plan.first_change(compared));
        if let Some(first) = first {
            axis::write(&arrays, description, &plan.steps, first).await?;
        }
        if self.parts.has_levels() {
            let (made_of, first) = (self.made_of(levels), first.unwrap_or(plan.steps.len()));
            let after = (&made_of[..], &plan.steps[..], first);
            // Boxed: what it awaits would make every future large that awaits a commit.
            let written = levels.write(&state.session, &arrays, description, after);
            Box::pin(written).await?;
        }
        let mut session = state.session.write().await;
        let properties = description.version.as_ref().map(|version| {
            BTreeMap::from([("version".to_owned(), Value::from(version.to_string()))])
        });
        let mut commit = session
            .commit(message)
            .properties(properties.unwrap_or_default());
        if self.is_beside {
            commit = commit.anonymous();
        }
        match commit.execute().await {
            Ok(snapshot) => Ok(Some(snapshot.to_string())),
            Err(error) if matches!(error.kind, SessionErrorKind::Conflict { .. }) => {
                tracing::debug!(place = %self.repository.place, "others committed before");
                Ok(None)
            }
            Err(error) => Err(self.repository.failed("committing", &error)),
        }
    }

    /// Is something else said of values than in the state that is there: of what codes mean, or by which name others know them?
    fn tells_values_anew(&self) -> bool {
        let said = |description: &Description| {
            let attributes = cf::of_values(description);
            let name = attributes.get("standard_name").cloned();
            (description.quantity.flags(), name)
        };
        let before = self.state.description.as_ref();
        before.is_some_and(|before| said(before) != said(self.description))
    }

    /// Removes all that is there: cells of another grid or quantity have no place in what comes.
    async fn clear(&self) -> Result<(), CubeError> {
        let mut session = self.state.session.write().await;
        let cleared = session.clear().await;
        cleared.map_err(|e| self.failed(&e))
    }

    /// Removes the starts of steps where a statistic of sums was written as a sum: its times are to be written anew then.
    async fn drop_step_start(&self) -> Result<bool, CubeError> {
        if !self.state.has_step_start || self.description.is_sum() {
            return Ok(false);
        }
        let path = Path::new(&format!("/{STEP_START}"));
        let path = path.map_err(|e| self.repository.failed("placing values", &e))?;
        let mut session = self.state.session.write().await;
        let dropped = session.delete_array(path).await;
        dropped.map_err(|e| self.failed(&e))?;
        Ok(true)
    }

    /// Steps that are there and come to lie elsewhere: by reference.
    async fn moved(&self) -> Result<Vec<Placed>, CubeError> {
        let session = self.state.session.read().await;
        let mut moved = vec![];
        for Track { path, indices } in self.tracks_there()? {
            for (new, old) in self.plan.moves() {
                for [row, col] in &indices {
                    let there = ChunkIndices(vec![old as u32, *row, *col]);
                    let payload = session.get_chunk_ref(&path, &there).await;
                    let here = ChunkIndices(vec![new as u32, *row, *col]);
                    let payload = payload.map_err(|e| self.failed(&e))?;
                    moved.push((path.clone(), here, payload));
                }
            }
        }
        Ok(moved)
    }

    /// Arrays that the state has: that of values, and those of levels where it has them.
    fn tracks_there(&self) -> Result<Vec<Track>, CubeError> {
        let mut tracks = self.parts.tracks()?;
        if !self.state.levels.is_there {
            tracks.truncate(1);
        }
        Ok(tracks)
    }

    /// Of each step to come what its levels are made of; none of one that has none.
    fn made_of(&self, before: &Levels) -> Vec<Option<MadeOf>> {
        let plan = self.plan;
        let moved = plan.old_places.iter().zip(&plan.steps);
        let kept = |(old, step): (&Option<usize>, &Step)| old.and_then(|old| before.of(old, step));
        let mut made_of: Vec<Option<MadeOf>> = moved.map(kept).collect();
        for (place, start) in &plan.staged {
            made_of[*place] = Some(MadeOf {
                values_sha256: plan.steps[*place].values_sha256,
                range: self.staged[start].sent.range,
            });
        }
        made_of
    }

    /// Removes the references of what lies behind the last step to come.
    async fn cut_off(&self) -> Result<(), CubeError> {
        let (before, after) = (self.state.steps.len(), self.plan.steps.len());
        if self.state.levels.is_there {
            let (levels, session) = (&self.state.levels, &self.state.session);
            let counts = (before, after);
            levels.cut_off(session, self.description, counts).await?;
        }
        let mut session = self.state.session.write().await;
        for Track { path, indices } in self.tracks_there()? {
            let mut behind = vec![];
            for place in after..before {
                for [row, col] in &indices {
                    behind.push(ChunkIndices(vec![place as u32, *row, *col]));
                }
            }
            let cut = session.delete_chunks(&path, behind).await;
            cut.map_err(|e| self.failed(&e))?;
        }
        let axis = arrays::axis(self.description.is_sum(), before as u64)?;
        for array in axis.arrays() {
            let steps = axis::chunk_steps(array)?;
            let path = Path::new(array.path().as_str());
            let path = path.map_err(|e| self.repository.failed("placing values", &e))?;
            let mut behind = vec![];
            for chunk in after.div_ceil(steps)..before.div_ceil(steps) {
                let mut index = vec![0; array.dimensionality()];
                index[0] = chunk as u32;
                behind.push(ChunkIndices(index));
            }
            let cut = session.delete_chunks(&path, behind).await;
            cut.map_err(|e| self.failed(&e))?;
        }
        Ok(())
    }

    /// Removes the runs of the time-major copy that are of other steps than come to lie in their places, and sums of them.
    async fn drop_runs(&self, arrays: &Arc<AsyncIcechunkStore>) -> Result<(), CubeError> {
        let (description, state) = (self.description, self.state);
        let (kept, gone) = state.runs.kept(&self.plan.steps);
        if !gone.is_empty() || kept != state.runs {
            let array = arrays::series(description, state.runs.len())?;
            let array = (array.path().as_str(), RunAxis::First);
            self.delete(array, &gone).await?;
            let array = arrays::series(description, kept.len())?;
            kept.write(arrays, (SERIES, Map::new()), array).await?;
        }
        let Some(basis) = &state.sums.basis else {
            return Ok(());
        };
        let (kept, gone) = state.sums.runs.kept(&self.plan.steps);
        if !gone.is_empty() || kept != state.sums.runs {
            let array = arrays::sums(description, state.sums.runs.len())?;
            let array = (array.path().as_str(), RunAxis::Last);
            self.delete(array, &gone).await?;
            let (sums, session) = (&state.sums, &state.session);
            let own = (&**basis, &kept);
            sums.write(session, arrays, description, own).await?;
        }
        Ok(())
    }

    /// Removes all shards of some runs of an array.
    async fn delete(
        &self,
        (array, axis): (&str, RunAxis),
        runs: &[usize],
    ) -> Result<(), CubeError> {
        let path = Path::new(array);
        let path = path.map_err(|e| self.repository.failed("placing values", &e))?;
        let shards = SeriesEncoder::new(self.description)?.shards();
        let place =
            |run: usize| move |shard: &[u32; 2]| ChunkIndices(axis.index(*shard, run).to_vec());
        let behind = runs.iter().flat_map(|run| shards.iter().map(place(*run)));
        let mut session = self.state.session.write().await;
        let cut = session.delete_chunks(&path, behind.collect::<Vec<_>>());
        cut.await.map_err(|e| self.failed(&e))?;
        Ok(())
    }

    /// Gives the values their places in time: those that are there move by reference, those that were put are named.
    async fn place(&self, moved: Vec<Placed>) -> Result<(), CubeError> {
        let mut placed = moved;
        let tracks = self.parts.tracks()?;
        for (place, start) in &self.plan.staged {
            for (Track { path, .. }, objects) in tracks.iter().zip(&self.staged[start].sent.objects)
            {
                for ([row, col], payload) in objects {
                    let here = ChunkIndices(vec![*place as u32, *row, *col]);
                    placed.push((path.clone(), here, payload.clone()));
                }
            }
        }
        let mut session = self.state.session.write().await;
        for (path, here, payload) in placed {
            let set = session.set_chunk_ref(path, here, payload);
            set.await.map_err(|e| self.failed(&e))?;
        }
        Ok(())
    }

    fn failed(&self, error: &SessionError) -> CubeError {
        self.repository.failed("placing values", error)
    }
}
