//! Steps of a cube that have no levels in, the same with levels out: of cubes of before, or of what a program put that knew of none.
//!
//! What is made is a commit of its own over the newest state, as compaction is, and nothing else of it changes.

use std::sync::Arc;

use contract::digest::Digest;
use icechunk::format::ChunkIndices;
use icechunk::session::SessionErrorKind;
use storage::Store;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::edit::ATTEMPTS;
use crate::field_bands::CubeBands;
use crate::joining::Joiner;
use crate::levels::MadeOf;
use crate::parts::{Parts, Sent, SentStep};
use crate::state::State;
use crate::{At, Bands as _, Cube, CubeError, Repository};

/// Steps that are committed together.
const STEPS_AT_ONCE: usize = 16;

/// Levels of a step that are in the store, and the digest of its values.
struct Made {
    values_sha256: Digest,
    sent: SentStep,
}

/// Gives the steps of the cube in a folder of a store levels that have none; of how many.
///
/// # Errors
/// `Missing` if there is no cube. A chunk of a step that is damaged or gone: it gets none.
pub(crate) async fn complete(store: &Store, folder: &str) -> Result<usize, CubeError> {
    let repository = Repository::open(store, folder).await?;
    let mut count = 0;
    loop {
        let cube = repository.at(&At::Newest).await?;
        let missing = cube.without_levels();
        if missing.is_empty() {
            return Ok(count);
        }
        let parts = Parts::new(cube.description())?;
        let mut made = vec![];
        for step in missing.into_iter().take(STEPS_AT_ONCE) {
            let mut bands = CubeBands {
                cube: cube.clone(),
                step,
            };
            let session = repository.session().await?;
            made.push(Made {
                values_sha256: cube.steps()[step].values_sha256,
                sent: parts.send(&session, &mut bands, Sent::Levels).await?,
            });
        }
        if !placed(&repository, &cube, &parts, &made).await? {
            return Ok(count);
        }
        count += made.len();
    }
}

/// Gives levels their places beside their steps, where these still are; false if the cube is of other cells by now.
async fn placed(
    repository: &Repository,
    cube: &Cube,
    parts: &Parts,
    made: &[Made],
) -> Result<bool, CubeError> {
    let failed = |e: &dyn std::fmt::Display| repository.failed("placing levels", e);
    let tracks = parts.tracks()?;
    for _attempt in 0..ATTEMPTS {
        let state = State::newest(repository).await?;
        let (Some(description), true) = (
            &state.description,
            state.describes_same_cells(cube.description()),
        ) else {
            return Ok(false);
        };
        let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&state.session)));
        let count = state.steps.len();
        let levels = &state.levels;
        levels
            .make_room(&state.session, &arrays, description, count)
            .await?;
        let made_of = (0..count).map(|place| levels.made_of(place));
        let mut made_of: Vec<Option<MadeOf>> = made_of.collect();
        let mut session = state.session.write().await;
        for own in made {
            let mut steps = state.steps.iter();
            let place = steps.position(|step| step.values_sha256 == own.values_sha256);
            let Some(place) = place else { continue };
            made_of[place] = Some(MadeOf {
                values_sha256: own.values_sha256,
                range: own.sent.range,
            });
            for (track, objects) in tracks.iter().zip(&own.sent.objects).skip(1) {
                for ([row, col], payload) in objects {
                    let here = ChunkIndices(vec![place as u32, *row, *col]);
                    let set = session.set_chunk_ref(track.path.clone(), here, payload.clone());
                    set.await.map_err(|e| failed(&e))?;
                }
            }
        }
        drop(session);
        levels
            .write(
                &state.session,
                &arrays,
                description,
                (&made_of, &state.steps, count),
            )
            .await?;
        let mut session = state.session.write().await;
        match session.commit("levels").execute().await {
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

/// Are the levels of a step, where it has some, those of its values?
///
/// # Errors
/// `Chunk` with the level that is not.
pub(crate) async fn compare(cube: &Cube, step: usize) -> Result<(), CubeError> {
    if !cube.has_levels(step) {
        return Ok(());
    }
    let description = cube.description();
    let grid = &description.grid;
    let mut joiner = Joiner::of_all(grid, description.quantity);
    let mut bands = CubeBands {
        cube: cube.clone(),
        step,
    };
    let levels: Vec<_> = cube.levels().copied().collect();
    let mut rows_done = vec![0; levels.len()];
    for rows in parts_of(grid.rows, crate::Layout::of(grid).object[0]) {
        let values = bands.rows(rows).await?;
        let joined = tokio::task::spawn_blocking(move || {
            joiner.take(&values);
            joiner
        });
        joiner = joined
            .await
            .map_err(|e| CubeError::library("a thread", "joining cells", e))?;
        for (number, level) in levels.iter().enumerate() {
            let own = joiner.done(number);
            let count = (own.values.len() / level.grid.cols as usize) as u32;
            if count == 0 {
                continue;
            }
            let window = contract::chunk::Window {
                row: rows_done[number],
                col: 0,
                rows: count,
                cols: level.grid.cols,
            };
            rows_done[number] += count;
            let Some(told) = cube.window_at(level.number, window, step).await? else {
                continue;
            };
            let bits = |value: &f32| value.to_bits();
            let is_same = told.values.iter().map(bits).eq(own.values.iter().map(bits))
                && told.coverage == own.coverage;
            if !is_same {
                return Err(CubeError::Chunk {
                    array: crate::arrays::level_group(level),
                    chunk: vec![step as u64],
                    reason: "its values are not those of its step".to_owned(),
                });
            }
        }
    }
    Ok(())
}

fn parts_of(rows: u32, height: u32) -> impl Iterator<Item = std::ops::Range<u32>> {
    let parts = 0..rows.div_ceil(height);
    parts.map(move |part| part * height..((part + 1) * height).min(rows))
}
