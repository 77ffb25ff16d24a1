//! Numbered manifests: the newest of a product, one by its name, and the commit of the next.

use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{
    MANIFEST_SCHEMA, Manifest, ManifestId, OLDEST_MANIFEST_SCHEMA, SeriesSegment, Step,
};
use contract::product::ProductId;

use crate::sound::damage;
use crate::{StorageError, Store, document, fields};

/// Products that have a manifest, sorted by name.
pub async fn products(store: &Store) -> Result<Vec<ProductId>, StorageError> {
    let names = store.folders(Kind::Manifest.folder()).await?;
    Ok(names.iter().filter_map(|name| name.parse().ok()).collect())
}

/// The newest manifest of a product, if it has one.
pub async fn latest(store: &Store, product: &ProductId) -> Result<Option<Manifest>, StorageError> {
    let keys = store
        .list(&format!("{}/{product}", Kind::Manifest.folder()))
        .await?;
    match keys.last() {
        Some(key) => read(store, key).await,
        None => Ok(None),
    }
}

/// Numbers of the manifests that a product has, ascending.
pub async fn numbers(store: &Store, product: &ProductId) -> Result<Vec<u64>, StorageError> {
    let keys = store
        .list(&format!("{}/{product}", Kind::Manifest.folder()))
        .await?;
    let number = |key: &ObjectKey| {
        let name = key.as_str().rsplit('/').next()?;
        name.strip_suffix(".json")?.parse().ok()
    };
    Ok(keys.iter().filter_map(number).collect())
}

/// The manifest of a product with a number; none if there is none (any more).
pub async fn numbered(
    store: &Store,
    product: &ProductId,
    number: u64,
) -> Result<Option<Manifest>, StorageError> {
    read(store, &ObjectKey::manifest(product, number)).await
}

/// The manifest of a name, which must still hold what it held when it was named.
pub async fn load(store: &Store, id: &ManifestId) -> Result<Manifest, StorageError> {
    let key = ObjectKey::manifest(&id.product, id.number);
    let Some(manifest) = read(store, &key).await? else {
        let path = key.to_string();
        return Err(StorageError::Object {
            key: path.clone(),
            source: object_store::Error::NotFound {
                path,
                source: "it was cleaned up, or never published".into(),
            },
        });
    };
    if manifest.id() == *id {
        Ok(manifest)
    } else {
        let reason = format!("it is {}, not {id}", manifest.id());
        Err(damage::found(&key, reason))
    }
}

/// Publishes a manifest whose objects are all durable.
///
/// # Errors
/// `Conflict` if another writer took the number: read the newest one again and build on it.
pub async fn commit(store: &Store, manifest: &Manifest) -> Result<(), StorageError> {
    let key = ObjectKey::manifest(&manifest.product, manifest.number);
    if manifest.schema != MANIFEST_SCHEMA {
        let reason = format!("to write, it is of schema {}", manifest.schema);
        return Err(StorageError::damaged(key.as_str(), reason));
    }
    document::put_new(store, &key, manifest)
        .await
        .map(|_new| ())
}

/// Gives what the next version holds the names that the newest one has for the same values: what was named by its bytes
/// is no other object for being named by its values.
pub async fn settle(
    store: &Store,
    newest: &Manifest,
    next: &mut Manifest,
) -> Result<(), StorageError> {
    if newest.grid != next.grid {
        return Ok(());
    }
    for step in &mut next.steps {
        let start = step.period.start;
        let there = newest
            .steps
            .binary_search_by_key(&start, |it| it.period.start);
        let there = there.ok().map(|at| &newest.steps[at]);
        let is_renamed = |there: &&Step| there.period == step.period && there.field != step.field;
        if let Some(there) = there.filter(is_renamed) {
            step.field = fields::settle(store, &there.field, &step.field, &next.grid).await?;
        }
    }
    let fields = |manifest: &Manifest, segment: &SeriesSegment| {
        let first = segment.first_step as usize;
        let steps = manifest.steps.get(first..first + segment.steps as usize);
        steps.map(|steps| steps.iter().map(|it| it.field.clone()).collect::<Vec<_>>())
    };
    let mut series = next.series.clone();
    for segment in &mut series {
        let own = fields(next, segment);
        let same = |there: &&SeriesSegment| own.is_some() && fields(newest, there) == own;
        if let Some(there) = newest.series.iter().find(same) {
            segment.series = there.series.clone();
        }
    }
    next.series = series;
    Ok(())
}

async fn read(store: &Store, key: &ObjectKey) -> Result<Option<Manifest>, StorageError> {
    let Some(manifest) = document::get::<Manifest>(store, key).await? else {
        return Ok(None);
    };
    manifest
        .grid
        .validate()
        .map_err(|e| damage::found(key, e))?;
    if !(OLDEST_MANIFEST_SCHEMA..=MANIFEST_SCHEMA).contains(&manifest.schema) {
        // Whole, but of a program to come.
        let reason = format!(
            "schema {} is unknown, this program reads {OLDEST_MANIFEST_SCHEMA} to {MANIFEST_SCHEMA}",
            manifest.schema
        );
        return Err(StorageError::damaged(key.as_str(), reason));
    }
    Ok(Some(manifest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::digest::Digest;
    use contract::grid::Grid;
    use contract::quantity::Quantity;

    fn manifest(number: u64, title: &str) -> Manifest {
        let product: ProductId = "p".parse().unwrap();
        Manifest {
            schema: MANIFEST_SCHEMA,
            number,
            title: title.to_owned(),
            quantity: Quantity::CarbonFlux,
            synthetic: false,
            source: String::new(),
            grid: Grid {
                rows: 1,
                cols: 1,
                north_deg: 1.0,
                west_deg: 0.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            steps: vec![],
            domain: ObjectKey::domain(&product, &Digest::of(b"")),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            product,
        }
    }

    #[tokio::test]
    async fn the_newest_number_wins_and_old_ones_stay_readable() {
        let store = Store::memory();
        let product = "p".parse().unwrap();
        assert!(latest(&store, &product).await.unwrap().is_none());
        for number in 1..=11 {
            commit(&store, &manifest(number, "t")).await.unwrap();
        }
        let newest = latest(&store, &product).await.unwrap().unwrap();
        assert_eq!(newest.number, 11);
        let old = manifest(2, "t");
        assert_eq!(load(&store, &old.id()).await.unwrap(), old);
        assert_eq!(products(&store).await.unwrap(), [product]);
    }

    #[tokio::test]
    async fn two_writers_cannot_take_one_number() {
        let store = Store::memory();
        commit(&store, &manifest(1, "mine")).await.unwrap();
        let second = commit(&store, &manifest(1, "yours")).await;
        assert!(matches!(second, Err(StorageError::Conflict { .. })));
    }

    #[tokio::test]
    async fn a_manifest_with_a_flipped_bit_is_never_read_as_another_one() {
        let store = Store::memory();
        commit(&store, &manifest(1, "t")).await.unwrap();
        let key = ObjectKey::manifest(&"p".parse().unwrap(), 1);
        let whole = store.get(&key).await.unwrap();
        for at in 0..whole.len() * 8 {
            let mut flipped = whole.to_vec();
            flipped[at / 8] ^= 1 << (at % 8);
            store.put_over(&key, flipped.into()).await.unwrap();
            let error = latest(&store, &"p".parse().unwrap()).await.unwrap_err();
            assert!(
                error.to_string().contains(key.as_str()),
                "bit {at}: {error}"
            );
        }
    }
}
