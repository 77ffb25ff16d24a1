//! The cube of a product in, its runs of steps time-major out, and sums of them: what is there map-major is cut otherwise, run by run, and
//! some runs are committed together.
//!
//! Nothing waits for it, and it may be killed at any point: what was sent and not committed is removed by clean-up, and
//! whoever publishes next goes on. Two that do the same at once send the same values, and the second finds them there.
//! Values of one shard are held at a time: 128 MiB at most, sums of it, a fifth of that, and what is read and written of it; of runs that wait
//! for their commit where their shards are, some 200 bytes each.

use std::sync::Arc;

use bytes::Bytes;
use contract::digest::Digest;
use futures::future::BoxFuture;
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
use crate::series;
use crate::stacked::stacked;
use crate::state::State;
use crate::sums::Basis;
use crate::{Cube, CubeError, Repository, complete, held_steps, placing};

/// A shard that is in the store, by its row and column; none where no cell has data.
type Shard = ([u32; 2], Option<ChunkPayload>);

/// Most runs that are committed together: a commit writes manifests, names of runs and the list of all states again, whatever it is of.
const RUNS_AT_ONCE: usize = 16;
/// Shards of all of them, up to 128 MiB of values each: who is killed has as much to make again, and what one run has where it has more.
const SHARDS_AT_ONCE: usize = 64;

/// A run whose shards are in the store.
struct Made {
    run: usize,
    /// Was the time-major copy there, and are these sums of it alone?
    had_series: bool,
    /// Of the time-major copy; none where it was there.
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
        let mut count = 0;
        let cube = loop {
            let cube = repository.newest().await?;
            let missing = cube.missing();
            if missing.is_empty() {
                break cube;
            }
            let compaction = Compaction {
                repository: &repository,
                cube: &cube,
                encoder: Arc::new(SeriesEncoder::new(cube.description())?),
                basis: cube.sums().next_basis(cube.description()),
            };
            let at_once = runs_at_once(compaction.encoder.shards().len());
            let (mut made, mut failed) = (vec![], None);
            for run in missing.into_iter().take(at_once) {
                match compaction.run(run).made().await {
                    Ok(own) => made.push(own),
                    Err(error) => {
                        failed = Some(error);
                        break;
                    }
                }
            }
            // Those before one that cannot be made are whole.
            count += compaction.place(&made).await?;
            if let Some(error) = failed {
                return Err(error);
            }
        };
        complete::complete(&repository, cube).await?;
        Ok(count)
    })
}

/// How many runs of so many shards are committed together.
fn runs_at_once(shards: usize) -> usize {
    (SHARDS_AT_ONCE / shards.max(1)).clamp(1, RUNS_AT_ONCE)
}

/// Makes runs of a state.
struct Compaction<'a> {
    repository: &'a Repository,
    cube: &'a Cube,
    encoder: Arc<SeriesEncoder>,
    /// How values count in sums; none of a quantity that is not summed.
    basis: Option<Arc<Basis>>,
}

/// Makes one of them.
struct Run<'a> {
    of: &'a Compaction<'a>,
    at: usize,
    /// Is the time-major copy there, and sums alone are made?
    has_series: bool,
}

impl Run<'_> {
    /// Sends all shards of the run: values of the next one are read while one is encoded.
    async fn made(&self) -> Result<Made, CubeError> {
        let session = self.of.repository.session().await?;
        let (series, sums) = (self.of.series_path()?, self.of.sums_path()?);
        let mut made = Made {
            run: self.at,
            had_series: self.has_series,
            series: vec![],
            sums: vec![],
        };
        let mut left = self.of.encoder.shards().into_iter();
        let mut coming = left.next();
        let mut values = self.values(coming).await?;
        while let Some(shard) = coming {
            coming = left.next();
            let place = async {
                let [values, records] = self.encoded(shard, values).await?;
                let series = async {
                    let at = (&series, RunAxis::First.index(shard, self.at));
                    let sent = placing::send_shard(&session, at, values).await?;
                    Ok::<_, CubeError>((shard, sent))
                };
                let sums = async {
                    let at = (&sums, RunAxis::Last.index(shard, self.at));
                    let sent = placing::send_shard(&session, at, records).await?;
                    Ok::<_, CubeError>((shard, sent))
                };
                tokio::try_join!(series, sums)
            };
            let (sent, next) = tokio::try_join!(place, self.values(coming))?;
            if !self.has_series {
                made.series.push(sent.0);
            }
            if self.of.basis.is_some() {
                made.sums.push(sent.1);
            }
            values = next;
        }
        Ok(made)
    }

    /// Values of a shard, `[step, row, col]`; none where no cell has data.
    async fn values(&self, shard: Option<[u32; 2]>) -> Result<Option<Vec<f32>>, CubeError> {
        let (cube, run) = (self.of.cube, self.at);
        let Some(shard) = shard else { return Ok(None) };
        if self.has_series {
            return cube.shard(run, shard).await;
        }
        let held = series::steps_of(run, cube.steps()).len();
        stacked(cube, &self.of.encoder, (run, held), shard)
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
        let (encoder, own) = (Arc::clone(&self.of.encoder), Arc::clone(&values));
        let has_series = self.has_series;
        let series = tokio::task::spawn_blocking(move || {
            if has_series {
                return Ok(None);
            }
            encoder.encode(&own)
        });
        let (encoder, basis) = (Arc::clone(&self.of.encoder), self.of.basis.clone());
        let sums = tokio::task::spawn_blocking(move || {
            let records = basis.map(|basis| encoder.records(&values, shard, &basis));
            drop(values);
            let encoded = records.map(|records| encoder.encode_records(&records));
            Ok::<_, CubeError>(encoded.transpose()?.flatten())
        });
        let (series, sums) = tokio::try_join!(series, sums).map_err(|e| thread(&e))?;
        Ok([series?, sums?])
    }
}

impl Compaction<'_> {
    /// What makes a run.
    fn run(&self, run: usize) -> Run<'_> {
        Run {
            of: self,
            at: run,
            has_series: self.cube.runs().is_of(run, self.cube.steps()),
        }
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

    /// Gives runs their places, but those that somebody else has placed, or whose steps are others by now; how many were placed.
    async fn place(&self, made: &[Made]) -> Result<usize, CubeError> {
        let repository = self.repository;
        // Reading a state takes as long as its cube has steps.
        if made.is_empty() {
            return Ok(0);
        }
        for _attempt in 0..ATTEMPTS {
            let state = State::newest(repository).await?;
            let wanted = made.iter().filter_map(|own| {
                let name = self.name_over(&state, own)?;
                Some((own, name))
            });
            let wanted: Vec<(&Made, Digest)> = wanted.collect();
            if wanted.is_empty() {
                return Ok(0);
            }
            self.write(&state, &wanted).await?;
            let runs: Vec<String> = wanted.iter().map(|(own, _)| own.run.to_string()).collect();
            let message = format!("runs of the series: {}", runs.join(", "));
            let committed = state.session.write().await.commit(message).execute().await;
            match committed {
                Ok(snapshot) => {
                    let snapshots = (state.snapshot.as_str(), &*snapshot.to_string());
                    held_steps::committed(&repository.place, snapshots, &state.steps);
                    return Ok(wanted.len());
                }
                Err(e) if matches!(e.kind, SessionErrorKind::Conflict { .. }) => {}
                Err(e) => return Err(repository.failed("placing a series", &e)),
            }
        }
        Err(CubeError::Contended {
            place: repository.place.clone(),
            attempts: ATTEMPTS,
        })
    }

    /// The name of a run that was made, by its steps; none if a state has another one in its place, or this one already.
    fn name_over(&self, state: &State, made: &Made) -> Option<Digest> {
        let (run, steps) = (made.run, self.cube.steps());
        let held = series::steps_of(run, steps).len();
        let name = series::name_of(run, steps)?;
        let is_same = state.describes_same_cells(self.cube.description())
            && series::name_of_first(held, run, &state.steps) == Some(name);
        let is_placed = if made.had_series {
            // Sums of a run that is there no more are of no use, nor are those that cannot be put beside what is there.
            state.runs.name(run) != Some(name)
                || state.sums.runs.name(run) == Some(name)
                || self.basis_over(state).is_none()
        } else {
            state.runs.held_count(run, &state.steps) >= held
        };
        (is_same && !is_placed).then_some(name)
    }

    /// How values count in the sums that were made; none where somebody else has made some meanwhile in which they count otherwise: others
    /// cannot be put beside those.
    fn basis_over(&self, state: &State) -> Option<&Arc<Basis>> {
        let basis = self.basis.as_ref();
        basis.filter(|own| state.sums.basis.as_ref().is_none_or(|there| there == *own))
    }

    /// Writes what was made over a state.
    async fn write(&self, state: &State, made: &[(&Made, Digest)]) -> Result<(), CubeError> {
        let failed = |e: &dyn std::fmt::Display| self.repository.failed("placing a series", e);
        let description = self.cube.description();
        let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&state.session)));
        if made.iter().any(|(own, _)| !own.had_series) {
            let own = made.iter().filter(|(own, _)| !own.had_series);
            let runs = own.fold(state.runs.clone(), |runs, (own, name)| {
                runs.with(own.run, *name)
            });
            let array = arrays::series(description, runs.len())?;
            runs.write(&arrays, (SERIES, Map::new()), array).await?;
            placing::drop_copy_of_before(self.repository, &state.session).await?;
        }
        let basis = self.basis_over(state);
        if let Some(basis) = basis {
            let before = state.sums.runs.clone();
            let named = made.iter();
            let runs = named.fold(before, |runs, (own, name)| runs.with(own.run, *name));
            let (sums, session) = (&state.sums, &state.session);
            let own = (&**basis, &runs);
            sums.write(session, &arrays, description, own).await?;
        }
        let (series_path, sums_path) = (self.series_path()?, self.sums_path()?);
        let mut session = state.session.write().await;
        for (own, _) in made {
            let series = (&series_path, RunAxis::First, &own.series);
            let sums = basis.map(|_| (&sums_path, RunAxis::Last, &own.sums));
            for (path, axis, shards) in std::iter::once(series).chain(sums) {
                for (shard, payload) in shards {
                    let here = ChunkIndices(axis.index(*shard, own.run).to_vec());
                    let set = session.set_chunk_ref(path.clone(), here, payload.clone());
                    set.await.map_err(|e| failed(&e))?;
                }
            }
        }
        Ok(())
    }
}

fn thread(error: &tokio::task::JoinError) -> CubeError {
    CubeError::library("a thread", "encoding values", error)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use contract::grid::Grid;
    use contract::quantity::Quantity;
    use contract::time::{Period, TimeMs};

    use super::*;
    use crate::layout::RUN_STEPS;
    use crate::stacked::compare;
    use crate::{At, Description, Edit};

    const GRID: Grid = Grid {
        rows: 9,
        cols: 20,
        north_deg: 45.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    #[test]
    fn large_runs_are_committed_one_by_one_and_small_ones_together() {
        let counts = [1, 2, 6, 33, 64, 2556].map(runs_at_once);
        assert_eq!(counts, [16, 16, 10, 1, 1, 1]);
    }

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
        assert_eq!(without.missing(), BTreeSet::from([0]));
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
