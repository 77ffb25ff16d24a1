//! Coarser levels of the steps of a cube: of which steps they are there, and the arrays that they lie in.
//!
//! Levels of a step carry the digest of the values that they were made of, and are those of the step in their place only where that
//! is its digest: whoever changes steps without knowing of levels leaves some that nobody takes.

use std::collections::BTreeSet;
use std::sync::Arc;

use contract::digest::Digest;
use contract::level;
use icechunk::format::{ChunkIndices, Path};
use icechunk::session::{Session, SessionErrorKind};
use serde_json::{Map, Value, json};
use tokio::sync::RwLock;
use zarrs::group::Group;
use zarrs::storage::AsyncReadableStorageTraits;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::arrays::{self, DIGEST_BYTES, DIGEST_CHUNK, Definition, LEVELS};
use crate::joining::Method;
use crate::rounding::KEPT_BITS;
use crate::{CubeError, Description, Step, axis, cf, group, names, plain};

/// Version of what levels hold: those of another are not read, and made anew.
const LAYOUT: u32 = 1;
/// Attribute of the group that holds what this program reads.
const ATTRIBUTE: &str = "fluxglobe_levels";

/// What levels of a step were made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MadeOf {
    /// Digest of the values.
    pub(crate) values_sha256: Digest,
    /// Smallest and largest value, 0 and 0 without data.
    pub(crate) range: [f32; 2],
}

/// What a state of a cube has of levels.
#[derive(Debug, Clone, Default)]
pub(crate) struct Levels {
    /// Of each step what its levels were made of; none where they are not there.
    made_of: Vec<Option<MadeOf>>,
    /// Is the group there, as this program writes it?
    pub(crate) is_there: bool,
    /// Is it there in another layout?
    is_foreign: bool,
}

impl Levels {
    /// Reads which there are. Digests that are by reference those of the steps of the state are not read again.
    pub(crate) async fn read<S>(
        session: &Session,
        store: &Arc<S>,
        description: &Description,
        steps: &[Step],
        place: &str,
    ) -> Result<Self, CubeError>
    where
        S: AsyncReadableStorageTraits + 'static,
    {
        match session.get_node(&path(LEVELS)?).await {
            Ok(_group) => {}
            Err(e) if matches!(e.kind, SessionErrorKind::NodeNotFound { .. }) => {
                return Ok(Self::default());
            }
            Err(e) => return Err(CubeError::library(place, "looking for levels", e)),
        }
        let group = Group::async_open(Arc::clone(store), &format!("/{LEVELS}")).await;
        let group = group.map_err(|e| CubeError::foreign(place, LEVELS.to_owned(), e))?;
        if group.attributes().get(ATTRIBUTE) != Some(&written(description)) {
            return Ok(Self {
                is_foreign: true,
                ..Self::default()
            });
        }
        let shared = shared_chunks(session, description, steps.len()).await?;
        let known = |chunk: u64| shared.contains(&chunk).then(|| digests(chunk, steps));
        let names = names::read(store, &arrays::level_names(1)?, place, &known).await?;
        let ranges = arrays::level_ranges(1)?;
        // Zeros alone are not stored: of steps that have no levels yet, or no other value.
        let ranges: Vec<f32> = axis::read_array(store, &ranges, place, Some(0.0)).await?;
        let (ranges, _rest) = ranges.as_chunks::<2>();
        let made_of = |(name, range): (Option<Digest>, &[f32; 2])| {
            name.map(|values_sha256| MadeOf {
                values_sha256,
                range: *range,
            })
        };
        Ok(Self {
            made_of: names.into_iter().zip(ranges).map(made_of).collect(),
            is_there: true,
            is_foreign: false,
        })
    }

    /// What levels in a place were made of.
    pub(crate) fn made_of(&self, place: usize) -> Option<MadeOf> {
        self.made_of.get(place).copied().flatten()
    }

    /// The same, if that is this step.
    pub(crate) fn of(&self, place: usize, step: &Step) -> Option<MadeOf> {
        let own = self.made_of(place);
        own.filter(|own| own.values_sha256 == step.values_sha256)
    }

    /// Makes room for levels of so many steps: the groups, coordinates and arrays, where they are not there yet or shorter.
    pub(crate) async fn make_room(
        &self,
        session: &RwLock<Session>,
        store: &Arc<AsyncIcechunkStore>,
        description: &Description,
        steps: usize,
    ) -> Result<(), CubeError> {
        if self.is_foreign {
            let gone = session.write().await.delete_group(path(LEVELS)?).await;
            gone.map_err(|e| CubeError::library(LEVELS, "removing", e))?;
        }
        if !self.is_there {
            group::write_group(store, "", with_levels(description)).await?;
            group::write_group(store, LEVELS, attributes(description)).await?;
        }
        for level in level::levels(&description.grid) {
            if !self.is_there {
                let group = arrays::level_group(&level);
                group::write_group(store, &group, level_attributes(description, &level)).await?;
                plain::write_fixed(store, arrays::level_fixed(description, &level)?).await?;
            }
            let values = arrays::level_values(description, &level, steps as u64)?;
            describe(store, &values).await?;
            let coverage = arrays::level_coverage(description, &level, steps as u64)?;
            describe(store, &coverage).await?;
        }
        Ok(())
    }

    /// Says of which steps levels are there, in the place of what was said: `after` has one for each step. Times of levels are
    /// those of the cube, by reference, from the first step on that is another one, and so are digests where all steps of a chunk have
    /// levels.
    pub(crate) async fn write(
        &self,
        session: &RwLock<Session>,
        store: &Arc<AsyncIcechunkStore>,
        description: &Description,
        (after, steps, first_step): (&[Option<MadeOf>], &[Step], usize),
    ) -> Result<(), CubeError> {
        let mut pairs = self.made_of.iter().zip(after);
        let differs = pairs.position(|(before, after)| before != after);
        let first = differs.unwrap_or(self.made_of.len().min(after.len()));
        let names = after.iter().map(|own| own.map(|own| own.values_sha256));
        let names: Vec<Option<Digest>> = names.collect();
        let array = arrays::level_names(after.len())?;
        let own = arrays::axis(description.is_sum(), steps.len() as u64)?;
        let in_chunk = axis::chunk_steps(&array)?;
        let of_chunk = |chunk: usize| {
            let places = chunk * in_chunk..names.len().min((chunk + 1) * in_chunk);
            let mut pairs = names[places.clone()].iter().zip(&steps[places]);
            pairs.all(|(name, step)| *name == Some(step.values_sha256))
        };
        names::write(store, array, (&names, first), &of_chunk).await?;
        let array = arrays::level_names(after.len())?;
        for chunk in first / in_chunk..names.len().div_ceil(in_chunk) {
            if of_chunk(chunk) {
                let places = chunk * in_chunk..(chunk + 1) * in_chunk;
                refer(session, &own.digests, &array, places).await?;
            }
        }
        let ranges = after
            .iter()
            .flat_map(|own| own.map_or([0.0; 2], |own| own.range));
        let ranges: Vec<f32> = ranges.collect();
        let array = arrays::level_ranges(after.len())?;
        axis::write_numbers(store, &array, (&ranges, 2), first).await?;
        // Who changed steps and knew of no levels left their times as they were.
        let first_step = if self.is_there {
            first_step.min(first)
        } else {
            0
        };
        let steps = steps.len();
        for level in level::levels(&description.grid) {
            let copies = arrays::level_axis(&level, description.is_sum(), steps as u64)?;
            for (from, to) in [&own.time, &own.bounds].into_iter().zip(copies) {
                describe(store, &to).await?;
                refer(session, from, &to, first_step..steps).await?;
            }
        }
        Ok(())
    }

    /// Removes what lies behind so many steps: of what levels were made of, and of their times, whose arrays become shorter.
    pub(crate) async fn cut_off(
        &self,
        session: &RwLock<Session>,
        description: &Description,
        (before, after): (usize, usize),
    ) -> Result<(), CubeError> {
        let mut all = vec![arrays::level_names(before)?, arrays::level_ranges(before)?];
        for level in level::levels(&description.grid) {
            all.extend(arrays::level_axis(
                &level,
                description.is_sum(),
                before as u64,
            )?);
        }
        for array in all {
            let steps = axis::chunk_steps(&array)?;
            let behind = after.div_ceil(steps)..before.div_ceil(steps);
            let behind = behind.map(|chunk| index(&array, chunk));
            let own = path(array.path().as_str().trim_start_matches('/'))?;
            let behind: Vec<ChunkIndices> = behind.collect();
            let mut session = session.write().await;
            let cut = session.delete_chunks(&own, behind).await;
            cut.map_err(|e| CubeError::library(LEVELS, "removing", e))?;
        }
        Ok(())
    }
}

/// Chunks of digests of levels that are those of the steps themselves: [`Levels::write`] refers to them.
async fn shared_chunks(
    session: &Session,
    description: &Description,
    steps: usize,
) -> Result<BTreeSet<u64>, CubeError> {
    let names = arrays::level_names(1)?;
    let own = arrays::axis(description.is_sum(), 1)?.digests;
    let [names_path, own_path] =
        [&names, &own].map(|array| path(array.path().as_str().trim_start_matches('/')));
    let (names_path, own_path) = (names_path?, own_path?);
    let mut shared = BTreeSet::new();
    for chunk in 0..steps.div_ceil(axis::chunk_steps(&names)?) {
        // What cannot be looked up is told of when it is read.
        let at = index(&names, chunk);
        let Ok(Some(there)) = session.get_chunk_ref(&names_path, &at).await else {
            continue;
        };
        let own = session.get_chunk_ref(&own_path, &at).await;
        if own.is_ok_and(|own| own == Some(there)) {
            shared.insert(chunk as u64);
        }
    }
    Ok(shared)
}

/// A chunk of digests of steps as it is stored: zeros behind the last one.
fn digests(chunk: u64, steps: &[Step]) -> Vec<u8> {
    let in_chunk = DIGEST_CHUNK as usize;
    let own = steps.iter().skip(chunk as usize * in_chunk).take(in_chunk);
    let bytes = own.flat_map(|step| *step.values_sha256.as_bytes());
    let mut bytes: Vec<u8> = bytes.collect();
    bytes.resize((DIGEST_CHUNK * DIGEST_BYTES) as usize, 0);
    bytes
}

/// Writes what an array is like.
async fn describe(store: &Arc<AsyncIcechunkStore>, array: &Definition) -> Result<(), CubeError> {
    let array = array.with_storage(Arc::clone(store));
    let stored = array.async_store_metadata().await;
    stored.map_err(|e| CubeError::library(&arrays::name(&array), "writing", e))
}

/// Has chunks along time of an array hold what those of another one do.
async fn refer(
    session: &RwLock<Session>,
    from: &Definition,
    to: &Definition,
    steps: std::ops::Range<usize>,
) -> Result<(), CubeError> {
    let failed = |e: &dyn std::fmt::Display| CubeError::library(&arrays::name(to), "writing", e);
    let in_chunk = axis::chunk_steps(from)?;
    let [from_path, to_path] =
        [from, to].map(|array| path(array.path().as_str().trim_start_matches('/')));
    let (from_path, to_path) = (from_path?, to_path?);
    for chunk in steps.start / in_chunk..steps.end.div_ceil(in_chunk) {
        let mut session = session.write().await;
        let payload = session.get_chunk_ref(&from_path, &index(from, chunk)).await;
        let payload = payload.map_err(|e| failed(&e))?;
        let set = session.set_chunk_ref(to_path.clone(), index(to, chunk), payload);
        set.await.map_err(|e| failed(&e))?;
    }
    Ok(())
}

fn index(array: &Definition, chunk: usize) -> ChunkIndices {
    let mut index = vec![0; array.dimensionality()];
    index[0] = chunk as u32;
    ChunkIndices(index)
}

fn path(name: &str) -> Result<Path, CubeError> {
    let path = Path::new(&format!("/{name}"));
    path.map_err(|e| CubeError::library(name, "naming levels", e))
}

/// What this program compares before it reads levels.
fn written(description: &Description) -> Value {
    let method = Method::of(description.quantity).name();
    json!({ "layout": LAYOUT, "method": method, "kept_bits": KEPT_BITS })
}

fn attributes(description: &Description) -> Map<String, Value> {
    let comment = "coarser levels of the values, a group each; docs/decisions/032-levels.md of Fluxglobe says how they are made";
    cf::attributes(json!({ ATTRIBUTE: written(description), "comment": comment }))
}

fn level_attributes(description: &Description, level: &level::Level) -> Map<String, Value> {
    let [down, across] = level.cells;
    let comment = format!(
        "blocks of {down} x {across} cells of the values, fewer at the southern and eastern edges"
    );
    cf::attributes(json!({
        "Conventions": "CF-1.11",
        "title": format!("{}, level {}", description.title, level.number),
        "comment": comment,
    }))
}

/// Attributes of the group of all, with what the multiscales convention (zarr-conventions, v0.1) wants to be told of the levels. Its schema
/// knows them by these very addresses.
pub(crate) fn with_levels(description: &Description) -> Map<String, Value> {
    let mut attributes = description.attributes();
    let levels = level::levels(&description.grid);
    if levels.is_empty() {
        return attributes;
    }
    let method = Method::of(description.quantity).name();
    let variable = cf::variable(description.quantity);
    let asset = |level: &level::Level| format!("{}/{variable}", arrays::level_group(level));
    let mut layout = vec![json!({ "asset": variable, "transform": { "scale": [1.0, 1.0, 1.0] } })];
    let (mut from, mut before) = (variable.clone(), [1, 1]);
    for level in &levels {
        // Cells of the level below in one of this one, and where the middle of the first one lies among them.
        let scale = [0, 1].map(|side| f64::from(level.cells[side] / before[side]));
        let middle = scale.map(|cells| (cells - 1.0) / 2.0);
        layout.push(json!({
            "asset": asset(level),
            "derived_from": from,
            "transform": {
                "scale": [1.0, scale[0], scale[1]],
                "translation": [0.0, middle[0], middle[1]],
            },
            "resampling_method": method,
        }));
        (from, before) = (asset(level), level.cells);
    }
    let convention = json!([{
        "schema_url": "https://raw.githubusercontent.com/zarr-conventions/multiscales/refs/tags/v0.1/schema.json",
        "spec_url": "https://github.com/zarr-conventions/multiscales/blob/v0.1/README.md",
        "uuid": "d35379db-88df-4056-af3a-620245f8e347",
        "name": "multiscales",
        "description": "Multiscale layout of zarr datasets",
    }]);
    attributes.insert("zarr_conventions".to_owned(), convention);
    let multiscales = json!({ "layout": layout, "resampling_method": method });
    attributes.insert("multiscales".to_owned(), multiscales);
    attributes
}

#[cfg(test)]
mod tests;
