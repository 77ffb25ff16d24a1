//! The domain of a product: which cells hold data in some step, one byte a cell.

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::product::ProductId;

use crate::sound::damage;
use crate::{StorageError, Store};

/// Stores a domain (`[row, col]`) under the digest of its bytes.
pub async fn write(
    store: &Store,
    product: &ProductId,
    cells: &[bool],
) -> Result<ObjectKey, StorageError> {
    let content: Vec<u8> = cells.iter().map(|&cell| u8::from(cell)).collect();
    let key = ObjectKey::domain(product, &Digest::of(&content));
    store.put_new(&key, Bytes::from(content)).await?;
    Ok(key)
}

/// Reads a domain, whose bytes must be those of its name.
pub async fn read(store: &Store, key: &ObjectKey) -> Result<Vec<bool>, StorageError> {
    let content = store.get(key).await?;
    if content.iter().any(|&byte| byte > 1) {
        return Err(damage::found(key, "a byte is not 0 or 1"));
    }
    Ok(content.iter().map(|&byte| byte == 1).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_domain_round_trips() {
        let store = Store::memory();
        let cells = [true, false, true];
        let key = write(&store, &"p".parse().unwrap(), &cells).await.unwrap();
        assert_eq!(read(&store, &key).await.unwrap(), cells);
        store
            .put_over(&key, Bytes::from(vec![1, 0, 0]))
            .await
            .unwrap();
        let error = read(&store, &key).await.unwrap_err();
        assert!(error.to_string().contains(key.as_str()), "{error}");
    }
}
