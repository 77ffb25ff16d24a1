//! A version whose series or domain are damaged or gone in, the same objects whole out.

use contract::manifest::{MANIFEST_SCHEMA, Manifest};
use storage::{StorageError, Store, domain, manifests, series};

use super::segments;
use crate::error::IngestError;
use crate::limits::gates::Gates;
use crate::limits::memory;

/// Writes them again from the version's fields. Objects that are named by their values come to be what they were, and the
/// version stands; a series that was named by its bytes gets another name, and a version to name it.
///
/// None if everything was whole.
pub(crate) async fn mend(
    store: &Store,
    gates: &Gates,
    newest: &Manifest,
) -> Result<Option<Manifest>, IngestError> {
    let mut next = newest.clone();
    let mut is_changed = false;
    let cells = newest.grid.cell_count();
    for segment in &mut next.series {
        let values = cells.saturating_mul(segment.steps as usize);
        let _memory = gates.memory(memory::of_segment(values)).await;
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
    let _memory = gates.memory(memory::of_segment(cells)).await;
    if !is_whole(domain::read(store, &newest.domain).await.map(|_cells| ()))? {
        let mut cells = vec![false; cells];
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
    cube::keep_up(store, &next).await;
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

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use contract::digest::Digest;
    use contract::grid::Grid;
    use contract::key::ObjectKey;
    use contract::manifest::Step;
    use contract::product::ProductId;
    use contract::quantity::Quantity;
    use contract::time::Period;
    use storage::fields;

    use super::*;
    use crate::commit::merge::Merged;
    use crate::settings::{DecoderCommand, Settings};

    const GRID: Grid = Grid {
        rows: 2,
        cols: 4,
        north_deg: 90.0,
        west_deg: -180.0,
        dlat_deg: 90.0,
        dlon_deg: 90.0,
    };

    /// A version of one step, whose objects are durable.
    async fn landed(store: &Store) -> Manifest {
        let product: ProductId = "p".parse().unwrap();
        let period = Period::month(2000, 1).unwrap();
        let field = fields::encode(&GRID, &[1.0; 8], period).unwrap();
        let step = Step {
            period,
            field: ObjectKey::field(&product, &field.values_sha256),
            raw_sha256: Digest::of(b""),
            origin: "f.nc".into(),
            valid_cells: 8,
            masked: None,
            contributed: None,
        };
        store.put_new(&step.field, field.content).await.unwrap();
        let merged = Merged {
            steps: vec![step],
            orders: vec![],
            changes: vec![],
            is_revision: false,
            last_taken: None,
            quantity: Some(Quantity::CarbonFlux),
        };
        let written = segments::write(store, &product, &GRID, None, &merged);
        let segments::Written { series, domain } = written.await.unwrap();
        let manifest = Manifest {
            schema: MANIFEST_SCHEMA,
            product,
            number: 1,
            title: "t".into(),
            quantity: Quantity::CarbonFlux,
            synthetic: false,
            source: "s".into(),
            grid: GRID,
            steps: merged.steps,
            domain,
            series,
            derived_from: None,
            computed: None,
            notices: vec![],
        };
        manifests::commit(store, &manifest).await.unwrap();
        manifest
    }

    #[tokio::test]
    async fn what_is_mended_waits_for_memory_as_a_landing_does() {
        let store = Store::memory();
        let newest = landed(&store).await;
        let series = &newest.series[0].series;
        let damaged = bytes::Bytes::from("no series");
        store.put_over(series, damaged).await.unwrap();
        let program = "/nowhere".into();
        let arguments = vec![];
        let settings = Settings::with_decoder(DecoderCommand { program, arguments });
        let gates = Gates::new(&settings);
        let all = gates.memory(u64::MAX).await;
        let mut mending = Box::pin(mend(&store, &gates, &newest));
        let limit = Duration::from_millis(300);
        let early = tokio::time::timeout(limit, &mut mending).await;
        assert!(early.is_err(), "somebody else has all memory: {early:?}");
        assert!(store.get(series).await.is_err(), "nothing is written");
        drop(all);
        assert_eq!(mending.await.unwrap(), Some(newest.clone()));
        assert!(store.get(series).await.is_ok());
    }
}
