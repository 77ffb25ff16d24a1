//! Numbered manifests: the newest of a product, one by its name, and the commit of the next.

use bytes::Bytes;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, ManifestId, OLDEST_MANIFEST_SCHEMA};
use contract::product::ProductId;

use crate::{StorageError, Store};

/// Products that have a manifest, sorted by name.
pub async fn products(store: &Store) -> Result<Vec<ProductId>, StorageError> {
    let names = store.folders("manifests").await?;
    Ok(names.iter().filter_map(|name| name.parse().ok()).collect())
}

/// The newest manifest of a product, if it has one.
pub async fn latest(store: &Store, product: &ProductId) -> Result<Option<Manifest>, StorageError> {
    let keys = store.list(&format!("manifests/{product}")).await?;
    match keys.last() {
        Some(key) => read(store, key).await.map(Some),
        None => Ok(None),
    }
}

/// The manifest of a name, which must still hold what it held when it was named.
pub async fn load(store: &Store, id: &ManifestId) -> Result<Manifest, StorageError> {
    let key = ObjectKey::manifest(&id.product, id.number);
    let manifest = read(store, &key).await?;
    if manifest.id() == *id {
        Ok(manifest)
    } else {
        let reason = format!("it is {}, not {id}", manifest.id());
        Err(StorageError::damaged(key.as_str(), reason))
    }
}

/// The manifest of a number, none if it is gone.
pub async fn numbered(
    store: &Store,
    product: &ProductId,
    number: u64,
) -> Result<Option<Manifest>, StorageError> {
    match read(store, &ObjectKey::manifest(product, number)).await {
        Ok(manifest) => Ok(Some(manifest)),
        Err(error) if error.is_not_found() => Ok(None),
        Err(error) => Err(error),
    }
}

/// Publishes a manifest whose objects are all durable.
///
/// # Errors
/// `Conflict` if another writer took the number: read the newest one again and build on it.
pub async fn commit(store: &Store, manifest: &Manifest) -> Result<(), StorageError> {
    let key = ObjectKey::manifest(&manifest.product, manifest.number);
    let json = serde_json::to_vec(manifest).map_err(|e| StorageError::damaged(key.as_str(), e))?;
    store.put_new(&key, Bytes::from(json)).await.map(|_new| ())
}

async fn read(store: &Store, key: &ObjectKey) -> Result<Manifest, StorageError> {
    let content = store.get(key).await?;
    let manifest: Manifest =
        serde_json::from_slice(&content).map_err(|e| StorageError::damaged(key.as_str(), e))?;
    manifest
        .grid
        .validate()
        .map_err(|e| StorageError::damaged(key.as_str(), e))?;
    if !(OLDEST_MANIFEST_SCHEMA..=MANIFEST_SCHEMA).contains(&manifest.schema) {
        let reason = format!(
            "schema {} is unknown, this program reads {OLDEST_MANIFEST_SCHEMA} to {MANIFEST_SCHEMA}",
            manifest.schema
        );
        return Err(StorageError::damaged(key.as_str(), reason));
    }
    Ok(manifest)
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
}
