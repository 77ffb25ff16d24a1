//! New [`Reading`]s of files that a product holds in, its next manifest out: it changes whole, and only if something is
//! other than it was.

use std::collections::{BTreeMap, BTreeSet};

use contract::digest::Digest;
use contract::grid::Grid;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::notice::{NoticeOrder, NoticeRun};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use storage::{StorageError, Store, manifests};

use super::merge::{Taken, is_equal_grid, is_same_grid};
use super::{ATTEMPTS, extent, race_lost};
use crate::error::IngestError;
use crate::limits::gates::Gates;
use crate::limits::memory;
use crate::put::reading::Reading;

/// Publishes readings in the place of what their files were read as before; none if nothing is other than before.
///
/// What other writers publish meanwhile stays: a file that was revised keeps its revision. It waits for the memory that
/// reading maps takes, as a landing does.
pub(crate) async fn replace(
    store: &Store,
    gates: &Gates,
    product: &ProductId,
    readings: &[Reading],
) -> Result<Option<Manifest>, IngestError> {
    let mut pauses = ATTEMPTS.pauses();
    loop {
        let newest = manifests::latest(store, product)
            .await
            .map_err(IngestError::storage("read the newest manifest"))?;
        let Some(newest) = newest else {
            return Ok(None);
        };
        let mut next = next(&newest, readings).map_err(|detail| IngestError::Reread {
            product: product.to_string(),
            detail,
        })?;
        if next == newest {
            return Ok(None);
        }
        let _memory = gates.memory(memory::of_fields(&next.grid)).await;
        let domain = extent::write(store, product, &next.grid, Some(&newest), &next.steps);
        (next.domain, next.series) = (domain.await?, vec![]);
        (next.schema, next.number) = (MANIFEST_SCHEMA, newest.number + 1);
        match manifests::commit(store, &next).await {
            Ok(version) => {
                cube::keep_up_as(store, &next, &version).await;
                return Ok(Some(next));
            }
            Err(StorageError::Conflict { .. }) => race_lost(product, &mut pauses).await?,
            Err(source) => {
                let action = "publish a manifest";
                return Err(IngestError::Storage { action, source });
            }
        }
    }
}

/// What tells files apart: the same bytes under another name may be of another month.
pub(super) fn file_of(step: &Step) -> (Digest, &str) {
    (step.raw_sha256, &step.origin)
}

/// What each file holds, and its latest place in the order of notices.
#[expect(
    clippy::type_complexity,
    reason = "two maps by file, named where they are taken"
)]
fn files_of<'a>(
    newest: &'a Manifest,
    before: &[Option<NoticeOrder>],
) -> (
    BTreeMap<(Digest, &'a str), BTreeSet<Period>>,
    BTreeMap<(Digest, &'a str), Option<NoticeOrder>>,
) {
    let mut held: BTreeMap<_, BTreeSet<Period>> = BTreeMap::new();
    let mut orders: BTreeMap<_, Option<NoticeOrder>> = BTreeMap::new();
    for (step, order) in newest.steps.iter().zip(before) {
        held.entry(file_of(step)).or_default().insert(step.period);
        let latest = orders.entry(file_of(step)).or_default();
        *latest = (*order).max(*latest);
    }
    (held, orders)
}

/// The newest manifest with other steps; its number, series and domain are still the old ones. Pure.
///
/// First every file gets the steps that it had and has, then those that are new, as far as no other file has their time:
/// that one revised them.
fn next(newest: &Manifest, readings: &[Reading]) -> Result<Manifest, String> {
    let before = newest.notice_orders();
    let (held, orders) = files_of(newest, &before);
    // What a file that holds nothing (any more) was read as is nobody's business.
    let taken: Vec<&Reading> = readings
        .iter()
        .filter(|reading| held.contains_key(&file_of(&reading.steps[0])))
        .collect();
    let Some(first) = taken.first() else {
        return Ok(newest.clone());
    };
    let anew: BTreeSet<_> = taken.iter().map(|r| file_of(&r.steps[0])).collect();
    let kept = newest.steps.iter();
    let mut steps: Vec<Step> = kept
        .filter(|step| !anew.contains(&file_of(step)))
        .cloned()
        .collect();
    let is_whole = steps.is_empty();
    let quantity = quantity_of(newest, &taken, is_whole)?;
    let mut later = vec![];
    for reading in &taken {
        let held = &held[&file_of(&reading.steps[0])];
        let (had, new): (Vec<&Step>, Vec<&Step>) = reading
            .steps
            .iter()
            .partition(|step| held.contains(&step.period));
        later.push((reading, new, !had.is_empty()));
        steps.extend(had.into_iter().cloned());
    }
    let mut occupied = Taken::default();
    for step in &steps {
        occupied.insert(step.period);
    }
    for (reading, new, mut is_placed) in later {
        for step in new {
            if !occupied.overlaps(step.period) {
                occupied.insert(step.period);
                steps.push(step.clone());
                is_placed = true;
            }
        }
        if !is_placed {
            let first = &reading.steps[0];
            return Err(format!(
                "{} is of {} now, which another file has; recompute all of the product, or land that file again",
                first.origin, first.period
            ));
        }
    }
    steps.sort_by_key(|step| step.period);
    // Reading a file anew does not make it a newer one: its steps keep its place in the order of notices.
    let place = |step: &Step| match newest.step_of(step.period) {
        Some(index) if file_of(&newest.steps[index]) == file_of(step) => before[index],
        _ => orders.get(&file_of(step)).copied().flatten(),
    };
    let places: Vec<_> = steps.iter().map(place).collect();
    let mut next = Manifest {
        notices: NoticeRun::of(&places),
        quantity,
        synthetic: first.synthetic,
        steps,
        ..newest.clone()
    };
    if is_whole {
        next.grid = grid_of(newest, &taken);
    }
    // Titles can differ from file to file: that of the last step is the product's, whatever part was read anew.
    let last = next.steps.last().map(file_of);
    if let Some(last) = taken.iter().find(|r| Some(file_of(&r.steps[0])) == last) {
        next.title.clone_from(&last.title);
        next.source.clone_from(&last.source);
    }
    Ok(next)
}

/// The grid of a product of which all files were read anew: it stays as long as it is that of one of them, which may differ in the last
/// digits of their axes.
fn grid_of(newest: &Manifest, taken: &[&Reading]) -> Grid {
    let is_there = |reading: &&Reading| is_equal_grid(&reading.grid, &newest.grid);
    if taken.iter().any(is_there) {
        newest.grid
    } else {
        taken[0].grid
    }
}

/// What all files hold. Those of one product have one grid and one quantity: those that are read anew with those that are
/// not, too.
fn quantity_of(newest: &Manifest, taken: &[&Reading], is_whole: bool) -> Result<Quantity, String> {
    let first = taken[0];
    let like = if is_whole {
        (first.grid, first.quantity, first.synthetic)
    } else {
        (newest.grid, newest.quantity, newest.synthetic)
    };
    let is_other = |reading: &&&Reading| {
        !is_same_grid(&reading.grid, &like.0)
            || reading.synthetic != like.2
            || like.1.joined(reading.quantity).is_none()
    };
    let Some(other) = taken.iter().find(is_other) else {
        let join = |all: Quantity, reading: &&Reading| all.joined(reading.quantity).unwrap_or(all);
        return Ok(taken.iter().fold(like.1, join));
    };
    let origin = &other.steps[0].origin;
    Err(if is_whole {
        format!(
            "{origin} has another grid or quantity than {}",
            first.steps[0].origin
        )
    } else {
        format!(
            "{origin} has another grid or quantity now than the files that were not read anew; recompute all of the product"
        )
    })
}

#[cfg(test)]
mod tests;
