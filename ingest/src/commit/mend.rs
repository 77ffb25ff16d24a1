//! A version whose series or domain are damaged or gone in, the same objects whole out.

use contract::manifest::{MANIFEST_SCHEMA, Manifest};
use storage::{StorageError, Store, domain, manifests, series};

use super::segments;
use crate::error::IngestError;

/// Writes them again from the version's frames. Objects that are named by their values come to be what they were, and the
/// version stands; a series that was named by its bytes gets another name, and a version to name it.
///
/// None if everything was whole.
pub(crate) async fn mend(
    store: &Store,
    newest: &Manifest,
) -> Result<Option<Manifest>, IngestError> {
    let mut next = newest.clone();
    let mut is_changed = false;
    for segment in &mut next.series {
        if is_whole(series::check(store, &segment.series).await)? {
            continue;
        }
        let first = segment.first_step as usize;
        let steps = newest.steps.get(first..first + segment.steps as usize);
        let values = segments::read_all(store, &newest.grid, steps.unwrap_or_default()).await?;
        segment.series =
            segments::write_series(store, &newest.product, &newest.grid, values).await?;
        is_changed = true;
    }
    if !is_whole(domain::read(store, &newest.domain).await.map(|_cells| ()))? {
        let mut cells = vec![false; newest.grid.cell_count()];
        for step in &newest.steps {
            let values =
                segments::read_all(store, &newest.grid, std::slice::from_ref(step)).await?;
            segments::mark(&mut cells, &values);
        }
        next.domain = domain::write(store, &newest.product, &cells)
            .await
            .map_err(IngestError::storage("store the domain"))?;
        is_changed = true;
    }
    if next == *newest {
        return Ok(is_changed.then_some(next));
    }
    next.number += 1;
    next.schema = MANIFEST_SCHEMA;
    // Whoever publishes meanwhile writes what is damaged again, or this is asked for again.
    manifests::commit(store, &next)
        .await
        .map_err(IngestError::storage("publish a manifest"))?;
    Ok(Some(next))
}

/// Is an object there and whole? A store that does not answer is another matter.
fn is_whole(checked: Result<(), StorageError>) -> Result<bool, IngestError> {
    match checked {
        Ok(()) => Ok(true),
        Err(StorageError::Damaged { .. }) => Ok(false),
        Err(e) if e.is_not_found() => Ok(false),
        Err(e) => Err(IngestError::storage("check what is stored")(e)),
    }
}
