//! One array of others: what it says of itself, and values of a part of it.

use std::ops::Range;
use std::sync::Arc;

use half::f16;
use icechunk::session::Session;
use serde_json::{Map, Value};
use tokio::sync::RwLock;
use zarrs::array::{Array, ArrayMetadata, FillValueMetadata};
use zarrs::plugin::ExtensionName as _;
use zarrs::storage::AsyncReadableStorageTraits;

use super::error::ForeignError;
use super::failures::Failures;
use super::state;

/// Most dimensions of an array.
const MAX_RANK: usize = 32;
/// A codec that the library has and unpacks otherwise than whoever packed by it: in the byte order of the array, and with scale and
/// offset in single precision, so that integers are cut off below the one that was packed.
const UNPACKED_OTHERWISE: &str = "fixedscaleoffset";
/// Largest chunk, unpacked, bytes.
const MAX_CHUNK_BYTES: u64 = 512 << 20;

/// How the values of an array are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArrayKind {
    /// Signed integers of this many bytes.
    Integer(u8),
    /// Unsigned integers of this many bytes.
    Unsigned(u8),
    /// Floating point of this many bytes: 2, 4 or 8.
    Float(u8),
    /// Text, complex numbers, records and whatever else is no number.
    Other,
}

/// What a chunk that is not there means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Absent {
    /// The fill value of the array.
    Fill,
    /// Nothing that can be told from a value: it is refused.
    Refused,
    /// The same of a coordinate: a place or a time that was lost looks like one that is the fill value.
    RefusedOfCoordinate,
}

/// An array of others.
pub struct ForeignArray {
    /// Its name in its group.
    pub name: String,
    /// Names, where it gives them, and lengths of its dimensions, slowest first.
    pub dimensions: Vec<(Option<String>, u64)>,
    /// How values are stored.
    pub kind: ArrayKind,
    /// The same in Zarr's words.
    type_name: String,
    /// Its attributes.
    pub attributes: Map<String, Value>,
    /// What stands for what was not written; none where the array defines none, or is of no numbers.
    pub fill: Option<f64>,
    /// Is it of Zarr version 2, where that value is the `_FillValue` of the CF conventions too?
    pub is_zarr2: bool,
    /// For messages.
    pub(super) place: String,
    /// What its store failed at.
    pub(super) failures: Arc<Failures>,
    /// Of a repository: tells where a chunk lies.
    session: Option<Arc<RwLock<Session>>>,
    pub(super) inner: Array<dyn AsyncReadableStorageTraits>,
}

impl ForeignArray {
    /// What an opened array says.
    pub(super) fn new(
        name: &str,
        (place, failures): (&str, &Arc<Failures>),
        inner: Array<dyn AsyncReadableStorageTraits>,
    ) -> Result<Self, ForeignError> {
        let place = format!("{place} array {name}");
        let refused = |reason: String| ForeignError::refused(&place, reason);
        let shape = inner.shape();
        if shape.len() > MAX_RANK {
            return Err(refused(format!(
                "has {} dimensions, at most {MAX_RANK} are read",
                shape.len()
            )));
        }
        let codecs = match inner.metadata() {
            ArrayMetadata::V2(own) => serde_json::to_string(&own.filters),
            ArrayMetadata::V3(own) => serde_json::to_string(&own.codecs),
        };
        let codecs = codecs.map_err(|e| refused(e.to_string()))?;
        if codecs.contains(UNPACKED_OTHERWISE) {
            return Err(refused(format!(
                "cannot be read by this program: codec {UNPACKED_OTHERWISE} is not supported; write it with scale_factor and add_offset instead"
            )));
        }
        let attributes = inner.attributes().clone();
        let (is_zarr2, is_filled) = match inner.metadata() {
            ArrayMetadata::V2(own) => (true, own.fill_value != FillValueMetadata::Null),
            ArrayMetadata::V3(_) => (false, true),
        };
        let names = match inner.dimension_names() {
            Some(names) => names.clone(),
            None => names_of(&attributes, shape.len()),
        };
        let type_name = inner.data_type().name_v3().unwrap_or_default().into_owned();
        let kind = kind_of(&type_name);
        let fill = inner.fill_value().as_ne_bytes();
        Ok(Self {
            name: name.to_owned(),
            dimensions: names.into_iter().zip(shape.iter().copied()).collect(),
            kind,
            type_name,
            fill: number(kind, fill).filter(|_| is_filled),
            attributes,
            is_zarr2,
            place,
            failures: Arc::clone(failures),
            session: None,
            inner,
        })
    }

    /// The same of a repository, if it is of one.
    pub(super) fn of(self, session: Option<Arc<RwLock<Session>>>) -> Self {
        Self { session, ..self }
    }

    /// Where a chunk lies that is not in its repository.
    pub(super) async fn elsewhere(&self, index: &[u64]) -> Option<String> {
        state::elsewhere(self.session.as_deref()?, &self.name, index).await
    }

    /// Values that it has, 1 without dimensions; none beyond what can be counted.
    pub fn cell_count(&self) -> Option<u64> {
        let mut lengths = self.dimensions.iter().map(|(_, length)| *length);
        lengths.try_fold(1, u64::checked_mul)
    }

    /// Bytes of one value.
    ///
    /// # Errors
    /// It holds no numbers of a kind that is read.
    pub fn value_bytes(&self) -> Result<u64, ForeignError> {
        match self.kind {
            ArrayKind::Integer(bytes) | ArrayKind::Unsigned(bytes) | ArrayKind::Float(bytes) => {
                Ok(bytes.into())
            }
            ArrayKind::Other => {
                let reason = format!(
                    "holds values of the type {:?}: read are integers of 8 to 64 bits, and float16, float32 and float64",
                    self.type_name
                );
                Err(ForeignError::refused(&self.place, reason))
            }
        }
    }

    /// Chunks that a part touches, by their indexes, each with the cells that it holds.
    pub(super) fn chunks_of(&self, part: &[Range<u64>]) -> Result<Vec<ChunkCells>, ForeignError> {
        let own = |e: String| ForeignError::refused(&self.place, e);
        let rank = self.dimensions.len();
        let fits = part.len() == rank
            && part
                .iter()
                .zip(&self.dimensions)
                .all(|(part, (_, len))| part.start < part.end && part.end <= *len);
        if !fits {
            return Err(own(format!("has no part {part:?}")));
        }
        let shape = zarrs::array::ArraySubset::new_with_ranges(part);
        let chunks = self.inner.chunks_in_array_subset(&shape);
        let chunks = chunks.map_err(|e| own(e.to_string()))?;
        let chunks = chunks.ok_or_else(|| own("has chunks of no shape".to_owned()))?;
        let mut all = vec![];
        for index in &chunks.indices() {
            let index = index.to_vec();
            let cells = self.inner.chunk_subset(&index);
            let cells = cells.map_err(|e| own(e.to_string()))?.to_ranges();
            all.push((index, cells));
        }
        Ok(all)
    }

    /// First cells of its chunks along one of its dimensions, ascending; of shards those of shards, which are unpacked whole.
    ///
    /// # Errors
    /// Its chunks have no shape, or it has no cells.
    pub fn chunk_starts(&self, dimension: usize) -> Result<Vec<u64>, ForeignError> {
        let own = self.dimensions.iter().enumerate();
        let ends = own.map(|(at, (_, length))| if at == dimension { *length } else { 1 });
        let part: Vec<Range<u64>> = ends.map(|end| 0..end).collect();
        let chunks = self.chunks_of(&part)?;
        let starts = chunks.iter().filter_map(|(_, cells)| cells.get(dimension));
        Ok(starts.map(|cells| cells.start).collect())
    }

    /// Bytes of a chunk once it is unpacked.
    ///
    /// # Errors
    /// They are too many.
    pub(super) fn chunk_bytes(&self, cells: &[Range<u64>]) -> Result<u64, ForeignError> {
        let value_bytes = self.value_bytes()?;
        let bytes = cells.iter().fold(value_bytes, |bytes, cells| {
            bytes.saturating_mul(cells.end - cells.start)
        });
        if bytes <= MAX_CHUNK_BYTES {
            return Ok(bytes);
        }
        let reason = format!(
            "has chunks of {bytes} bytes unpacked, at most {MAX_CHUNK_BYTES} are read: write it in smaller chunks"
        );
        Err(ForeignError::refused(&self.place, reason))
    }
}

/// Names of dimensions as xarray writes them in Zarr version 2.
fn names_of(attributes: &Map<String, Value>, rank: usize) -> Vec<Option<String>> {
    let names = attributes
        .get("_ARRAY_DIMENSIONS")
        .and_then(Value::as_array);
    match names.filter(|names| names.len() == rank) {
        Some(names) => names
            .iter()
            .map(|name| name.as_str().map(str::to_owned))
            .collect(),
        None => vec![None; rank],
    }
}

fn kind_of(name: &str) -> ArrayKind {
    match name {
        "int8" => ArrayKind::Integer(1),
        "int16" => ArrayKind::Integer(2),
        "int32" => ArrayKind::Integer(4),
        "int64" => ArrayKind::Integer(8),
        "uint8" | "bool" => ArrayKind::Unsigned(1),
        "uint16" => ArrayKind::Unsigned(2),
        "uint32" => ArrayKind::Unsigned(4),
        "uint64" => ArrayKind::Unsigned(8),
        "float16" => ArrayKind::Float(2),
        "float32" => ArrayKind::Float(4),
        "float64" => ArrayKind::Float(8),
        _ => ArrayKind::Other,
    }
}

/// A number as it is where values are stored so: what attributes say in more digits is rounded there. Half precision alone needs it;
/// of single precision planning knows it.
pub fn as_stored(kind: ArrayKind, number: f64) -> f64 {
    match kind {
        ArrayKind::Float(2) => f16::from_f64(number).into(),
        _ => number,
    }
}

/// A stored value, in the byte order of this machine, as a number.
#[expect(
    clippy::cast_precision_loss,
    reason = "numbers of all kinds are worked on as float64, as those of files are"
)]
pub(super) fn number(kind: ArrayKind, bytes: &[u8]) -> Option<f64> {
    macro_rules! of {
        ($number:ty) => {
            <$number>::from_ne_bytes(bytes.try_into().ok()?)
        };
    }
    Some(match kind {
        ArrayKind::Integer(1) => of!(i8).into(),
        ArrayKind::Integer(2) => of!(i16).into(),
        ArrayKind::Integer(4) => of!(i32).into(),
        ArrayKind::Integer(_) => of!(i64) as f64,
        ArrayKind::Unsigned(1) => of!(u8).into(),
        ArrayKind::Unsigned(2) => of!(u16).into(),
        ArrayKind::Unsigned(4) => of!(u32).into(),
        ArrayKind::Unsigned(_) => of!(u64) as f64,
        ArrayKind::Float(2) => of!(f16).into(),
        ArrayKind::Float(4) => of!(f32).into(),
        ArrayKind::Float(_) => of!(f64),
        ArrayKind::Other => return None,
    })
}

impl std::fmt::Debug for ForeignArray {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("ForeignArray").field(&self.place).finish()
    }
}

/// Index of a chunk, and the cells that it holds.
pub(super) type ChunkCells = (Vec<u64>, Vec<Range<u64>>);

/// A chunk, unpacked.
pub(super) struct Chunk {
    /// Its values, row-major.
    pub(super) bytes: Vec<u8>,
    /// Which of them no chunk of a shard holds, where they are filled in; empty if none are, or they were not looked for.
    pub(super) lacking: Vec<bool>,
}

/// Chunks, shared.
pub(super) type Unpacked = Option<Arc<Chunk>>;
