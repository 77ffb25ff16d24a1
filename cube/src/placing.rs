//! Shards of runs that were made of values at hand: sent, and given their places in the time-major copy by one commit for all.

use std::sync::Arc;

use bytes::Bytes;
use icechunk::format::manifest::ChunkPayload;
use icechunk::format::{ChunkIndices, Path};
use icechunk::session::{Session, SessionErrorKind};
use serde_json::Map;
use tokio::sync::RwLock;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::arrays::{self, SERIES, SERIES_OF_BEFORE};
use crate::blocks::RunAxis;
use crate::edit::ATTEMPTS;
use crate::state::State;
use crate::{CubeError, Description, Repository, Step, held_steps, series};

/// A run whose shards are in the store.
pub(crate) struct SentRun {
    pub(crate) run: usize,
    /// How many steps it holds: the first ones in its place.
    pub(crate) steps: usize,
    /// By row and column; none where no cell has data.
    pub(crate) shards: Vec<([u32; 2], Option<ChunkPayload>)>,
}

/// Path of the time-major copy.
pub(crate) fn series_path(description: &Description) -> Result<Path, CubeError> {
    let array = arrays::series(description, 1)?;
    let path = Path::new(array.path().as_str());
    path.map_err(|e| CubeError::library(array.path().as_str(), "naming the series", e))
}

/// Sends a shard of an array; none where no cell has data.
pub(crate) async fn send_shard(
    session: &RwLock<Session>,
    (path, index): (&Path, [u32; 3]),
    content: Option<Bytes>,
) -> Result<Option<ChunkPayload>, CubeError> {
    let failed = |e| CubeError::library(&path.to_string(), "storing a series", e);
    let Some(content) = content else {
        return Ok(None);
    };
    let index = ChunkIndices(index.to_vec());
    let writer = session.read().await.get_chunk_writer(path, &index);
    let payload = writer.map_err(failed)?(content).await;
    payload.map(Some).map_err(failed)
}

/// Removes the time-major copy that a program of before made.
pub(crate) async fn drop_copy_of_before(
    repository: &Repository,
    session: &RwLock<Session>,
) -> Result<(), CubeError> {
    let path = Path::new(&format!("/{SERIES_OF_BEFORE}"));
    let path = path.map_err(|e| repository.failed("placing a series", &e))?;
    match session.write().await.delete_group(path).await {
        Err(e) if !matches!(e.kind, SessionErrorKind::NodeNotFound { .. }) => {
            Err(repository.failed("placing a series", &e))
        }
        _ => Ok(()),
    }
}

/// Gives runs of some steps their places, but those that somebody else has placed meanwhile, or whose steps are others by now.
pub(crate) async fn place(
    repository: &Repository,
    description: &Description,
    (steps, mut sent): (&[Step], Vec<SentRun>),
) -> Result<(), CubeError> {
    let failed = |e: &dyn std::fmt::Display| repository.failed("placing a series", e);
    // Most versions have none, and a state takes as long to read as its cube has steps.
    if sent.is_empty() {
        return Ok(());
    }
    for _attempt in 0..ATTEMPTS {
        let state = State::newest(repository).await?;
        if !state.describes_same_cells(description) {
            return Ok(());
        }
        sent.retain(|own| {
            let name = series::name_of_first(own.steps, own.run, steps);
            let is_same = name == series::name_of_first(own.steps, own.run, &state.steps);
            is_same && name.is_some() && state.runs.held_count(own.run, &state.steps) < own.steps
        });
        if sent.is_empty() {
            return Ok(());
        }
        let mut runs = state.runs.clone();
        for own in &sent {
            if let Some(name) = series::name_of_first(own.steps, own.run, steps) {
                runs = runs.with(own.run, name);
            }
        }
        let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&state.session)));
        let array = arrays::series(description, runs.len())?;
        runs.write(&arrays, (SERIES, Map::new()), array).await?;
        drop_copy_of_before(repository, &state.session).await?;
        let path = series_path(description)?;
        let mut session = state.session.write().await;
        for own in &sent {
            for (shard, payload) in &own.shards {
                let here = ChunkIndices(RunAxis::First.index(*shard, own.run).to_vec());
                let set = session.set_chunk_ref(path.clone(), here, payload.clone());
                set.await.map_err(|e| failed(&e))?;
            }
        }
        match session.commit("runs of the series").execute().await {
            Ok(snapshot) => {
                let snapshots = (state.snapshot.as_str(), &*snapshot.to_string());
                held_steps::committed(&repository.place, snapshots, &state.steps);
                return Ok(());
            }
            Err(e) if matches!(e.kind, SessionErrorKind::Conflict { .. }) => {}
            Err(e) => return Err(failed(&e)),
        }
    }
    Err(CubeError::Contended {
        place: repository.place.clone(),
        attempts: ATTEMPTS,
    })
}
