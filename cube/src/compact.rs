//! The cube of a product in, its runs of steps time-major out: what is there map-major is turned, run by run.
//!
//! Nothing waits for it, and it may be killed at any point: what was sent and not committed is removed by clean-up, and
//! whoever publishes next goes on. Two that do the same at once send the same values, and the second finds them there.
//! Values of one shard are held at a time: 128 MiB at most, and what is read and written of it.

use std::sync::Arc;

use contract::chunk::Window;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use icechunk::format::manifest::ChunkPayload;
use icechunk::format::{ChunkIndices, Path};
use icechunk::session::SessionErrorKind;
use storage::Store;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::edit::ATTEMPTS;
use crate::field::SeriesEncoder;
use crate::layout::RUN_STEPS;
use crate::series::{self, Runs};
use crate::state::State;
use crate::{At, Cube, CubeError, Repository};

/// Steps whose windows are read before they are turned: 16 values side by side fill a line of a processor's cache.
const STEPS_AT_ONCE: usize = 16;

/// A shard that is in the store, by its row and column; none where no cell has data.
type Shard = ([u32; 2], Option<ChunkPayload>);

/// Makes the runs of the cube in a folder of a store that are not there yet, the last one if it lacks many steps; how many that were.
///
/// # Errors
/// `Missing` if there is no cube. A chunk that is damaged or gone: no run is made of it.
pub async fn compact(store: &Store, folder: &str) -> Result<usize, CubeError> {
    let repository = Repository::open(store, folder).await?;
    let mut made = 0;
    loop {
        let cube = repository.at(&At::Newest).await?;
        let Some(run) = cube.runs().first_missing(cube.steps()) else {
            return Ok(made);
        };
        let shards = Compaction {
            repository: &repository,
            cube: &cube,
            encoder: Arc::new(SeriesEncoder::new(cube.description())?),
            path: path(&repository, &cube)?,
        };
        let shards = shards.run(run).await?;
        made += usize::from(place(&repository, &cube, run, &shards).await?);
    }
}

/// Path of the time-major array of a cube.
fn path(repository: &Repository, cube: &Cube) -> Result<Path, CubeError> {
    let name = crate::arrays::series(cube.description(), 1)?;
    let path = Path::new(name.path().as_str());
    path.map_err(|e| repository.failed("naming the series", &e))
}

struct Compaction<'a> {
    repository: &'a Repository,
    cube: &'a Cube,
    encoder: Arc<SeriesEncoder>,
    path: Path,
}

impl Compaction<'_> {
    /// Sends all shards of a run, one after the other.
    async fn run(&self, run: usize) -> Result<Vec<Shard>, CubeError> {
        let session = self.repository.session().await?;
        let failed = |e: &dyn std::fmt::Display| self.repository.failed("storing a series", e);
        let held = series::steps_of(run, self.cube.steps()).len();
        let mut shards = vec![];
        for shard in self.encoder.shards() {
            let values = turned(self.cube, &self.encoder, (run, held), shard).await?;
            let encoder = Arc::clone(&self.encoder);
            let encoded = tokio::task::spawn_blocking(move || encoder.encode(values));
            let Some(content) = encoded.await.map_err(|e| thread(&e))?? else {
                shards.push((shard, None));
                continue;
            };
            let index = ChunkIndices(vec![shard[0], shard[1], run as u32]);
            let writer = session.read().await.get_chunk_writer(&self.path, &index);
            let payload = writer.map_err(|e| failed(&e))?(content).await;
            shards.push((shard, Some(payload.map_err(|e| failed(&e))?)));
        }
        Ok(shards)
    }
}

/// Does the time-major copy of a run hold the values of its steps?
///
/// # Errors
/// `Chunk` with the first shard that does not.
pub(crate) async fn compare(cube: &Cube, run: usize) -> Result<(), CubeError> {
    let encoder = SeriesEncoder::new(cube.description())?;
    let held = cube.runs().held_count(run, cube.steps());
    for shard in encoder.shards() {
        let told = cube.shard(run, shard).await?;
        let own = turned(cube, &encoder, (run, held), shard).await?;
        let is_same = match &told {
            Some(told) => {
                let bits = |value: &f32| value.to_bits();
                told.iter().map(bits).eq(own.iter().map(bits))
            }
            None => own.iter().all(|value| value.is_nan()),
        };
        if !is_same {
            return Err(CubeError::Chunk {
                array: cube.series_name().unwrap_or_default(),
                chunk: vec![shard[0].into(), shard[1].into(), run as u64],
                reason: "its values are not those of its steps".to_owned(),
            });
        }
    }
    Ok(())
}

/// Values of a shard of the first `held` steps of a run, `[row, col, step]`, read map-major.
async fn turned(
    cube: &Cube,
    encoder: &SeriesEncoder,
    (run, held): (usize, usize),
    shard: [u32; 2],
) -> Result<Vec<f32>, CubeError> {
    let (window, cols) = (encoder.window(shard), encoder.shard_cols());
    let mut turned = vec![f32::NAN; encoder.shard_values()];
    let all: Vec<usize> = series::steps_of(run, cube.steps()).take(held).collect();
    for (number, steps) in all.chunks(STEPS_AT_ONCE).enumerate() {
        let maps: Vec<Vec<f32>> = stream::iter(steps.iter().copied())
            .map(|step| cube.window(step, window))
            .buffered(STEPS_AT_ONCE)
            .try_collect()
            .await?;
        let joined = tokio::task::spawn_blocking(move || {
            turn(&maps, window, cols, number * STEPS_AT_ONCE, &mut turned);
            turned
        });
        turned = joined.await.map_err(|e| thread(&e))?;
    }
    Ok(turned)
}

fn thread(error: &tokio::task::JoinError) -> CubeError {
    CubeError::library("a thread", "turning values", error)
}

/// Lays the values of some steps, `[row, col]` of a window each, side by side: `turned` is `[row, col, step]` of a shard of
/// so many columns, and `first` the place of the first of these steps in its run.
fn turn(maps: &[Vec<f32>], window: Window, cols: usize, first: usize, turned: &mut [f32]) {
    let width = window.cols as usize;
    for row in 0..window.rows as usize {
        for col in 0..width {
            let at = (row * cols + col) * RUN_STEPS + first;
            let run = &mut turned[at..at + maps.len()];
            for (value, map) in run.iter_mut().zip(maps) {
                *value = map[row * width + col];
            }
        }
    }
}

/// Commits a run over whatever state is there by now. False if it was there already, or its steps are others by now.
async fn place(
    repository: &Repository,
    made_of: &Cube,
    run: usize,
    shards: &[Shard],
) -> Result<bool, CubeError> {
    let failed = |e: &dyn std::fmt::Display| repository.failed("placing a series", e);
    let description = made_of.description();
    let held = series::steps_of(run, made_of.steps()).len();
    let Some(name) = series::name_of(run, made_of.steps()) else {
        return Ok(false);
    };
    let path = path(repository, made_of)?;
    for _attempt in 0..ATTEMPTS {
        let state = State::newest(repository).await?;
        let is_same = state.describes_same_cells(description)
            && series::name_of_first(held, run, &state.steps) == Some(name);
        if !is_same || state.runs.held_count(run, &state.steps) >= held {
            return Ok(false);
        }
        let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&state.session)));
        let runs: Runs = state.runs.clone().with(run, name);
        runs.write(&arrays, description).await?;
        let mut session = state.session.write().await;
        for ([row, col], payload) in shards {
            let here = ChunkIndices(vec![*row, *col, run as u32]);
            let set = session.set_chunk_ref(path.clone(), here, payload.clone());
            set.await.map_err(|e| failed(&e))?;
        }
        let message = format!("run {run} of the series");
        match session.commit(message).execute().await {
            Ok(_snapshot) => return Ok(true),
            Err(e) if matches!(e.kind, SessionErrorKind::Conflict { .. }) => {}
            Err(e) => return Err(failed(&e)),
        }
    }
    Err(CubeError::Contended {
        place: repository.place.clone(),
        attempts: ATTEMPTS,
    })
}
