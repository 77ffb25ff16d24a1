//! The domain of a product: which cells hold data in some step. It is stored as one byte a cell; who makes one holds a bit a
//! cell, and no more of its bytes than a piece.

use std::ops::Range;
use std::sync::Arc;

use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::product::ProductId;
use futures::StreamExt as _;
use object_store::ObjectStoreExt as _;
use object_store::path::Path;
use sha2::{Digest as _, Sha256};

use crate::content::{Content, PIECE_BYTES};
use crate::off_thread::off_thread;
use crate::sound::damage;
use crate::store::failed;
use crate::{StorageError, Store};

const WORD_BITS: usize = 64;
const NO_BYTE: &str = "a byte is not 0 or 1";

/// Some cells of a map, `[row, col]`, a bit each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cells {
    words: Vec<u64>,
    count: usize,
}

impl Cells {
    /// None of so many cells.
    pub fn none(count: usize) -> Self {
        Self {
            words: vec![0; count.div_ceil(WORD_BITS)],
            count,
        }
    }

    /// Cells of the map.
    pub fn map_count(&self) -> usize {
        self.count
    }

    /// Is there any?
    pub fn is_any(&self) -> bool {
        self.words.iter().any(|word| *word != 0)
    }

    /// Is it one of them?
    ///
    /// # Panics
    /// The map has no such cell.
    pub fn has(&self, cell: usize) -> bool {
        self.words[cell / WORD_BITS] >> (cell % WORD_BITS) & 1 == 1
    }

    /// How many of the cells of a range are of them.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn count_in(&self, cells: Range<usize>) -> usize {
        let (mut cell, mut count) = (cells.start, 0);
        while cell < cells.end {
            let place = cell % WORD_BITS;
            let own = (WORD_BITS - place).min(cells.end - cell);
            let mask = u64::MAX >> (WORD_BITS - own) << place;
            count += (self.words[cell / WORD_BITS] & mask).count_ones() as usize;
            cell += own;
        }
        count
    }

    /// All of them, ascending.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.words.iter().enumerate().flat_map(|(at, word)| {
            let mut left = *word;
            std::iter::from_fn(move || {
                let bit = left.trailing_zeros() as usize;
                left &= left.checked_sub(1)?;
                Some(at * WORD_BITS + bit)
            })
        })
    }

    /// Adds one.
    ///
    /// # Panics
    /// The map has no such cell.
    pub fn insert(&mut self, cell: usize) {
        self.words[cell / WORD_BITS] |= 1 << (cell % WORD_BITS);
    }

    /// Adds those of the cells from `first` on that hold a value; NaN is none.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn add_valued(&mut self, first: usize, values: &[f32]) {
        self.each_word(first, values, |word, valued| *word |= valued);
    }

    /// Takes those of the cells from `first` on away that hold a value.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn remove_valued(&mut self, first: usize, values: &[f32]) {
        self.each_word(first, values, |word, valued| *word &= !valued);
    }

    /// Hands over each word that has cells from `first` on, and which of them hold a value.
    fn each_word(&mut self, first: usize, values: &[f32], mut take: impl FnMut(&mut u64, u64)) {
        let (mut cell, mut left) = (first, values);
        while !left.is_empty() {
            let place = cell % WORD_BITS;
            let (own, others) = left.split_at(left.len().min(WORD_BITS - place));
            let bits = own.iter().enumerate();
            let valued = bits.fold(0, |word, (at, value)| {
                word | u64::from(!value.is_nan()) << at
            });
            take(&mut self.words[cell / WORD_BITS], valued << place);
            (cell, left) = (cell + own.len(), others);
        }
    }

    /// Adds others of the same map.
    pub fn add(&mut self, others: &Self) {
        for (word, other) in self.words.iter_mut().zip(&others.words) {
            *word |= other;
        }
    }

    /// Takes others of the same map away.
    pub fn remove(&mut self, others: &Self) {
        for (word, other) in self.words.iter_mut().zip(&others.words) {
            *word &= !other;
        }
    }

    /// The bytes of some of them as they are stored.
    fn bytes(&self, cells: Range<u64>) -> Bytes {
        let cells = cells.start as usize..cells.end as usize;
        cells.map(|cell| u8::from(self.has(cell))).collect()
    }
}

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

/// The same of cells that are held as bits.
pub async fn write_cells(
    store: &Store,
    product: &ProductId,
    cells: Cells,
) -> Result<ObjectKey, StorageError> {
    let cells = Arc::new(cells);
    let size_bytes = cells.count as u64;
    let own = Arc::clone(&cells);
    let digest = off_thread(move || {
        let mut hasher = Sha256::new();
        for start in (0..size_bytes).step_by(PIECE_BYTES as usize) {
            hasher.update(own.bytes(start..size_bytes.min(start + PIECE_BYTES)));
        }
        Ok(Digest::from_bytes(hasher.finalize().into()))
    });
    let key = ObjectKey::domain(product, &digest.await?);
    let content = Content::Made(Arc::new(move |part| cells.bytes(part)), size_bytes);
    store.put_new_content(&key, content).await?;
    Ok(key)
}

/// Reads a domain, whose bytes must be those of its name.
pub async fn read(store: &Store, key: &ObjectKey) -> Result<Vec<bool>, StorageError> {
    let content = store.get(key).await?;
    if content.iter().any(|&byte| byte > 1) {
        return Err(damage::found(key, NO_BYTE));
    }
    Ok(content.iter().map(|&byte| byte == 1).collect())
}

/// The same as bits, read as it comes.
pub async fn read_cells(store: &Store, key: &ObjectKey) -> Result<Cells, StorageError> {
    let found = store.object_store().get(&Path::from(key.as_str())).await;
    let found = found.map_err(|e| failed(key, e))?;
    let mut cells = Cells::none(0);
    let mut hasher = Sha256::new();
    let mut pieces = found.into_stream();
    while let Some(piece) = pieces.next().await {
        let piece = piece.map_err(|e| failed(key, e))?;
        if piece.iter().any(|&byte| byte > 1) {
            return Err(damage::found(key, NO_BYTE));
        }
        hasher.update(&piece);
        let first = cells.count;
        cells.count += piece.len();
        cells.words.resize(cells.count.div_ceil(WORD_BITS), 0);
        for (cell, byte) in (first..).zip(&piece) {
            cells.words[cell / WORD_BITS] |= u64::from(*byte) << (cell % WORD_BITS);
        }
    }
    let digest = Digest::from_bytes(hasher.finalize().into());
    if key.vouches() == contract::kind::Vouched::Bytes(digest) {
        Ok(cells)
    } else {
        Err(damage::found(key, format!("its digest is {digest}")))
    }
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
        let error = read_cells(&store, &key).await.unwrap_err();
        assert!(error.to_string().contains(key.as_str()), "{error}");
    }

    #[tokio::test]
    async fn bits_and_bytes_are_the_same_domain() {
        let store = Store::memory();
        let product = "p".parse().unwrap();
        let some = |i: usize| i.is_multiple_of(3) || i.is_multiple_of(7);
        let bytes: Vec<bool> = (0..1000).map(some).collect();
        let value = |i: usize| if some(i) { 1.0 } else { f32::NAN };
        let mut cells = Cells::none(1000);
        for first in [0, 130, 500] {
            let values: Vec<f32> = (first..1000).map(value).collect();
            cells.add_valued(first, &values);
        }
        let key = write(&store, &product, &bytes).await.unwrap();
        assert_eq!(
            write_cells(&store, &product, cells.clone()).await.unwrap(),
            key
        );
        assert_eq!(read_cells(&store, &key).await.unwrap(), cells);
        assert_eq!((0..1000).map(|i| cells.has(i)).collect::<Vec<_>>(), bytes);
        for range in [0..1000, 63..65, 1..130, 128..192, 960..1000] {
            let count = range.clone().filter(|i| some(*i)).count();
            assert_eq!(cells.count_in(range.clone()), count, "{range:?}");
        }
        let mut rest = cells.clone();
        rest.remove_valued(0, &(0..600).map(value).collect::<Vec<_>>());
        assert!(!rest.has(0) && !rest.has(597) && rest.has(600) && rest.is_any());
        cells.remove(&rest);
        assert!(cells.has(597) && !cells.has(600));
        rest.remove_valued(600, &[0.0; 400]);
        assert!(!rest.is_any());
        let [mut first, mut second] = [Cells::none(1000), Cells::none(1000)];
        first.add_valued(0, &(0..500).map(value).collect::<Vec<_>>());
        second.add_valued(500, &(500..1000).map(value).collect::<Vec<_>>());
        first.add(&second);
        assert_eq!(write_cells(&store, &product, first).await.unwrap(), key);
        rest.add(&cells);
        assert!(rest.has(597) && !rest.has(600) && rest == cells);
    }
}
