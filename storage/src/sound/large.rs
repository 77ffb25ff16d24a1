//! Is a stored object what its name or its seal says, where it is too large to be held? Its bytes are read once as they come,
//! and those of a field a second time band by band.

use contract::key::ObjectKey;
use contract::kind::{Kind, Vouched};
use futures::StreamExt as _;
use object_store::ObjectStoreExt as _;
use object_store::path::Path;

use super::seal::{PARQUET_END_BYTES, SealCheck};
use super::{ByteCheck, Soundness, of_object};
use crate::off_thread::off_thread;
use crate::store::{MAX_OBJECT_BYTES, failed};
use crate::{StorageError, Store, fields};

/// Objects up to this size are read whole.
const HELD_BYTES: u64 = 256 << 20;

/// The same as [`of_object`] of what is in the store, and how large it is.
///
/// # Errors
/// `Damaged` if it is not.
pub(crate) async fn of_stored(
    store: &Store,
    key: &ObjectKey,
) -> Result<(Soundness, u64), StorageError> {
    of_stored_beyond(store, key, HELD_BYTES).await
}

async fn of_stored_beyond(
    store: &Store,
    key: &ObjectKey,
    held_bytes: u64,
) -> Result<(Soundness, u64), StorageError> {
    let is_in_pieces = match key.vouches() {
        Vouched::Bytes(_) => true,
        Vouched::Values(_) => Kind::of(key) == Some(Kind::Field),
        Vouched::Nothing => false,
    };
    let most_bytes = if is_in_pieces {
        held_bytes
    } else {
        MAX_OBJECT_BYTES
    };
    if let Some(content) = store.fetch_up_to(key, most_bytes).await? {
        let (own, size_bytes) = (key.clone(), content.len() as u64);
        let found = off_thread(move || of_object(&own, &content)).await?;
        return Ok((found, size_bytes));
    }
    let size_bytes = store.size_bytes(key).await?;
    let mut check = match key.vouches() {
        Vouched::Bytes(name) => ByteCheck::of_name(name),
        Vouched::Values(_) if is_in_pieces => {
            let end = size_bytes.saturating_sub(PARQUET_END_BYTES);
            let end = store.get_range(key, end..size_bytes).await?;
            ByteCheck::of_seal(SealCheck::new(size_bytes, &end))
        }
        Vouched::Values(_) | Vouched::Nothing => {
            let reason = "it is larger than the 2 GiB that are read at once";
            return Err(StorageError::damaged(key.as_str(), reason));
        }
    };
    let found = store.object_store().get(&Path::from(key.as_str())).await;
    let mut pieces = found.map_err(|e| failed(key, e))?.into_stream();
    while let Some(piece) = pieces.next().await {
        check.update(&piece.map_err(|e| failed(key, e))?);
    }
    check.finish(key)?;
    if matches!(key.vouches(), Vouched::Values(_)) {
        // Reading all of it compares the values with the name.
        let mut bands = fields::Reader::open(store, key, None).await?.bands();
        while bands.next().await?.is_some() {}
    }
    Ok((Soundness::Sound, size_bytes))
}

#[cfg(test)]
mod tests {
    use bytes::Bytes;
    use contract::digest::Digest;
    use contract::grid::Grid;
    use contract::time::Period;

    use super::*;

    const GRID: Grid = Grid {
        rows: 150,
        cols: 130,
        north_deg: 75.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };

    /// Is it sound, read whole and in pieces?
    async fn is_sound(store: &Store, key: &ObjectKey) -> [bool; 2] {
        let mut found = [false; 2];
        for (found, held_bytes) in found.iter_mut().zip([HELD_BYTES, 0]) {
            *found = match of_stored_beyond(store, key, held_bytes).await {
                Ok((soundness, _)) => soundness == Soundness::Sound,
                Err(StorageError::Damaged { object, .. }) => {
                    assert_eq!(object, key.as_str());
                    false
                }
                Err(e) => panic!("{e}"),
            };
        }
        found
    }

    #[tokio::test]
    async fn what_is_too_large_to_be_held_is_found_damaged_as_what_is_held() {
        let (store, product) = (Store::memory(), "p".parse().unwrap());
        let values: Vec<f32> = (0..GRID.cell_count()).map(|i| i as f32).collect();
        let january = Period::month(2001, 1).unwrap();
        let key = fields::write(&store, &product, &GRID, &values, january);
        let key = key.await.unwrap();
        let raw = Bytes::from("a file");
        let raw_key = ObjectKey::raw(&product, &Digest::of(&raw));
        store.put_new(&raw_key, raw).await.unwrap();
        for key in [&key, &raw_key] {
            assert_eq!(is_sound(&store, key).await, [true, true], "{key}");
            let whole = store.get(key).await.unwrap();
            for at in [0, whole.len() / 2, whole.len() - 1] {
                let mut damaged = whole.to_vec();
                damaged[at] ^= 1;
                store.put_over(key, damaged.into()).await.unwrap();
                assert_eq!(is_sound(&store, key).await, [false, false], "{key} {at}");
            }
            store.put_over(key, whole).await.unwrap();
        }
        // Whole, and of other values.
        let other = fields::encode(&GRID, &vec![1.0; values.len()], january).unwrap();
        store.put_over(&key, other.content).await.unwrap();
        assert_eq!(is_sound(&store, &key).await, [false, false]);
    }
}
