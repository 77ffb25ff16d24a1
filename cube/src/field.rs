//! One step's values as encoded objects, and one encoded chunk as values.

use std::borrow::Cow;
use std::marker::PhantomData;
use std::num::NonZeroU64;
use std::ops::Range;

use bytes::Bytes;
use contract::chunk::Window;
use contract::grid::Grid;
use zarrs::array::{
    ArrayToBytesCodecTraits as _, CodecChain, CodecOptions, Element, ElementOwned,
    FromArrayBytes as _,
};

use crate::arrays::{self, Definition};
use crate::layout::{BLOCK_CELLS, RUN_STEPS};
use crate::summing::records;
use crate::sums::Basis;
use crate::{CubeError, Description, Layout};

/// A number of map-major arrays.
pub(crate) trait Number: Element + ElementOwned + Copy + Send + Sync + 'static {
    /// What stands where there is no data: an object of nothing else is not stored.
    const BLANK: Self;

    fn is_blank(self) -> bool;
}

impl Number for f32 {
    const BLANK: Self = f32::NAN;

    fn is_blank(self) -> bool {
        self.is_nan()
    }
}

impl Number for u8 {
    const BLANK: Self = 0;

    fn is_blank(self) -> bool {
        self == 0
    }
}

/// Writes bands of a map-major array as objects of its layout.
pub(crate) struct Encoder<T> {
    definition: Definition,
    /// Rows and columns of the grid.
    cells: [u32; 2],
    layout: Layout,
    number: PhantomData<T>,
}

/// An object of a field: a chunk, or a shard of chunks.
pub(crate) struct EncodedObject {
    /// Row and column of objects.
    pub(crate) index: [u32; 2],
    /// None where no cell has data: it is not stored, and read as the fill value.
    pub(crate) content: Option<Bytes>,
}

impl Encoder<f32> {
    /// Of fields.
    pub(crate) fn new(description: &Description) -> Result<Self, CubeError> {
        let grid = &description.grid;
        let definition = arrays::values(description, 1)?;
        Ok(Self::of(definition, grid, Layout::of(grid)))
    }
}

impl<T: Number> Encoder<T> {
    /// Of an array over a grid.
    pub(crate) fn of(definition: Definition, grid: &Grid, layout: Layout) -> Self {
        Self {
            definition,
            cells: [grid.rows, grid.cols],
            layout,
            number: PhantomData,
        }
    }

    /// Path of the array.
    pub(crate) fn path(&self) -> &str {
        self.definition.path().as_str()
    }

    /// Columns of the grid.
    pub(crate) fn cols(&self) -> usize {
        self.cells[1] as usize
    }

    /// Rows and columns of objects.
    fn objects(&self) -> [u32; 2] {
        [0, 1].map(|side| self.cells[side].div_ceil(self.layout.object[side]))
    }

    /// Rows and columns of all objects.
    pub(crate) fn indices(&self) -> Vec<[u32; 2]> {
        let [rows, _] = self.objects();
        (0..rows).flat_map(|row| self.indices_in(row)).collect()
    }

    /// Those of a row of objects.
    pub(crate) fn indices_in(&self, row: u32) -> impl Iterator<Item = [u32; 2]> + use<T> {
        let [_, cols] = self.objects();
        (0..cols).map(move |col| [row, col])
    }

    /// The bands of rows that rows of objects hold.
    pub(crate) fn bands(&self) -> impl Iterator<Item = Range<u32>> + use<T> {
        let ([rows, _], height) = (self.cells, self.layout.object[0]);
        let bands = 0..rows.div_ceil(height);
        bands.map(move |band| band * height..((band + 1) * height).min(rows))
    }

    /// Encodes one object from the band of rows that its row of objects holds, `[row, col]` of all columns.
    pub(crate) fn encode(&self, band: &[T], index: [u32; 2]) -> Result<EncodedObject, CubeError> {
        let [rows, cols] = self.layout.object.map(|cells| cells as usize);
        let grid_cols = self.cells[1] as usize;
        let col = index[1] as usize * cols;
        let width = cols.min(grid_cols - col);
        let mut cells = vec![T::BLANK; rows * cols];
        for (to, from) in cells
            .chunks_exact_mut(cols)
            .zip(band.chunks_exact(grid_cols))
        {
            for (to, value) in to.iter_mut().zip(&from[col..][..width]) {
                // "No data" is one bit pattern, the fill value's.
                *to = if value.is_blank() { T::BLANK } else { *value };
            }
        }
        if cells.iter().all(|value| value.is_blank()) {
            return Ok(EncodedObject {
                index,
                content: None,
            });
        }
        Ok(EncodedObject {
            index,
            content: Some(object(&self.definition, &cells)?),
        })
    }
}

/// Encodes the values of one object of an array, all of them.
fn object<T: Element>(array: &Definition, values: &[T]) -> Result<Bytes, CubeError> {
    let failed = |e: String| CubeError::library(&arrays::name(array), "encoding", e);
    // By reference: a shard of runs is a hundred megabytes.
    let bytes = T::to_array_bytes(array.data_type(), values);
    let bytes = bytes.map_err(|e| failed(e.to_string()))?;
    let shape = array.chunk_shape(&[0, 0, 0]);
    let shape = shape.map_err(|e| failed(e.to_string()))?;
    let encoded = array.codecs().encode(
        bytes,
        &shape,
        array.data_type(),
        array.fill_value(),
        &CodecOptions::default(),
    );
    let encoded = encoded.map_err(|e| failed(e.to_string()))?;
    Ok(Bytes::from(encoded.into_owned()))
}

/// Writes runs of steps as shards of the time-major copy, and sums of them.
pub(crate) struct SeriesEncoder {
    definition: Definition,
    sums: Definition,
    grid: Grid,
    /// Rows and columns of a shard, cells.
    shard: [u32; 2],
}

impl SeriesEncoder {
    pub(crate) fn new(description: &Description) -> Result<Self, CubeError> {
        Ok(Self {
            definition: arrays::series(description, 1)?,
            sums: arrays::sums(description, 1)?,
            grid: description.grid,
            shard: Layout::of(&description.grid).series_object(),
        })
    }

    /// Rows and columns of all shards of a run.
    pub(crate) fn shards(&self) -> Vec<[u32; 2]> {
        let rows = self.grid.rows.div_ceil(self.shard[0]);
        let cols = self.grid.cols.div_ceil(self.shard[1]);
        (0..rows)
            .flat_map(|row| (0..cols).map(move |col| [row, col]))
            .collect()
    }

    /// The cells of a shard that the grid has.
    pub(crate) fn window(&self, shard: [u32; 2]) -> Window {
        let (row, col) = (shard[0] * self.shard[0], shard[1] * self.shard[1]);
        Window {
            row,
            col,
            rows: self.shard[0].min(self.grid.rows - row),
            cols: self.shard[1].min(self.grid.cols - col),
        }
    }

    /// Rows and columns of blocks in a shard.
    pub(crate) fn shard_blocks(&self) -> [u32; 2] {
        self.shard.map(|cells| cells / BLOCK_CELLS)
    }

    /// Columns of a shard, cells.
    pub(crate) fn shard_cols(&self) -> usize {
        self.shard[1] as usize
    }

    /// Values of a shard, those beyond the grid among them.
    pub(crate) fn shard_values(&self) -> usize {
        self.shard[0] as usize * self.shard[1] as usize * RUN_STEPS
    }

    /// Encodes a shard of `values`, `[step, row, col]`; none where no cell has data.
    pub(crate) fn encode(&self, values: &[f32]) -> Result<Option<Bytes>, CubeError> {
        if values.iter().all(|value| value.is_nan()) {
            return Ok(None);
        }
        object(&self.definition, values).map(Some)
    }

    /// Records of sums of a shard of `values`, `[step, row, col]`.
    pub(crate) fn records(&self, values: &[f32], shard: [u32; 2], basis: &Basis) -> Vec<u8> {
        let first_row = (shard[0] * self.shard[0]) as usize;
        let weights = basis.row_weights.get(first_row..).unwrap_or_default();
        records(values, self.shard_cols(), weights, basis.scale)
    }

    /// Encodes the records of a shard; none where no cell has data.
    pub(crate) fn encode_records(&self, records: &[u8]) -> Result<Option<Bytes>, CubeError> {
        if records.iter().all(|byte| *byte == 0) {
            return Ok(None);
        }
        object(&self.sums, records).map(Some)
    }
}

/// Reads chunks of one map-major array.
pub(crate) struct Decoder<T> {
    definition: Definition,
    codecs: CodecChain,
    shape: Vec<NonZeroU64>,
    number: PhantomData<T>,
}

impl<T: Number> Decoder<T> {
    /// Of an array that is cut so.
    pub(crate) fn new(definition: Definition, layout: &Layout) -> Self {
        let shape = [1, layout.chunk[0].into(), layout.chunk[1].into()];
        let side = |cells: u64| NonZeroU64::new(cells).unwrap_or(NonZeroU64::MIN);
        Self {
            definition,
            codecs: arrays::chunk_codecs(),
            shape: shape.map(side).to_vec(),
            number: PhantomData,
        }
    }

    /// Numbers of a whole chunk, `[row, col]`. Its checksum is compared with its bytes before anything else: the library
    /// does not do that where it decodes a part of a chunk.
    pub(crate) fn decode(&self, content: Vec<u8>) -> Result<Vec<T>, String> {
        let array = &self.definition;
        let options = CodecOptions::default().with_validate_checksums(true);
        let decoded = self.codecs.decode(
            Cow::Owned(content),
            &self.shape,
            array.data_type(),
            array.fill_value(),
            &options,
        );
        let shape: Vec<u64> = self.shape.iter().map(|side| side.get()).collect();
        let decoded = decoded.map_err(|e| e.to_string())?.into_owned();
        Vec::<T>::from_array_bytes(decoded, &shape, array.data_type()).map_err(|e| e.to_string())
    }
}
