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
            .write(&state.session, &arrays, description, (&made_of, count))
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

#[cfg(test)]
mod tests {
    use contract::grid::Grid;
    use contract::quantity::Quantity;
    use contract::time::Period;
    use icechunk::format::Path;

    use super::*;
    use crate::{Description, Edit, LevelWindow, compact};

    const GRID: Grid = Grid {
        rows: 6,
        cols: 600,
        north_deg: 3.0,
        west_deg: 0.0,
        dlat_deg: 0.5,
        dlon_deg: 0.5,
    };

    async fn cube(store: &Store) -> Cube {
        let repository = Repository::open(store, "p").await.unwrap();
        repository.at(&At::Newest).await.unwrap()
    }

    async fn level(cube: &Cube, step: usize) -> Option<LevelWindow> {
        let window = contract::chunk::Window {
            row: 0,
            col: 0,
            rows: 2,
            cols: 150,
        };
        cube.window_at(1, window, step).await.unwrap()
    }

    /// A cube of some months.
    async fn months(store: &Store, months: &[u32]) -> Repository {
        let description = Description {
            product: "p".parse().unwrap(),
            title: "P".to_owned(),
            quantity: Quantity::CarbonFlux,
            synthetic: true,
            source: "a test".to_owned(),
            grid: GRID,
            version: None,
        };
        let repository = match Repository::open(store, "p").await {
            Ok(repository) => repository,
            Err(_none) => Repository::create(store, "p", &description).await.unwrap(),
        };
        let mut edit = Edit::begin(&repository).await.unwrap();
        for month in months {
            let value = |cell: usize| (cell as u32 % (month + 7)) as f32 * 1e-10;
            let values = (0..GRID.cell_count()).map(value).collect();
            let period = Period::month(2000, *month).unwrap();
            edit.put(period, values).await.unwrap();
        }
        edit.commit("months").await.unwrap();
        repository
    }

    #[tokio::test]
    async fn cubes_of_before_get_levels_beside_the_values_that_they_have() {
        let store = Store::memory();
        let repository = months(&store, &[1, 2, 4]).await;
        let before = cube(&store).await;
        // As a program left it that knew of no levels.
        let session = repository.session().await.unwrap();
        let mut own = session.write().await;
        own.delete_group(Path::new("/levels").unwrap())
            .await
            .unwrap();
        own.commit("none").execute().await.unwrap();
        drop(own);
        let without = cube(&store).await;
        assert!(!without.has_levels(0) && without.without_levels() == [0, 1, 2]);
        assert_eq!(level(&without, 0).await, None);
        // What comes has levels, and what is there is not taken for it.
        months(&store, &[3]).await;
        let some = cube(&store).await;
        assert_eq!(some.without_levels(), [0, 1, 3]);
        assert!(level(&some, 2).await.is_some());
        assert_eq!(complete(&store, "p").await.unwrap(), 3);
        let after = cube(&store).await;
        assert!(after.without_levels().is_empty());
        for (place, old) in [(0, 0), (1, 1), (3, 2)] {
            assert_eq!(level(&after, place).await, level(&before, old).await);
            assert_eq!(after.range_of(place), before.range_of(old));
            compare(&after, place).await.unwrap();
        }
        assert_eq!(compact(&store, "p").await.unwrap(), 0);
        assert_eq!(complete(&store, "p").await.unwrap(), 0);
    }

    #[tokio::test]
    async fn levels_of_other_values_are_not_taken_and_those_that_lie_are_found() {
        let store = Store::memory();
        let repository = months(&store, &[1, 2]).await;
        let session = repository.session().await.unwrap();
        // A program that knows of no levels swaps two steps: so do the digests of values.
        let mut own = session.write().await;
        let path = Path::new("/levels/1/carbon_flux").unwrap();
        let at = |step| ChunkIndices(vec![step, 0, 0]);
        let [one, two] = [
            own.get_chunk_ref(&path, &at(0)).await.unwrap(),
            own.get_chunk_ref(&path, &at(1)).await.unwrap(),
        ];
        own.set_chunk_ref(path.clone(), at(0), two).await.unwrap();
        own.set_chunk_ref(path, at(1), one).await.unwrap();
        own.commit("lies").execute().await.unwrap();
        drop(own);
        let lying = cube(&store).await;
        let error = compare(&lying, 0).await.unwrap_err().to_string();
        assert!(
            error.contains("levels/1") && error.contains("not those of its step"),
            "{error}"
        );

        let state = State::newest(&repository).await.unwrap();
        let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&state.session)));
        let mut made_of: Vec<Option<MadeOf>> =
            vec![state.levels.made_of(1), state.levels.made_of(0)];
        let description = state.description.as_ref().unwrap();
        let write = state
            .levels
            .write(&state.session, &arrays, description, (&made_of, 2));
        write.await.unwrap();
        let mut own = state.session.write().await;
        own.commit("names").execute().await.unwrap();
        drop(own);
        let stale = cube(&store).await;
        assert_eq!(level(&stale, 0).await, None);
        assert_eq!(stale.without_levels(), [0, 1]);
        made_of.clear();
        assert_eq!(complete(&store, "p").await.unwrap(), 2);
        compare(&cube(&store).await, 1).await.unwrap();
    }
}
