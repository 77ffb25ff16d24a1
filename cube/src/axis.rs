//! Steps in the order of time: their periods as the conventions write them, and the digest of each step's values.

use std::sync::Arc;

use contract::digest::Digest;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use futures::FutureExt as _;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use zarrs::array::{Array, ElementOwned};
use zarrs::storage::{AsyncReadableStorageTraits, AsyncWritableStorageTraits, StoreKey};

use crate::arrays::{self, DIGEST_BYTES, Definition, STEP_START};
use crate::error::first_lines;
use crate::{CubeError, Description};

/// Chunks that are read at a time.
pub(crate) const CHUNKS_AT_ONCE: usize = 8;
/// Most steps that are read: every quarter of an hour of 280 years.
const MOST_STEPS: u64 = 10_000_000;

/// One step of a cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// What its values are a mean over; of accumulated carbon, what was added last.
    pub period: Period,
    /// Digest of its values and period: [`storage::fields::digest_of`].
    pub values_sha256: Digest,
}

impl Step {
    /// The instant where its values hold: the middle of a mean, the end of a sum.
    fn time(&self, is_sum: bool) -> TimeMs {
        if is_sum {
            self.period.end
        } else {
            self.period.mid()
        }
    }
}

/// Writes what has changed from step `first` on, and how many there are.
pub(crate) async fn write<S>(
    store: &Arc<S>,
    description: &Description,
    steps: &[Step],
    first: usize,
) -> Result<(), CubeError>
where
    S: AsyncWritableStorageTraits + 'static,
{
    let is_sum = description.is_sum();
    let axis = arrays::axis(is_sum, steps.len() as u64)?;
    // A sum is one since the first step, and so are its bounds.
    let origin = steps.first().map(|step| step.period.start);
    let origin = origin.filter(|_| is_sum);
    let bounds_start = |step: &Step| origin.unwrap_or(step.period.start);
    let writer = Writer {
        store,
        steps,
        first,
    };
    writer
        .write(&axis.time, |step| [step.time(is_sum).ms()])
        .await?;
    writer
        .write(&axis.bounds, |step| {
            [bounds_start(step).ms(), step.period.end.ms()]
        })
        .await?;
    if let Some(step_start) = &axis.step_start {
        writer
            .write(step_start, |step| [step.period.start.ms()])
            .await?;
    }
    writer
        .write(&axis.digests, |step| *step.values_sha256.as_bytes())
        .await
}

struct Writer<'a, S> {
    store: &'a Arc<S>,
    steps: &'a [Step],
    first: usize,
}

impl<S: AsyncWritableStorageTraits + 'static> Writer<'_, S> {
    /// Writes one array of `N` numbers a step.
    async fn write<T, const N: usize>(
        &self,
        definition: &Definition,
        of: impl Fn(&Step) -> [T; N],
    ) -> Result<(), CubeError>
    where
        T: zarrs::array::Element + Default + Copy + Send + Sync + 'static,
    {
        let array = definition.with_storage(Arc::clone(self.store));
        let failed = |e: String| CubeError::library(&arrays::name(&array), "writing", e);
        let stored = array.async_store_metadata().await;
        stored.map_err(|e| failed(e.to_string()))?;
        let chunk_steps = chunk_steps(definition)?;
        for chunk in self.first / chunk_steps..self.steps.len().div_ceil(chunk_steps) {
            let start = chunk * chunk_steps;
            let end = self.steps.len().min(start + chunk_steps);
            let mut numbers: Vec<T> = self.steps[start..end].iter().flat_map(&of).collect();
            numbers.resize(chunk_steps * N, T::default());
            let mut index = vec![0; definition.dimensionality()];
            index[0] = chunk as u64;
            let stored = array.async_store_chunk(&index, numbers).await;
            stored.map_err(|e| failed(e.to_string()))?;
        }
        Ok(())
    }
}

/// Writes numbers along time from step `first` on: `numbers` are those of all steps, `each` a step.
pub(crate) async fn write_numbers<S>(
    store: &Arc<S>,
    definition: &Definition,
    (numbers, each): (&[f32], usize),
    first: usize,
) -> Result<(), CubeError>
where
    S: AsyncWritableStorageTraits + 'static,
{
    let array = definition.with_storage(Arc::clone(store));
    let failed = |e: String| CubeError::library(&arrays::name(&array), "writing", e);
    let stored = array.async_store_metadata().await;
    stored.map_err(|e| failed(e.to_string()))?;
    let steps = chunk_steps(definition)?;
    let chunks = numbers.chunks(steps * each).enumerate();
    for (chunk, numbers) in chunks.skip(first / steps) {
        let mut numbers = numbers.to_vec();
        numbers.resize(steps * each, 0.0);
        let stored = array.async_store_chunk(&[chunk as u64, 0], numbers).await;
        stored.map_err(|e| failed(e.to_string()))?;
    }
    Ok(())
}

/// Are the starts of steps there beside their bounds, which are those of a sum? Statistics of sums were written so too, once.
pub(crate) async fn has_step_start<S>(
    store: &Arc<S>,
    description: &Description,
) -> Result<bool, CubeError>
where
    S: AsyncReadableStorageTraits + 'static,
{
    if description.is_sum() || description.quantity != Quantity::AccumulatedCarbon {
        return Ok(description.is_sum());
    }
    let failed = |e: &dyn std::fmt::Display| CubeError::library(STEP_START, "looking for it", e);
    let key = StoreKey::new(format!("{STEP_START}/zarr.json")).map_err(|e| failed(&e))?;
    let found = store.get(&key).await.map_err(|e| failed(&e))?;
    Ok(found.is_some())
}

/// Reads all steps.
///
/// # Errors
/// `Foreign` if the arrays are not those of a cube, or their times are no steps in the order of time.
pub(crate) async fn read<S>(
    store: &Arc<S>,
    description: &Description,
    place: &str,
) -> Result<Vec<Step>, CubeError>
where
    S: AsyncReadableStorageTraits + 'static,
{
    let axis = arrays::axis(has_step_start(store, description).await?, 1)?;
    let bounds: Vec<i64> = read_array(store, &axis.bounds, place, None).await?;
    let starts: Vec<i64> = match &axis.step_start {
        // Sums may begin with 1970.
        Some(step_start) => read_array(store, step_start, place, Some(0)).await?,
        None => bounds.iter().copied().step_by(2).collect(),
    };
    let digests: Vec<u8> = read_array(store, &axis.digests, place, None).await?;
    let foreign = |reason: String| CubeError::Foreign {
        place: place.to_owned(),
        array: "time".to_owned(),
        reason,
    };
    let ends = bounds.iter().copied().skip(1).step_by(2);
    let digests = digests.chunks_exact(DIGEST_BYTES as usize);
    if starts.len() * 2 != bounds.len() || digests.len() != starts.len() {
        return Err(foreign("its arrays differ in length".to_owned()));
    }
    let mut steps: Vec<Step> = Vec::with_capacity(starts.len());
    for ((start, end), digest) in starts.into_iter().zip(ends).zip(digests) {
        let period = TimeMs::new(start)
            .and_then(|start| Period::new(start, TimeMs::new(end)?))
            .map_err(|e| foreign(e.to_string()))?;
        if let Some(before) = steps.last()
            && period.start < before.period.end
        {
            let reason = format!("{period} follows {}", before.period);
            return Err(foreign(reason));
        }
        let digest: [u8; DIGEST_BYTES as usize] = digest.try_into().unwrap_or_default();
        steps.push(Step {
            period,
            values_sha256: Digest::from_bytes(digest),
        });
    }
    Ok(steps)
}

/// Numbers of an array along time; `blank` is what a chunk holds that is not stored, none if every chunk must be.
pub(crate) async fn read_array<S, T>(
    store: &Arc<S>,
    definition: &Definition,
    place: &str,
    blank: Option<T>,
) -> Result<Vec<T>, CubeError>
where
    S: AsyncReadableStorageTraits + 'static,
    T: ElementOwned + Copy + Send + Sync,
{
    let array = open(store, definition, place).await?;
    let steps = array.shape()[0];
    if steps > MOST_STEPS {
        return Err(CubeError::Foreign {
            place: place.to_owned(),
            array: arrays::name(definition),
            reason: format!("{steps} steps are more than {MOST_STEPS}"),
        });
    }
    let chunk_steps = chunk_steps(definition)? as u64;
    let a_step: u64 = array.shape()[1..].iter().product();
    let mut chunks = stream::iter(0..steps.div_ceil(chunk_steps))
        .map(|chunk| read_chunk::<S, T>(&array, chunk).boxed())
        .buffered(CHUNKS_AT_ONCE);
    let mut all = vec![];
    let mut chunk = 0;
    while let Some(found) = chunks.try_next().await? {
        let numbers = match (found, blank) {
            (Some(numbers), _) => numbers,
            (None, Some(blank)) => vec![blank; (chunk_steps * a_step) as usize],
            (None, None) => return Err(unread(&array, chunk, "it is not there".to_owned())),
        };
        all.extend(numbers);
        chunk += 1;
    }
    all.truncate((steps * a_step) as usize);
    Ok(all)
}

fn chunk_index<S: ?Sized>(array: &Array<S>, chunk: u64) -> Vec<u64> {
    let mut index = vec![0; array.dimensionality()];
    index[0] = chunk;
    index
}

fn unread<S: ?Sized>(array: &Array<S>, chunk: u64, reason: String) -> CubeError {
    CubeError::chunk(arrays::name(array), chunk_index(array, chunk), reason)
}

/// Reads a chunk along time as a whole, for then its checksum is compared; none if the array has none there.
pub(crate) async fn read_chunk<S, T>(
    array: &Array<S>,
    chunk: u64,
) -> Result<Option<Vec<T>>, CubeError>
where
    S: AsyncReadableStorageTraits + 'static,
    T: ElementOwned + Send + Sync,
{
    let index = chunk_index(array, chunk);
    let found = array.async_retrieve_chunk_if_exists::<Vec<T>>(&index).await;
    found.map_err(|e| unread(array, chunk, first_lines(&e)))
}

/// Opens an array that must be what it is defined to be.
pub(crate) async fn open<S>(
    store: &Arc<S>,
    definition: &Definition,
    place: &str,
) -> Result<Array<S>, CubeError>
where
    S: AsyncReadableStorageTraits + 'static,
{
    let path = definition.path().as_str();
    let opened = Array::async_open(Arc::clone(store), path).await;
    let array = opened.map_err(|e| CubeError::foreign(place, arrays::name(definition), e))?;
    arrays::check(&array, definition, place)?;
    Ok(array)
}

/// Steps in a chunk of an array along time.
pub(crate) fn chunk_steps(definition: &Definition) -> Result<usize, CubeError> {
    let index = vec![0; definition.dimensionality()];
    let shape = definition.chunk_shape(&index);
    let shape =
        shape.map_err(|e| CubeError::library(&arrays::name(definition), "its chunks", e))?;
    Ok(shape[0].get() as usize)
}

#[cfg(test)]
mod tests {
    use contract::analysis::MapStatistic;
    use contract::grid::Grid;
    use icechunk::format::{ChunkIndices, Path};
    use storage::Store;
    use zarrs_icechunk::AsyncIcechunkStore;

    use super::*;
    use crate::group::write_group;
    use crate::plan::Plan;
    use crate::state::State;
    use crate::{At, Edit, Repository};

    const GRID: Grid = Grid {
        rows: 4,
        cols: 8,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 45.0,
        dlon_deg: 45.0,
    };

    fn description(quantity: Quantity, statistic: Option<MapStatistic>) -> Description {
        Description {
            product: "p".parse().unwrap(),
            title: "P".to_owned(),
            quantity,
            synthetic: true,
            source: "a test".to_owned(),
            grid: GRID,
            version: None,
            statistic,
        }
    }

    /// A cube of January 1970.
    async fn cube(quantity: Quantity) -> Repository {
        cube_of(&Store::memory(), &description(quantity, None), 1).await
    }

    /// A cube of the first months of 1970.
    async fn cube_of(store: &Store, description: &Description, months: u32) -> Repository {
        let created = Repository::create(store, "p", description).await;
        let repository = created.unwrap();
        put(&repository, 1..=months).await;
        repository
    }

    async fn put(repository: &Repository, months: std::ops::RangeInclusive<u32>) {
        let mut edit = Edit::begin(repository).await.unwrap();
        for month in months {
            let values: Arc<[f32]> = vec![month as f32; GRID.cell_count()].into();
            let period = Period::month(1970, month).unwrap();
            edit.put(period, values).await.unwrap();
        }
        edit.commit("steps").await.unwrap();
    }

    /// Instants of an array along time.
    async fn instants(
        repository: &Repository,
        of: impl Fn(&arrays::Axis) -> &Definition,
    ) -> Vec<i64> {
        let session = repository.session().await.unwrap();
        let store = Arc::new(AsyncIcechunkStore::from(session));
        let axis = arrays::axis(false, 1).unwrap();
        read_array(&store, of(&axis), "p", None).await.unwrap()
    }

    /// Middles of months, and where they begin and end.
    fn of_months(months: std::ops::RangeInclusive<u32>) -> (Vec<i64>, Vec<i64>) {
        let periods = months.map(|month| Period::month(1970, month).unwrap());
        let both = periods.map(|own| (own.mid().ms(), [own.start.ms(), own.end.ms()]));
        let (middles, bounds): (Vec<i64>, Vec<[i64; 2]>) = both.unzip();
        (middles, bounds.concat())
    }

    #[tokio::test]
    async fn a_statistic_of_sums_is_of_its_own_time_and_no_sum_since_the_first_step() {
        let statistic = Some(MapStatistic::Climatology);
        let own = description(Quantity::AccumulatedCarbon, statistic);
        let repository = cube_of(&Store::memory(), &own, 3).await;
        let (middles, bounds) = of_months(1..=3);
        assert_eq!(instants(&repository, |axis| &axis.time).await, middles);
        assert_eq!(instants(&repository, |axis| &axis.bounds).await, bounds);
        let cube = repository.at(&At::Newest).await.unwrap();
        let months: Vec<Period> = cube.steps().iter().map(|step| step.period).collect();
        assert_eq!(
            months,
            [1, 2, 3].map(|month| Period::month(1970, month).unwrap())
        );
    }

    /// A statistic of the first three months, as cubes of such were written before they were told from sums.
    async fn written_as_a_sum() -> Repository {
        let own = |statistic| description(Quantity::AccumulatedCarbon, statistic);
        let place = Store::memory();
        let repository = cube_of(&place, &own(None), 3).await;
        let session = repository.session().await.unwrap();
        let store = Arc::new(AsyncIcechunkStore::from(Arc::clone(&session)));
        let said = own(Some(MapStatistic::Climatology)).attributes();
        write_group(&store, "", said).await.unwrap();
        let mut session = session.write().await;
        session.commit("as before").execute().await.unwrap();
        drop(session);
        Repository::open(&place, "p").await.unwrap()
    }

    /// Has a cube the first months, each of its own time, and no starts of steps beside their bounds?
    async fn is_of_months(repository: &Repository, months: std::ops::RangeInclusive<u32>) {
        let (middles, bounds) = of_months(months.clone());
        assert_eq!(instants(repository, |axis| &axis.time).await, middles);
        assert_eq!(instants(repository, |axis| &axis.bounds).await, bounds);
        let cube = repository.at(&At::Newest).await.unwrap();
        let found: Vec<Period> = cube.steps().iter().map(|step| step.period).collect();
        let months = months.map(|month| Period::month(1970, month).unwrap());
        assert_eq!(found, months.collect::<Vec<_>>());
        let session = cube.session();
        let path = Path::new("/step_start").unwrap();
        assert!(session.read().await.get_node(&path).await.is_err());
    }

    #[tokio::test]
    async fn a_statistic_that_was_written_as_a_sum_is_read_and_its_next_step_makes_it_right() {
        let repository = written_as_a_sum().await;
        let cube = repository.at(&At::Newest).await.unwrap();
        let found: Vec<Period> = cube.steps().iter().map(|step| step.period).collect();
        let month = |month| Period::month(1970, month).unwrap();
        assert_eq!(found, [1, 2, 3].map(month));
        put(&repository, 4..=4).await;
        is_of_months(&repository, 1..=4).await;
    }

    /// As of a version that has the same steps: times are written from the first one on, and not from the first that is another.
    #[tokio::test]
    async fn a_statistic_that_was_written_as_a_sum_is_made_right_where_no_step_is_another() {
        let repository = written_as_a_sum().await;
        let written = [1, 2, 3].map(|month| Period::month(1970, month).unwrap().end.ms());
        let before = instants(&repository, |axis| &axis.time).await;
        assert_eq!(before, written, "it is no sum: this test tests nothing");
        let edit = Edit::begin(&repository).await.unwrap();
        let state = State::newest(&repository).await.unwrap();
        let plan = Plan::exactly(&state.steps, &state.steps, edit.staged()).unwrap();
        assert_eq!(plan.first_change(&state.steps), None);
        let laid = edit.lay(&state, &plan, "another version").await.unwrap();
        assert!(laid.is_some());
        is_of_months(&repository, 1..=3).await;
    }

    #[tokio::test]
    async fn a_chunk_of_periods_or_digests_that_is_lost_is_told_and_no_zeros() {
        for name in ["time_bnds", "values_sha256"] {
            let repository = cube(Quantity::CarbonFlux).await;
            assert!(repository.at(&At::Newest).await.is_ok());
            let session = repository.session().await.unwrap();
            let mut session = session.write().await;
            let path = Path::new(&format!("/{name}")).unwrap();
            let first = ChunkIndices(vec![0, 0]);
            let is_there = session.get_chunk_ref(&path, &first).await.unwrap();
            assert!(is_there.is_some(), "{name}");
            session.set_chunk_ref(path, first, None).await.unwrap();
            session.commit("a chunk less").execute().await.unwrap();
            drop(session);
            let told = repository.at(&At::Newest).await.map(|_cube| ());
            let told = told.unwrap_err().to_string();
            assert!(
                told.contains(name) && told.contains("it is not there"),
                "{told}"
            );
        }
    }

    /// Two chunks, of which the first is of zeros alone.
    #[tokio::test]
    async fn a_chunk_of_zeros_that_is_not_stored_is_as_long_as_others() {
        let repository = cube(Quantity::CarbonFlux).await;
        let session = repository.session().await.unwrap();
        let store = Arc::new(AsyncIcechunkStore::from(session));
        let root = serde_json::Map::new();
        write_group(&store, arrays::LEVELS, root).await.unwrap();
        let steps = arrays::TIME_CHUNK as usize + 6;
        let definition = arrays::level_ranges(steps).unwrap();
        let mut numbers = vec![0.0; 2 * steps];
        for (index, number) in numbers.iter_mut().enumerate().skip(2 * (steps - 6)) {
            *number = index as f32;
        }
        let all = (&numbers[..], 2);
        write_numbers(&store, &definition, all, 0).await.unwrap();
        let asked = arrays::level_ranges(1).unwrap();
        let found: Vec<f32> = read_array(&store, &asked, "p", Some(0.0)).await.unwrap();
        let bits = |all: &[f32]| all.iter().map(|it| it.to_bits()).collect::<Vec<_>>();
        assert!(bits(&found) == bits(&numbers), "{} numbers", found.len());
        let lost = read_array::<_, f32>(&store, &asked, "p", None).await;
        assert!(lost.unwrap_err().to_string().contains("it is not there"));
    }

    /// Their first chunk is of zeros alone, which are not stored.
    #[tokio::test]
    async fn starts_of_sums_since_1970_are_no_lost_chunk() {
        let repository = cube(Quantity::AccumulatedCarbon).await;
        let session = repository.session().await.unwrap();
        let path = Path::new("/step_start").unwrap();
        let first = ChunkIndices(vec![0]);
        let stored = session.read().await.get_chunk_ref(&path, &first).await;
        assert!(stored.unwrap().is_none(), "it is stored");
        let cube = repository.at(&At::Newest).await.unwrap();
        assert_eq!(cube.steps()[0].period, Period::month(1970, 1).unwrap());
    }
}
