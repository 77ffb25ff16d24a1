//! A product whose values lie in fields alone in, its cube with every kept version out, each compared with its fields bit by bit.
//!
//! Versions are followed oldest first, as if the program of now had published them. Nothing is taken away, and what is there is
//! not made twice: killed anywhere, the same call goes on, and a second one only compares.

use std::collections::BTreeSet;

use contract::chunk::BAND_CELLS;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, ManifestId, Step};
use contract::product::ProductId;
use contract::time::Period;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use serde::Serialize;
use storage::verify::{Fault, Finding};
use storage::{Store, fields, manifests};

use crate::follow::folder;
use crate::step_bands::StepBands;
use crate::{At, Cube, CubeError, Description, Follower, Repository, compact, verify};

/// Steps that are read at a time to be compared, each twice.
const STEPS_AT_ONCE: usize = 2;

/// What is being done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// A version of so many steps begins.
    Version(u64, usize),
    /// A step was put.
    Put(Period),
    /// A step was compared.
    Compared(Period),
    /// Runs of steps are made time-major.
    Compacting,
    /// Objects are compared with their checksums, and runs with their steps.
    Verifying,
}

/// A version that is in the cube.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Version {
    /// Which one.
    pub version: ManifestId,
    /// Its steps.
    pub steps: usize,
    /// Steps that were put for it; the others were there.
    pub put_count: usize,
    /// Steps that were compared with their fields; the others lie where an older version has them, which were compared there.
    pub compared_count: usize,
}

/// A product that was brought over.
#[derive(Debug, Clone, Serialize)]
pub struct Migrated {
    /// All versions that are kept, oldest first.
    pub versions: Vec<Version>,
    /// Runs of steps that were made time-major.
    pub runs: usize,
    /// What is wrong with the cube all the same.
    pub findings: Vec<Finding>,
}

/// Brings a product over; `told` hears of each step.
///
/// # Errors
/// `Differs` with array and step if the cube holds anything else than the fields; a field that is damaged or gone, by its name.
pub async fn migrate(
    store: &Store,
    product: &ProductId,
    told: &(dyn Fn(Stage) + Send + Sync),
) -> Result<Migrated, CubeError> {
    let mut migration = Migration {
        store,
        folder: folder(product),
        told,
        compared: BTreeSet::new(),
    };
    let mut versions = vec![];
    let mut newest = None;
    for number in manifests::numbers(store, product).await? {
        // Clean-up may have taken it meanwhile.
        if let Some(manifest) = manifests::numbered(store, product, number).await? {
            versions.push(Box::pin(migration.version(&manifest)).await?);
            newest = Some(manifest);
        }
    }
    let mut migrated = Migrated {
        versions,
        runs: 0,
        findings: vec![],
    };
    if let Some(newest) = newest {
        told(Stage::Compacting);
        migrated.runs = compact(store, &migration.folder).await?;
        migration.newest(&newest).await?;
        told(Stage::Verifying);
        migrated.findings = migration.verified(product).await?;
    }
    Ok(migrated)
}

struct Migration<'a> {
    store: &'a Store,
    folder: String,
    told: &'a (dyn Fn(Stage) + Send + Sync),
    /// Steps that were compared: their periods, fields and places in the cube.
    compared: BTreeSet<(Period, ObjectKey, usize)>,
}

impl Migration<'_> {
    /// Brings one version over, and compares what no older one has in the same place.
    async fn version(&mut self, manifest: &Manifest) -> Result<Version, CubeError> {
        (self.told)(Stage::Version(manifest.number, manifest.steps.len()));
        let follower = Follower {
            store: self.store,
            folder: &self.folder,
            fields: self.store,
            told: &|period| (self.told)(Stage::Put(period)),
        };
        let followed = follower.keep(manifest).await?;
        let repository = Repository::open(self.store, &self.folder).await?;
        let tag = At::Version(manifest.number.to_string());
        let cube = repository.at(&tag).await?;
        self.describes(&cube, manifest).await?;
        let steps = manifest.steps.iter().enumerate();
        let place = |(place, step): (usize, &Step)| {
            let own = (step.period, step.field.clone(), place);
            self.compared.insert(own).then_some(place)
        };
        let fresh: Vec<usize> = steps.filter_map(place).collect();
        self.compare(&cube, manifest, &fresh).await?;
        Ok(Version {
            version: manifest.id(),
            steps: manifest.steps.len(),
            put_count: followed.put_count,
            compared_count: fresh.len(),
        })
    }

    /// Compares all of the newest state, which readers take first, if that is the newest version's.
    async fn newest(&self, manifest: &Manifest) -> Result<(), CubeError> {
        let repository = Repository::open(self.store, &self.folder).await?;
        let cube = repository.at(&At::Newest).await?;
        let own = cube.description().version.as_ref();
        if own.is_some_and(|own| own.number > manifest.number) {
            // It was published meanwhile, and followed by whoever did that.
            return Ok(());
        }
        self.describes(&cube, manifest).await?;
        let all: Vec<usize> = (0..manifest.steps.len()).collect();
        self.compare(&cube, manifest, &all).await
    }

    /// Is this state that version, with its steps?
    async fn describes(&self, cube: &Cube, manifest: &Manifest) -> Result<(), CubeError> {
        let found = cube.description();
        let mut wanted = Description::of(self.store, manifest).await?;
        let done = manifest.computed.as_ref();
        // Cubes of before say nothing of it, or what was done last.
        if found.statistic.is_none() || found.statistic == done.and_then(|it| it.how.statistic()) {
            wanted.statistic = found.statistic;
        }
        if *found != wanted {
            let of = |it: &Description| {
                let version = it.version.as_ref().map(ToString::to_string);
                let (version, grid) = (version.unwrap_or_default(), it.grid);
                let (rows, cols) = (grid.rows, grid.cols);
                format!("{version:?}, {:?}, {rows} x {cols} cells", it.title)
            };
            let reason = format!("it is of {}, and not of {}", of(found), of(&wanted));
            return Err(self.differs("the group", manifest, reason));
        }
        let found: Vec<Period> = cube.steps().iter().map(|step| step.period).collect();
        let wanted: Vec<Period> = manifest.steps.iter().map(|step| step.period).collect();
        if found == wanted {
            return Ok(());
        }
        let other = found
            .iter()
            .zip(&wanted)
            .find(|(found, wanted)| found != wanted);
        let reason = match other {
            Some((found, wanted)) => format!("step {wanted} is {found} there"),
            None => format!("it has {} steps, not {}", found.len(), wanted.len()),
        };
        Err(self.differs("time", manifest, reason))
    }

    /// Compares some steps of a state with the fields of its version.
    async fn compare(
        &self,
        cube: &Cube,
        manifest: &Manifest,
        places: &[usize],
    ) -> Result<(), CubeError> {
        let read = |place: usize| async move {
            let step = &manifest.steps[place];
            let found = first_difference((self.store, &step.field), (cube, place), BAND_CELLS);
            Ok::<_, CubeError>((step, found.await?))
        };
        let mut steps = stream::iter(places.to_vec())
            .map(read)
            .buffered(STEPS_AT_ONCE);
        while let Some((step, difference)) = steps.try_next().await? {
            if let Some(Difference {
                cell,
                wanted,
                found,
            }) = difference
            {
                let (row, col) = (
                    cell / manifest.grid.cols as usize,
                    cell % manifest.grid.cols as usize,
                );
                let reason = format!(
                    "step {}: the cell of row {row}, column {col} is {found}, and {wanted} in {}",
                    step.period, step.field
                );
                return Err(self.differs(&cube.array_name(), manifest, reason));
            }
            (self.told)(Stage::Compared(step.period));
        }
        Ok(())
    }

    /// What is wrong with objects of the cube, its versions and its runs. That a newer version was published meanwhile is not.
    async fn verified(&self, product: &ProductId) -> Result<Vec<Finding>, CubeError> {
        let keys = self.store.list(&self.folder).await?;
        let damaged = storage::verify::damaged(self.store, keys).await?;
        let checked = verify::check(self.store, product, &damaged).await?;
        let of_objects = damaged.iter().map(|key| Finding {
            key: key.clone(),
            fault: Fault::Damaged,
            reason: "it is not what its checksum says".to_owned(),
        });
        let mut findings: Vec<Finding> = of_objects.collect();
        for finding in &mut findings {
            checked.explain(finding);
        }
        findings.extend(checked.findings);
        findings.retain(|finding| finding.fault != Fault::Behind);
        Ok(findings)
    }

    fn differs(&self, array: &str, manifest: &Manifest, reason: String) -> CubeError {
        CubeError::Differs {
            place: self.folder.clone(),
            array: array.to_owned(),
            version: manifest.id().to_string(),
            reason,
        }
    }
}

/// Where a step of a cube is not what its field is.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Difference {
    /// Counted row by row.
    cell: usize,
    /// In the field.
    wanted: f32,
    /// In the cube.
    found: f32,
}

/// The first cell of a step that has other bits in its field. Both are read in bands of at most so many cells or one row of their chunks,
/// and to their ends: what is not what its own name says is told as that.
async fn first_difference(
    (store, field): (&Store, &ObjectKey),
    (cube, place): (&Cube, usize),
    most_cells: u64,
) -> Result<Option<Difference>, CubeError> {
    let grid = cube.description().grid;
    let mut step = StepBands::of(cube, place, most_cells);
    let opened = fields::bands(store, field, &grid, most_cells);
    let (opened, first) = futures::join!(opened, step.next());
    let (mut field, first) = (opened?, first?);
    let mut found = first.map_or_else(Vec::new, |(_rows, values)| values);
    // Of the values that were found, of all.
    let (mut at, mut cell) = (0, 0);
    let mut difference = None;
    while let Some((_rows, wanted)) = field.next().await? {
        let mut done = 0;
        while done < wanted.len() {
            if at == found.len() {
                let Some((_rows, values)) = step.next().await? else {
                    return Err(CubeError::Shape {
                        expected: grid.cell_count(),
                        found: cell,
                    });
                };
                (found, at) = (values, 0);
            }
            let count = (wanted.len() - done).min(found.len() - at);
            let (one, other) = (&wanted[done..][..count], &found[at..][..count]);
            if difference.is_none() {
                let mut pairs = one.iter().zip(other);
                let off = pairs.position(|(one, other)| one.to_bits() != other.to_bits());
                difference = off.map(|off| Difference {
                    cell: cell + off,
                    wanted: one[off],
                    found: other[off],
                });
            }
            (done, at, cell) = (done + count, at + count, cell + count);
        }
    }
    // Its digest is compared behind the last one.
    step.next().await?;
    Ok(difference)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use contract::quantity::Quantity;

    use super::*;
    use crate::Edit;
    use crate::banded_field::{GRID, description, values};

    async fn cube_of(store: &Store, values: Vec<f32>, period: Period) -> Cube {
        let description = description(Quantity::CarbonFlux);
        let repository = Repository::create(store, "cubes/p", &description).await;
        let repository = repository.unwrap();
        let mut edit = Edit::begin(&repository).await.unwrap();
        edit.put(period, Arc::from(values)).await.unwrap();
        edit.commit("one").await.unwrap();
        repository.at(&At::Newest).await.unwrap()
    }

    #[tokio::test]
    async fn the_first_cell_that_differs_is_the_same_in_bands_of_any_size() {
        let period = Period::month(2000, 1).unwrap();
        for most_cells in [1, 3 * 60 * 600, u64::MAX] {
            let (store, product) = (Store::memory(), "p".parse().unwrap());
            let field = fields::write(&store, &product, &GRID, &values(), period).await;
            let field = field.unwrap();
            let cube = cube_of(&store, values(), period).await;
            let same = first_difference((&store, &field), (&cube, 0), most_cells).await;
            assert_eq!(same.unwrap(), None, "{most_cells}");

            let mut others = values();
            // In the second row of chunks of the cube, and in the last.
            for cell in [700 * 600 + 7, 1029 * 600 + 8] {
                others[cell] = -1.0;
            }
            let lying = Store::memory();
            let cube = cube_of(&lying, others.clone(), period).await;
            let other = first_difference((&store, &field), (&cube, 0), most_cells).await;
            let expected = Difference {
                cell: 700 * 600 + 7,
                wanted: (700 * 600 + 7) as f32,
                found: -1.0,
            };
            assert_eq!(other.unwrap(), Some(expected), "{most_cells}");

            // Sound chunks, and not those of the field's name: it is the field that is told of.
            let own = fields::write(&store, &product, &GRID, &others, period).await;
            let content = store.get(&own.unwrap()).await.unwrap();
            store.put_over(&field, content).await.unwrap();
            let told = first_difference((&store, &field), (&cube, 0), most_cells).await;
            let told = told.unwrap_err().to_string();
            assert!(told.contains(field.as_str()), "{told}");
        }
    }
}
