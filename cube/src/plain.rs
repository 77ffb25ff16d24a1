//! A cube as plain Zarr in a folder of a store: written once, with the metadata of all arrays in that of the group. Version 2 is made of
//! what the library writes of version 3 ([`crate::zarr_2`]).

use std::collections::BTreeMap;
use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use contract::key::ObjectKey;
use contract::time::Period;
use futures::future::BoxFuture;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use serde_json::{Value, json};
use storage::Store;
use storage::fields::FieldDigest;
use zarrs::array::ArrayBytes;
use zarrs::storage::{
    AsyncWritableStorageTraits, OffsetBytesIterator, StorageError, StoreKey, StorePrefix,
};

use crate::arrays::{self, Definition, Fixed};
use crate::bands::WholeField;
use crate::field::{EncodedObject, Encoder, Number};
use crate::group::{group, write_group};
use crate::zarr_2::{Array2, CHECKSUM_BYTES, CONSOLIDATED, Group2, key_of_2};
use crate::{Bands, CubeError, Description, Layout, Step, ZarrVersion, axis};

/// Objects of a field that are encoded and sent at a time.
pub(crate) const OBJECTS_AT_ONCE: usize = 4;

/// Writes the group, the values' array without steps, the coordinates of space, and an empty time.
pub(crate) async fn write_frame_of_reference<S>(
    store: &Arc<S>,
    description: &Description,
) -> Result<(), CubeError>
where
    S: AsyncWritableStorageTraits + 'static,
{
    write_group(store, "", description.attributes()).await?;
    write_fixed(store, arrays::fixed(description)?).await?;
    write_length(store, description, 0).await?;
    axis::write(store, description, &[], 0).await
}

/// Writes arrays that never change.
pub(crate) async fn write_fixed<S>(store: &Arc<S>, all: Vec<Fixed>) -> Result<(), CubeError>
where
    S: AsyncWritableStorageTraits + 'static,
{
    for fixed in all {
        let (definition, bytes) = match fixed {
            Fixed::Floats(definition, numbers) => {
                let bytes = numbers.iter().flat_map(|it| it.to_ne_bytes()).collect();
                (definition, bytes)
            }
            Fixed::Number(definition, number) => (definition, number.to_ne_bytes().to_vec()),
        };
        let array = definition.with_storage(Arc::clone(store));
        let failed = |e: String| CubeError::library(&arrays::name(&array), "writing", e);
        let stored = array.async_store_metadata().await;
        stored.map_err(|e| failed(e.to_string()))?;
        let index = vec![0; array.dimensionality()];
        let bytes: Vec<u8> = bytes;
        let stored = array.async_store_chunk(&index, ArrayBytes::new_flen(bytes));
        stored.await.map_err(|e| failed(e.to_string()))?;
    }
    Ok(())
}

/// Writes of how many steps the values are.
pub(crate) async fn write_length<S>(
    store: &Arc<S>,
    description: &Description,
    steps: usize,
) -> Result<(), CubeError>
where
    S: AsyncWritableStorageTraits + 'static,
{
    let values = arrays::values(description, steps as u64)?;
    write_definition(store, values).await
}

async fn write_definition<S>(store: &Arc<S>, definition: Definition) -> Result<(), CubeError>
where
    S: AsyncWritableStorageTraits + 'static,
{
    let array = definition.with_storage(Arc::clone(store));
    let stored = array.async_store_metadata().await;
    stored.map_err(|e| CubeError::library(&arrays::name(&array), "writing", e))
}

/// Plain Zarr as it is being written.
pub struct PlainZarr {
    folder: Arc<Folder>,
    description: Description,
    layout: Layout,
    encoder: Arc<Encoder<f32>>,
    steps: Vec<Step>,
}

impl PlainZarr {
    /// Begins in a folder of a store; `""` is the whole store. Without [`PlainZarr::finish`] it cannot be opened.
    ///
    /// # Errors
    /// `Exists` if the folder is not empty.
    pub fn create<'a>(
        store: &'a Store,
        folder: &'a str,
        description: &'a Description,
        version: ZarrVersion,
    ) -> BoxFuture<'a, Result<Self, CubeError>> {
        Box::pin(async move {
            if !store.list(folder).await?.is_empty() {
                return Err(CubeError::Exists {
                    place: format!("{}{folder}", store.url()),
                });
            }
            let layout = Layout::of(&description.grid);
            let layout = match version {
                ZarrVersion::Two => layout.without_shards(),
                ZarrVersion::Three => layout,
            };
            let values = arrays::values_cut(description, 1, layout)?;
            Ok(Self {
                folder: Arc::new(Folder {
                    store: store.clone(),
                    name: folder.trim_matches('/').to_owned(),
                    version,
                }),
                description: description.clone(),
                layout,
                encoder: Arc::new(Encoder::of(values, &description.grid, layout)),
                steps: vec![],
            })
        })
    }

    /// Writes the next step: `values` of its field, `[row, col]`, stored unit, NaN no data.
    ///
    /// # Errors
    /// `Overlap` if it does not come after the last one.
    pub fn append(
        &mut self,
        period: Period,
        values: Arc<[f32]>,
    ) -> BoxFuture<'_, Result<Step, CubeError>> {
        Box::pin(async move {
            let grid = self.description.grid;
            check_length(&values, grid.cell_count())?;
            let mut whole = WholeField::new(values, grid.cols);
            self.append_bands(period, &mut whole).await
        })
    }

    /// The same of a field that is asked for band by band. The digest of its values is in the step: who knows it compares it.
    ///
    /// # Errors
    /// `Overlap` if it does not come after the last one.
    pub fn append_bands<'a>(
        &'a mut self,
        period: Period,
        bands: &'a mut dyn Bands,
    ) -> BoxFuture<'a, Result<Step, CubeError>> {
        Box::pin(async move {
            if let Some(last) = self.steps.last()
                && period.start < last.period.end
            {
                return Err(CubeError::Overlap {
                    step: period,
                    there: last.period,
                });
            }
            let grid = self.description.grid;
            let at = self.steps.len() as u64;
            let values_array = arrays::values_cut(&self.description, at + 1, self.layout)?;
            let mut digest = FieldDigest::new(&grid, period);
            for (row, rows) in self.encoder.bands().enumerate() {
                let count = rows.len() * grid.cols as usize;
                let band: Arc<[f32]> = bands.rows(rows).await?.into();
                check_length(&band, count)?;
                digest.add(&band);
                let sent: Vec<()> = encoded(&self.encoder, row as u32, band)
                    .map(|object| {
                        let (folder, array) = (&self.folder, &values_array);
                        async move {
                            let EncodedObject { index, content } = object?;
                            let Some(content) = content else {
                                return Ok(());
                            };
                            let [row, col] = index.map(u64::from);
                            let key = array.chunk_key(&[at, row, col]);
                            let set = folder.set(&key, content).await;
                            set.map_err(|e| CubeError::library(key.as_str(), "writing", e))
                        }
                    })
                    .buffer_unordered(OBJECTS_AT_ONCE)
                    .try_collect()
                    .await?;
                drop(sent);
            }
            let step = Step {
                period,
                values_sha256: digest.finish(),
            };
            self.steps.push(step);
            Ok(step)
        })
    }

    /// Writes coordinates and metadata, the group's last: now it can be opened.
    pub async fn finish(self) -> Result<(), CubeError> {
        let (folder, description) = (&self.folder, &self.description);
        let held = Arc::new(Held {
            folder: Arc::clone(folder),
            metadata: std::sync::Mutex::default(),
        });
        write_frame_of_reference(&held, description).await?;
        let values = arrays::values_cut(description, self.steps.len() as u64, self.layout)?;
        write_definition(&held, values).await?;
        axis::write(&held, description, &self.steps, 0).await?;
        let arrays = held.take();
        let group = group(folder, "", description.attributes())?;
        let described = |e: String| CubeError::library("the group", "describing it", e);
        let mut metadata =
            serde_json::to_value(group.metadata()).map_err(|e| described(e.to_string()))?;
        if folder.version == ZarrVersion::Two {
            let group = Group2::new(&metadata["attributes"], &arrays).map_err(described)?;
            // Whoever finds the metadata of all finds all.
            let others = group.metadata().filter(|(key, _)| *key != CONSOLIDATED);
            let last = group.metadata().filter(|(key, _)| *key == CONSOLIDATED);
            for (key, content) in others.chain(last) {
                let set = folder.set_named(key, content.clone()).await;
                set.map_err(|e| CubeError::library(key, "writing", e))?;
            }
            return Ok(());
        }
        for (name, metadata) in &arrays {
            folder.set_metadata(name, metadata).await?;
        }
        metadata["consolidated_metadata"] =
            json!({ "kind": "inline", "must_understand": false, "metadata": arrays });
        folder.set_metadata("", &metadata).await
    }
}

pub(crate) fn check_length(values: &[f32], expected: usize) -> Result<(), CubeError> {
    if values.len() == expected {
        return Ok(());
    }
    Err(CubeError::Shape {
        expected,
        found: values.len(),
    })
}

/// A row of objects from the band of rows that it holds, encoded on other threads a few at a time.
pub(crate) fn encoded<T: Number>(
    encoder: &Arc<Encoder<T>>,
    row: u32,
    band: Arc<[T]>,
) -> impl stream::Stream<Item = Result<EncodedObject, CubeError>> + use<T> {
    let encoder = Arc::clone(encoder);
    stream::iter(encoder.indices_in(row))
        .map(move |index| {
            let (encoder, band) = (Arc::clone(&encoder), Arc::clone(&band));
            async move {
                let encoded = tokio::task::spawn_blocking(move || encoder.encode(&band, index));
                encoded
                    .await
                    .map_err(|e| CubeError::library("a thread", "encoding", e))?
            }
        })
        .buffered(OBJECTS_AT_ONCE)
}

/// A folder of a store, to write Zarr into.
struct Folder {
    store: Store,
    name: String,
    version: ZarrVersion,
}

impl Folder {
    async fn set_named(&self, name: &str, content: Bytes) -> Result<(), String> {
        let text = match self.name.as_str() {
            "" => name.to_owned(),
            folder => format!("{folder}/{name}"),
        };
        let key: ObjectKey = text
            .parse()
            .map_err(|e: contract::ContractError| e.to_string())?;
        let put = self.store.put_new(&key, content).await;
        put.map(|_new| ()).map_err(|e| e.to_string())
    }
}

impl Folder {
    /// Writes the metadata of an array, or of the group, whose name is empty.
    async fn set_metadata(&self, name: &str, metadata: &Value) -> Result<(), CubeError> {
        let key = match name {
            "" => "zarr.json".to_owned(),
            name => format!("{name}/zarr.json"),
        };
        let set = self.set_named(&key, metadata.to_string().into()).await;
        set.map_err(|e| CubeError::library(&key, "writing", e))
    }
}

#[async_trait]
impl AsyncWritableStorageTraits for Folder {
    async fn set(&self, key: &StoreKey, value: Bytes) -> Result<(), StorageError> {
        let set = match self.version {
            ZarrVersion::Two => {
                let end = value.len().saturating_sub(CHECKSUM_BYTES);
                self.set_named(&key_of_2(key.as_str()), value.slice(..end))
                    .await
            }
            ZarrVersion::Three => self.set_named(key.as_str(), value).await,
        };
        set.map_err(StorageError::Other)
    }

    async fn set_partial_many<'a>(
        &'a self,
        _key: &StoreKey,
        _offset_values: OffsetBytesIterator<'a>,
    ) -> Result<(), StorageError> {
        Err(StorageError::Unsupported(
            "objects are written whole".to_owned(),
        ))
    }

    async fn erase(&self, _key: &StoreKey) -> Result<(), StorageError> {
        // An object without data is not stored, and nothing is written twice.
        Ok(())
    }

    async fn erase_prefix(&self, _prefix: &StorePrefix) -> Result<(), StorageError> {
        Err(StorageError::Unsupported("nothing is removed".to_owned()))
    }

    fn supports_set_partial(&self) -> bool {
        false
    }
}

/// The same folder, but metadata is held back until it is all known.
struct Held {
    folder: Arc<Folder>,
    /// Of arrays by their names, as the library wrote it: it would shorten what it has read (a codec without settings to its
    /// name), which zarr-python does not understand.
    metadata: std::sync::Mutex<BTreeMap<String, Value>>,
}

impl Held {
    fn take(&self) -> BTreeMap<String, Value> {
        let metadata = self.metadata.lock();
        std::mem::take(&mut *metadata.unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    /// What version 2 needs in the place of a chunk that version 3 leaves out.
    fn blank(&self, key: &str) -> Result<Option<Bytes>, String> {
        let name = key
            .strip_suffix("/c")
            .or(key.split_once("/c/").map(|(name, _)| name));
        let metadata = self.metadata.lock();
        let metadata = metadata.unwrap_or_else(std::sync::PoisonError::into_inner);
        match name.and_then(|name| Some((name, metadata.get(name)?))) {
            Some((name, own)) if self.folder.version == ZarrVersion::Two => {
                Array2::of(name, own)?.blank()
            }
            _ => Ok(None),
        }
    }
}

#[async_trait]
impl AsyncWritableStorageTraits for Held {
    async fn set(&self, key: &StoreKey, value: Bytes) -> Result<(), StorageError> {
        let Some(name) = key.as_str().strip_suffix("zarr.json") else {
            return self.folder.set(key, value).await;
        };
        let node =
            serde_json::from_slice(&value).map_err(|e| StorageError::Other(e.to_string()))?;
        let metadata = self.metadata.lock();
        let mut metadata = metadata.unwrap_or_else(std::sync::PoisonError::into_inner);
        if !name.is_empty() {
            metadata.insert(name.trim_end_matches('/').to_owned(), node);
        }
        Ok(())
    }

    async fn set_partial_many<'a>(
        &'a self,
        key: &StoreKey,
        offset_values: OffsetBytesIterator<'a>,
    ) -> Result<(), StorageError> {
        self.folder.set_partial_many(key, offset_values).await
    }

    async fn erase(&self, key: &StoreKey) -> Result<(), StorageError> {
        match self.blank(key.as_str()).map_err(StorageError::Other)? {
            Some(blank) => {
                let set = self.folder.set_named(&key_of_2(key.as_str()), blank).await;
                set.map_err(StorageError::Other)
            }
            None => self.folder.erase(key).await,
        }
    }

    async fn erase_prefix(&self, prefix: &StorePrefix) -> Result<(), StorageError> {
        self.folder.erase_prefix(prefix).await
    }

    fn supports_set_partial(&self) -> bool {
        false
    }
}
