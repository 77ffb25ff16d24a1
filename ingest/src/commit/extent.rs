//! The cells that hold data in some step of the next version: only fields that come or go are read.

use std::collections::BTreeSet;

use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::product::ProductId;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use storage::{StorageError, Store, domain, fields};

use crate::error::IngestError;

/// Fields that are read at a time.
pub(crate) const FIELDS_AT_ONCE: usize = 2;

/// Writes the domain of steps that follow the newest version.
///
/// What was dropped or revised may have held the only value of a cell: of such cells other steps are looked at until each was
/// found in one, which most are in the first.
pub(crate) async fn write(
    store: &Store,
    product: &ProductId,
    grid: &Grid,
    newest: Option<&Manifest>,
    steps: &[Step],
) -> Result<ObjectKey, IngestError> {
    let newest = newest.filter(|newest| newest.grid == *grid);
    let before = match newest {
        Some(newest) => domain::read(store, &newest.domain)
            .await
            .map_err(IngestError::storage("read the domain"))?,
        None => vec![false; grid.cell_count()],
    };
    let there = newest.map_or(&[][..], |newest| &newest.steps);
    let own = fields_of(there);
    let next = fields_of(steps);
    let mut cells = before.clone();
    let mut lost = vec![false; cells.len()];
    let gone = fields_but(there, &next);
    let seen = each(store, grid, gone, |values| {
        mark(&mut lost, values);
        true
    });
    match seen.await {
        // What is damaged may have held a value anywhere; it is on its way out, and must not keep what replaces it from landing.
        Err(IngestError::Storage {
            source: StorageError::Damaged { .. },
            ..
        }) => lost.copy_from_slice(&before),
        other => other?,
    }
    let come = fields_but(steps, &own);
    each(store, grid, come, |values| {
        mark(&mut cells, values);
        find(&mut lost, values);
        true
    })
    .await?;
    if lost.contains(&true) {
        let mut kept: Vec<ObjectKey> = vec![];
        for step in steps.iter().rev().filter(|step| own.contains(&step.field)) {
            kept.push(step.field.clone());
        }
        each(store, grid, kept, |values| {
            find(&mut lost, values);
            lost.contains(&true)
        })
        .await?;
        cells
            .iter_mut()
            .zip(&lost)
            .for_each(|(cell, lost)| *cell &= !lost);
    }
    match newest {
        // It was read just now: to store it again would be two requests for nothing.
        Some(newest) if cells == before => Ok(newest.domain.clone()),
        _ => domain::write(store, product, &cells)
            .await
            .map_err(IngestError::storage("store the domain")),
    }
}

/// Writes the domain of a version again, from all of its fields.
pub(super) async fn write_again(
    store: &Store,
    version: &Manifest,
) -> Result<ObjectKey, IngestError> {
    write(store, &version.product, &version.grid, None, &version.steps).await
}

fn fields_of(steps: &[Step]) -> BTreeSet<&ObjectKey> {
    steps.iter().map(|step| &step.field).collect()
}

/// Fields of steps that are not among others.
fn fields_but(steps: &[Step], others: &BTreeSet<&ObjectKey>) -> Vec<ObjectKey> {
    let fields = steps.iter().map(|step| &step.field);
    fields
        .filter(|field| !others.contains(field))
        .cloned()
        .collect()
}

/// Hands the values of each field over, until `take` says that it needs no more.
async fn each(
    store: &Store,
    grid: &Grid,
    keys: Vec<ObjectKey>,
    mut take: impl FnMut(&[f32]) -> bool,
) -> Result<(), IngestError> {
    let mut read = stream::iter(keys)
        .map(|key| async move { fields::read(store, &key, grid).await })
        .buffered(FIELDS_AT_ONCE);
    while let Some(values) = read
        .try_next()
        .await
        .map_err(IngestError::storage("read a field"))?
    {
        if !take(&values) {
            break;
        }
    }
    Ok(())
}

/// Cells that hold data are of the domain.
fn mark(cells: &mut [bool], values: &[f32]) {
    let cells = cells.iter_mut().zip(values);
    cells.for_each(|(cell, value)| *cell |= !value.is_nan());
}

/// Cells that hold data are not lost.
fn find(lost: &mut [bool], values: &[f32]) {
    let lost = lost.iter_mut().zip(values);
    lost.for_each(|(lost, value)| *lost &= value.is_nan());
}

#[cfg(test)]
mod tests {
    use contract::digest::Digest;
    use contract::manifest::MANIFEST_SCHEMA;
    use contract::quantity::Quantity;
    use contract::time::Period;

    use super::*;

    const GRID: Grid = Grid {
        rows: 1,
        cols: 4,
        north_deg: 1.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };
    const NONE: f32 = f32::NAN;

    async fn step(store: &Store, month: u32, values: [f32; 4]) -> Step {
        let (product, period) = ("p".parse().unwrap(), Period::month(2000, month).unwrap());
        let field = fields::write(store, &product, &GRID, &values, period).await;
        Step {
            period,
            field: field.unwrap(),
            raw_sha256: Digest::of(b""),
            origin: String::new(),
            valid_cells: 1,
            masked: None,
            contributed: None,
        }
    }

    /// The domain of steps that follow others.
    async fn after(store: &Store, before: &[Step], steps: &[Step]) -> Vec<bool> {
        let product: ProductId = "p".parse().unwrap();
        let domain = write(store, &product, &GRID, None, before).await.unwrap();
        let newest = Manifest {
            schema: MANIFEST_SCHEMA,
            number: 1,
            title: String::new(),
            quantity: Quantity::CarbonFlux,
            synthetic: false,
            source: String::new(),
            grid: GRID,
            steps: before.to_vec(),
            domain,
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            product: product.clone(),
        };
        let found = write(store, &product, &GRID, Some(&newest), steps).await;
        let anew = write(store, &product, &GRID, None, steps).await.unwrap();
        let found = found.unwrap();
        assert_eq!(found, anew, "it is that of a product that has no past");
        domain::read(store, &found).await.unwrap()
    }

    #[tokio::test]
    async fn a_cell_is_of_the_domain_while_some_step_holds_it() {
        let store = Store::memory();
        let one = step(&store, 1, [1.0, 2.0, NONE, NONE]).await;
        let two = step(&store, 2, [1.0, NONE, 3.0, NONE]).await;
        let three = step(&store, 3, [NONE, NONE, NONE, 4.0]).await;
        let (f, t) = (false, true);
        let both = [one.clone(), two.clone()];
        let grown = [one.clone(), two.clone(), three.clone()];
        assert_eq!(after(&store, &both, &grown).await, [t, t, t, t]);
        // The only value of the second cell goes, that of the first is held by another step.
        let revised = step(&store, 1, [NONE, NONE, NONE, 5.0]).await;
        let next = [revised, two.clone(), three.clone()];
        assert_eq!(after(&store, &grown, &next).await, [t, f, t, t]);
        assert_eq!(after(&store, &grown, &[two, three]).await, [t, f, t, t]);
        assert_eq!(after(&store, &grown, &[one]).await, [t, t, f, f]);
    }
}
