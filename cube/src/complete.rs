//! Steps of a cube that have no levels in, the same with levels out: of cubes of before, or of what a program put that knew of none.
//!
//! What is made is a commit of its own over the newest state, as compaction is, and nothing else of it changes.

use std::sync::Arc;

use contract::chunk::Window;
use contract::digest::Digest;
use contract::level::Level;
use icechunk::format::ChunkIndices;
use icechunk::session::SessionErrorKind;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::edit::ATTEMPTS;
use crate::field_bands::CubeBands;
use crate::joining::Joiner;
use crate::levels::MadeOf;
use crate::parts::{Parts, Sent, SentStep};
use crate::state::State;
use crate::step_bands::StepBands;
use crate::{Cube, CubeError, Repository};

/// Steps that are committed together.
const STEPS_AT_ONCE: usize = 16;

/// Levels of a step that are in the store, and the digest of its values.
struct Made {
    values_sha256: Digest,
    sent: SentStep,
}

/// Gives the steps of a cube levels that have none, from those of a state on that was the newest a moment ago; of how many.
///
/// # Errors
/// A chunk of a step that is damaged or gone: it gets none.
pub(crate) async fn complete(repository: &Repository, mut cube: Cube) -> Result<usize, CubeError> {
    let mut count = 0;
    loop {
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
        if !placed(repository, &cube, &parts, &made).await? {
            return Ok(count);
        }
        count += made.len();
        cube = repository.newest().await?;
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

/// Is a step what its digest says, and are its levels, where it has some, those of its values? It is read once, in bands of at most so
/// many cells or one row of chunks.
///
/// # Errors
/// `Step` if it is not; else `Chunk` with the level that is not.
pub(crate) async fn compare(cube: &Cube, step: usize, most_cells: u64) -> Result<(), CubeError> {
    let description = cube.description();
    let levels: Vec<Level> = if cube.has_levels(step) {
        cube.levels().copied().collect()
    } else {
        vec![]
    };
    let mut rows_done = vec![0; levels.len()];
    let mut bands = StepBands::of(cube, step, most_cells);
    // What is wrong with levels is told when the values are known to be right.
    let mut joined = Ok(Joiner::new(
        &description.grid,
        description.quantity,
        &levels,
        0,
    ));
    while let Some((_rows, values)) = bands.next().await? {
        joined = match joined {
            Ok(joiner) if !levels.is_empty() => {
                let own = (levels.as_slice(), rows_done.as_mut_slice());
                compare_rows(cube, step, own, joiner, values).await
            }
            told => told,
        };
    }
    joined.map(|_joiner| ())
}

/// Joins the next rows of a step, and compares the rows of levels that are done with them, from those on that were, with what is there.
async fn compare_rows(
    cube: &Cube,
    step: usize,
    (levels, rows_done): (&[Level], &mut [u32]),
    mut joiner: Joiner,
    values: Vec<f32>,
) -> Result<Joiner, CubeError> {
    let joined = tokio::task::spawn_blocking(move || {
        joiner.take(&values);
        joiner
    });
    let mut joiner = joined
        .await
        .map_err(|e| CubeError::library("a thread", "joining cells", e))?;
    for (number, level) in levels.iter().enumerate() {
        let own = joiner.done(number);
        let count = (own.values.len() / level.grid.cols as usize) as u32;
        if count == 0 {
            continue;
        }
        let window = Window {
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
    Ok(joiner)
}

#[cfg(test)]
mod tests {
    use contract::quantity::Quantity;
    use contract::time::Period;
    use storage::Store;

    use super::*;
    use crate::banded_field::{GRID, description, values};
    use crate::{At, Edit, WholeField};

    /// The same with another value in the last cell, which lies in the last band.
    fn other_values() -> Vec<f32> {
        let mut values = values();
        values[GRID.cell_count() - 1] = -1e6;
        values
    }

    /// A cube of a step of some values that says a digest.
    async fn repository_of(store: &Store, values: Vec<f32>, values_sha256: Digest) -> Repository {
        let description = description(Quantity::SeaSurfaceTemperature);
        let repository = Repository::create(store, "p", &description).await.unwrap();
        let mut edit = Edit::begin(&repository).await.unwrap();
        let mut bands = WholeField::new(values.into(), GRID.cols);
        let period = Period::month(2000, 1).unwrap();
        let put = edit.put_bands(period, values_sha256, &mut bands);
        put.await.unwrap();
        edit.commit("one").await.unwrap();
        repository
    }

    #[tokio::test]
    async fn a_step_and_its_levels_are_compared_in_bands_as_they_are_whole() {
        let period = Period::month(2000, 1).unwrap();
        let own = storage::fields::digest_of(&GRID, &values(), period);
        for most_cells in [1, u64::MAX] {
            let store = Store::memory();
            let repository = repository_of(&store, values(), own).await;
            let cube = repository.at(&At::Newest).await.unwrap();
            assert!(cube.has_levels(0));
            compare(&cube, 0, most_cells).await.unwrap();

            // Levels of other values, under the digest of these.
            let parts = Parts::new(cube.description()).unwrap();
            let session = repository.session().await.unwrap();
            let mut bands = WholeField::new(other_values().into(), GRID.cols);
            let sent = parts.send(&session, &mut bands, Sent::Levels).await;
            let made = [Made {
                values_sha256: own,
                sent: sent.unwrap(),
            }];
            let is_placed = placed(&repository, &cube, &parts, &made).await;
            assert!(is_placed.unwrap());
            let cube = repository.at(&At::Newest).await.unwrap();
            let told = compare(&cube, 0, most_cells).await.unwrap_err();
            let CubeError::Chunk { array, .. } = &told else {
                panic!("{told}");
            };
            assert_eq!(array, "levels/1", "{most_cells}");

            // Other values than the digest names, whose levels are theirs: the step is what is wrong.
            let store = Store::memory();
            let repository = repository_of(&store, other_values(), own).await;
            let cube = repository.at(&At::Newest).await.unwrap();
            let told = compare(&cube, 0, most_cells).await.unwrap_err();
            assert!(matches!(told, CubeError::Step { .. }), "{told}");
        }
    }
}
