//! A version whose domain is damaged or gone in, the same object whole out.

use contract::manifest::{MANIFEST_SCHEMA, Manifest};
use storage::{StorageError, Store, domain, manifests};

use super::extent;
use crate::error::IngestError;
use crate::limits::gates::Gates;
use crate::limits::memory;

/// Writes it again from the version's fields: it comes to be what it was, or gets another name, and a version to name it.
///
/// None if it was whole.
pub(crate) async fn mend(
    store: &Store,
    gates: &Gates,
    newest: &Manifest,
) -> Result<Option<Manifest>, IngestError> {
    let mut next = newest.clone();
    let _memory = gates.memory(memory::of_fields(&newest.grid)).await;
    if is_whole(
        domain::read_cells(store, &newest.domain)
            .await
            .map(|_cells| ()),
    )? {
        return Ok(None);
    }
    next.domain = extent::write_again(store, newest).await?;
    if next == *newest {
        return Ok(Some(next));
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
        let steps = vec![step];
        let domain = extent::write(store, &product, &GRID, None, &steps).await;
        let manifest = Manifest {
            schema: MANIFEST_SCHEMA,
            product,
            number: 1,
            title: "t".into(),
            quantity: Quantity::CarbonFlux,
            synthetic: false,
            source: "s".into(),
            grid: GRID,
            steps,
            domain: domain.unwrap(),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
        };
        manifests::commit(store, &manifest).await.unwrap();
        manifest
    }

    #[tokio::test]
    async fn what_is_mended_waits_for_memory_as_a_landing_does() {
        let store = Store::memory();
        let newest = landed(&store).await;
        let domain = &newest.domain;
        let damaged = bytes::Bytes::from("no domain");
        store.put_over(domain, damaged).await.unwrap();
        let program = "/nowhere".into();
        let arguments = vec![];
        let settings = Settings::with_decoder(DecoderCommand { program, arguments });
        let gates = Gates::new(&settings);
        let all = gates.memory(u64::MAX).await;
        let mut mending = Box::pin(mend(&store, &gates, &newest));
        let limit = Duration::from_millis(300);
        let early = tokio::time::timeout(limit, &mut mending).await;
        assert!(early.is_err(), "somebody else has all memory: {early:?}");
        assert!(store.get(domain).await.is_err(), "nothing is written");
        drop(all);
        assert_eq!(mending.await.unwrap(), Some(newest.clone()));
        assert!(store.get(domain).await.is_ok());
    }
}
