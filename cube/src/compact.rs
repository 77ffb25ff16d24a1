//! The cube of a product in, its runs of steps time-major out, and sums of them: what is there map-major is cut otherwise, run by run.
//!
//! Nothing waits for it, and it may be killed at any point: what was sent and not committed is removed by clean-up, and
//! whoever publishes next goes on. Two that do the same at once send the same values, and the second finds them there.
//! Values of one shard are held at a time: 128 MiB at most, sums of it, a fifth of that, and what is read and written of it.

use std::sync::Arc;

use bytes::Bytes;
use contract::digest::Digest;
use futures::future::BoxFuture;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use icechunk::format::manifest::ChunkPayload;
use icechunk::format::{ChunkIndices, Path};
use icechunk::session::SessionErrorKind;
use serde_json::Map;
use storage::Store;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::arrays::{self, Definition, SERIES};
use crate::blocks::RunAxis;
use crate::edit::ATTEMPTS;
use crate::field::SeriesEncoder;
use crate::layout::RUN_STEPS;
use crate::series;
use crate::state::State;
use crate::sums::Basis;
use crate::{Cube, CubeError, Repository, complete, placing};

/// Steps whose windows are read at a time.
const STEPS_AT_ONCE: usize = 16;

/// A shard that is in the store, by its row and column; none where no cell has data.
type Shard = ([u32; 2], Option<ChunkPayload>);

/// Shards of a run.
#[derive(Default)]
struct Made {
    /// Of the time-major copy; none where it is there already.
    series: Vec<Shard>,
    /// Of sums; none of a quantity that is not summed.
    sums: Vec<Shard>,
}

/// Makes the runs of the cube in a folder of a store that are not there yet, and sums of them, the last one if it lacks many
/// steps; how many that were. Steps that have no levels get them.
///
/// # Errors
/// `Missing` if there is no cube. A chunk that is damaged or gone: no run is made of it.
pub fn compact<'a>(store: &'a Store, folder: &'a str) -> BoxFuture<'a, Result<usize, CubeError>> {
    Box::pin(async move {
        let repository = Repository::open(store, folder).await?;
        let mut made = 0;
        let cube = loop {
            let cube = repository.newest().await?;
            let Some(run) = cube.first_missing() else {
                break cube;
            };
            let compaction = Compaction {
                repository: &repository,
                cube: &cube,
                encoder: Arc::new(SeriesEncoder::new(cube.description())?),
                basis: cube.sums().next_basis(cube.description()),
                run,
                has_series: cube.runs().is_of(run, cube.steps()),
            };
            let shards = compaction.shards().await?;
            made += usize::from(compaction.place(&shards).await?);
        };
        complete::complete(&repository, cube).await?;
        Ok(made)
    })
}

struct Compaction<'a> {
    repository: &'a Repository,
    cube: &'a Cube,
    encoder: Arc<SeriesEncoder>,
    /// How values count in sums; none of a quantity that is not summed.
    basis: Option<Arc<Basis>>,
    run: usize,
    /// Is the time-major copy there, and sums alone are made?
    has_series: bool,
}

impl Compaction<'_> {
    /// Sends all shards of the run: values of the next one are read while one is encoded.
    async fn shards(&self) -> Result<Made, CubeError> {
        let session = self.repository.session().await?;
        let (series, sums) = (self.series_path()?, self.sums_path()?);
        let mut made = Made::default();
        let mut left = self.encoder.shards().into_iter();
        let mut coming = left.next();
        let mut values = self.values(coming).await?;
        while let Some(shard) = coming {
            coming = left.next();
            let place = async {
                let [values, records] = self.encoded(shard, values).await?;
                let series = async {
                    let at = (&series, RunAxis::First.index(shard, self.run));
                    let sent = placing::send_shard(&session, at, values).await?;
                    Ok::<_, CubeError>((shard, sent))
                };
                let sums = async {
                    let at = (&sums, RunAxis::Last.index(shard, self.run));
                    let sent = placing::send_shard(&session, at, records).await?;
                    Ok::<_, CubeError>((shard, sent))
                };
                tokio::try_join!(series, sums)
            };
            let (sent, next) = tokio::try_join!(place, self.values(coming))?;
            if !self.has_series {
                made.series.push(sent.0);
            }
            if self.basis.is_some() {
                made.sums.push(sent.1);
            }
            values = next;
        }
        Ok(made)
    }

    /// Values of a shard, `[step, row, col]`; none where no cell has data.
    async fn values(&self, shard: Option<[u32; 2]>) -> Result<Option<Vec<f32>>, CubeError> {
        let (cube, run) = (self.cube, self.run);
        let Some(shard) = shard else { return Ok(None) };
        if self.has_series {
            return cube.shard(run, shard).await;
        }
        let held = series::steps_of(run, cube.steps()).len();
        stacked(cube, &self.encoder, (run, held), shard)
            .await
            .map(Some)
    }

    /// A shard of the time-major copy and that of sums, a thread each; none where no cell has data, or where it is not made.
    async fn encoded(
        &self,
        shard: [u32; 2],
        values: Option<Vec<f32>>,
    ) -> Result<[Option<Bytes>; 2], CubeError> {
        let Some(values) = values.map(Arc::new) else {
            return Ok([None, None]);
        };
        let (encoder, own) = (Arc::clone(&self.encoder), Arc::clone(&values));
        let has_series = self.has_series;
        let series = tokio::task::spawn_blocking(move || {
            if has_series {
                return Ok(None);
            }
            encoder.encode(&own)
        });
        let (encoder, basis) = (Arc::clone(&self.encoder), self.basis.clone());
        let sums = tokio::task::spawn_blocking(move || {
            let records = basis.map(|basis| encoder.records(&values, shard, &basis));
            drop(values);
            let encoded = records.map(|records| encoder.encode_records(&records));
            Ok::<_, CubeError>(encoded.transpose()?.flatten())
        });
        let (series, sums) = tokio::try_join!(series, sums).map_err(|e| thread(&e))?;
        Ok([series?, sums?])
    }

    fn series_path(&self) -> Result<Path, CubeError> {
        placing::series_path(self.cube.description())
    }

    fn sums_path(&self) -> Result<Path, CubeError> {
        self.path(&arrays::sums(self.cube.description(), 1)?)
    }

    fn path(&self, array: &Definition) -> Result<Path, CubeError> {
        let path = Path::new(array.path().as_str());
        path.map_err(|e| self.repository.failed("naming the series", &e))
    }

    /// Gives shards their places, unless somebody else has placed the same, or the steps are others by now; were they placed?
    async fn place(&self, made: &Made) -> Result<bool, CubeError> {
        let (repository, run) = (self.repository, self.run);
        let failed = |e: &dyn std::fmt::Display| repository.failed("placing a series", e);
        let description = self.cube.description();
        let held = series::steps_of(run, self.cube.steps()).len();
        let Some(name) = series::name_of(run, self.cube.steps()) else {
            return Ok(false);
        };
        for _attempt in 0..ATTEMPTS {
            let state = State::newest(repository).await?;
            let is_same = state.describes_same_cells(description)
                && series::name_of_first(held, run, &state.steps) == Some(name);
            let is_placed = if self.has_series {
                // Sums of a run that is there no more are of no use.
                state.runs.name(run) != Some(name) || state.sums.runs.name(run) == Some(name)
            } else {
                state.runs.held_count(run, &state.steps) >= held
            };
            if !is_same || is_placed {
                return Ok(false);
            }
            self.write(&state, made, name).await?;
            let mut session = state.session.write().await;
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

    /// Writes what was made over a state.
    async fn write(&self, state: &State, made: &Made, name: Digest) -> Result<(), CubeError> {
        let failed = |e: &dyn std::fmt::Display| self.repository.failed("placing a series", e);
        let (description, run) = (self.cube.description(), self.run);
        let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&state.session)));
        if !self.has_series {
            let runs = state.runs.clone().with(run, name);
            let array = arrays::series(description, runs.len())?;
            runs.write(&arrays, (SERIES, Map::new()), array).await?;
            placing::drop_copy_of_before(self.repository, &state.session).await?;
        }
        // Those that somebody else has made meanwhile count as they say, and others cannot be put beside them.
        let basis = self.basis.as_ref();
        let basis = basis.filter(|own| state.sums.basis.as_ref().is_none_or(|there| there == *own));
        if let Some(basis) = basis {
            let runs = state.sums.runs.clone().with(run, name);
            let (sums, session) = (&state.sums, &state.session);
            let own = (&**basis, &runs);
            sums.write(session, &arrays, description, own).await?;
        }
        let series = (self.series_path()?, RunAxis::First, &made.series);
        let of_sums =
            basis.map(|_| Ok::<_, CubeError>((self.sums_path()?, RunAxis::Last, &made.sums)));
        let mut session = state.session.write().await;
        for (path, axis, shards) in std::iter::once(series).chain(of_sums.transpose()?) {
            for (shard, payload) in shards {
                let here = ChunkIndices(axis.index(*shard, run).to_vec());
                let set = session.set_chunk_ref(path.clone(), here, payload.clone());
                set.await.map_err(|e| failed(&e))?;
            }
        }
        Ok(())
    }
}

/// Does the time-major copy of a run hold the values of its steps, and are the sums of it those of these values?
///
/// # Errors
/// `Chunk` with the first shard that does not.
pub(crate) async fn compare(cube: &Cube, run: usize) -> Result<(), CubeError> {
    let encoder = SeriesEncoder::new(cube.description())?;
    let held = cube.runs().held_count(run, cube.steps());
    let basis = cube.sums().basis.clone();
    let basis = basis.filter(|_| cube.is_summed(run));
    for shard in encoder.shards() {
        let told = cube.shard(run, shard).await?;
        let own = stacked(cube, &encoder, (run, held), shard).await?;
        let is_same = match &told {
            Some(told) => {
                let bits = |value: &f32| value.to_bits();
                told.iter().map(bits).eq(own.iter().map(bits))
            }
            None => own.iter().all(|value| value.is_nan()),
        };
        let differs = |array: Option<String>, what: &str| CubeError::Chunk {
            array: array.unwrap_or_default(),
            chunk: vec![shard[0].into(), shard[1].into(), run as u64],
            reason: what.to_owned(),
        };
        if !is_same {
            let what = "its values are not those of its steps";
            return Err(differs(cube.series_name(), what));
        }
        let Some(basis) = &basis else { continue };
        let told = cube.records_of_shard(run, shard).await?;
        let own = encoder.records(&own, shard, basis);
        let is_same = match told {
            Some(told) => told == own,
            None => own.iter().all(|byte| *byte == 0),
        };
        if !is_same {
            let what = "its sums are not those of its steps";
            return Err(differs(cube.sums_name(), what));
        }
    }
    Ok(())
}

/// Values of a shard of the first `held` steps of a run, `[step, row, col]`, read map-major.
async fn stacked(
    cube: &Cube,
    encoder: &SeriesEncoder,
    (run, held): (usize, usize),
    shard: [u32; 2],
) -> Result<Vec<f32>, CubeError> {
    let (window, cols) = (encoder.window(shard), encoder.shard_cols());
    let mut stacked = vec![f32::NAN; encoder.shard_values()];
    let all: Vec<usize> = series::steps_of(run, cube.steps()).take(held).collect();
    let maps = stream::iter(all).map(|step| cube.window(step, window));
    let mut maps = maps.buffered(STEPS_AT_ONCE);
    for map in stacked.chunks_exact_mut(encoder.shard_values() / RUN_STEPS) {
        let Some(found) = maps.try_next().await? else {
            break;
        };
        let rows = found.chunks_exact(window.cols as usize);
        for (row, found) in map.chunks_exact_mut(cols).zip(rows) {
            row[..found.len()].copy_from_slice(found);
        }
    }
    Ok(stacked)
}

fn thread(error: &tokio::task::JoinError) -> CubeError {
    CubeError::library("a thread", "encoding values", error)
}

#[cfg(test)]
mod tests {
    use contract::grid::Grid;
    use contract::quantity::Quantity;
    use contract::time::{Period, TimeMs};

    use super::*;
    use crate::{At, Description, Edit};

    const GRID: Grid = Grid {
        rows: 9,
        cols: 20,
        north_deg: 45.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    #[tokio::test]
    async fn runs_of_before_get_their_sums_and_keep_their_values() {
        let store = Store::memory();
        let description = Description {
            product: "p".parse().unwrap(),
            title: "P".to_owned(),
            quantity: Quantity::CarbonFlux,
            synthetic: true,
            source: "a test".to_owned(),
            grid: GRID,
            version: None,
            statistic: None,
        };
        let made = Repository::create(&store, "p", &description).await;
        let repository = made.unwrap();
        let mut edit = Edit::begin(&repository).await.unwrap();
        let day = |at: usize| TimeMs::new(at as i64 * 86_400_000).unwrap();
        for step in 0..RUN_STEPS {
            let value = |cell: usize| (cell % 7 * step) as f32 * 1e-11;
            let values = (0..GRID.cell_count()).map(value).collect();
            let period = Period::new(day(step), day(step + 1)).unwrap();
            edit.put(period, values).await.unwrap();
        }
        edit.commit("steps").await.unwrap();
        assert_eq!(compact(&store, "p").await.unwrap(), 1);
        let before = repository.at(&At::Newest).await.unwrap();
        assert!(before.is_summed(0));
        compare(&before, 0).await.unwrap();
        // As a program left it that knew of no sums.
        let session = repository.session().await.unwrap();
        let mut session = session.write().await;
        let sums = Path::new("/sums").unwrap();
        session.delete_group(sums).await.unwrap();
        session.commit("none").execute().await.unwrap();
        drop(session);
        let without = repository.at(&At::Newest).await.unwrap();
        assert!(!without.is_summed(0) && without.sums_name().is_none());
        assert_eq!(without.first_missing(), Some(0));
        assert_eq!(compact(&store, "p").await.unwrap(), 1);
        let after = repository.at(&At::Newest).await.unwrap();
        assert!(after.is_summed(0));
        compare(&after, 0).await.unwrap();
        assert_eq!(after.runs(), before.runs());
        let of = async |cube: &Cube| {
            let records = cube.records_of_shard(0, [0, 0]).await.unwrap();
            let values = cube.shard(0, [0, 0]).await.unwrap().unwrap();
            let bits: Vec<u32> = values.iter().map(|value| value.to_bits()).collect();
            (records, bits)
        };
        assert!(of(&after).await == of(&before).await);
        assert_eq!(compact(&store, "p").await.unwrap(), 0);
    }
}
