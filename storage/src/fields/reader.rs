//! A stored field in, some of its rows or a window of its cells out: of its file no more is fetched and decoded than that.
//!
//! Every chunk is compared with its own check. The name of a field vouches for all of its values: who reads all bands
//! ([`Reader::bands`]) learns at the end whether they are those.

use std::ops::Range;
use std::sync::Arc;

use contract::chunk::{BAND_CELLS, Window, bands, field_chunks};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::time::{Period, TimeMs};
use object_store::path::Path;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::statistics::Statistics;

use super::cut::Cut;
use super::{check_count, decode, digest_begun};
use crate::off_thread::off_thread;
use crate::parquet_table::{shape_of, shape_only};
use crate::rows::{self, RowIndex, Stored};
use crate::sound::damage;
use crate::values::ValuesDigest;
use crate::{StorageError, Store};

/// Columns of the period.
const PERIOD: [&str; 2] = ["period_start", "period_end"];
/// So many chunks take less time to decode than another thread to begin.
const CHUNKS_AT_HAND: usize = 2;

/// A field that is read in parts; clones share what is known of its file.
#[derive(Debug, Clone)]
pub struct Reader {
    stored: Stored,
    grid: Grid,
    period: Period,
    source: Source,
}

/// Where values come from.
#[derive(Debug, Clone)]
enum Source {
    /// From the rows of the file.
    Rows {
        index: Arc<RowIndex>,
        chunks: Arc<[Window]>,
        name: Digest,
    },
    /// Of files of before rows had checks: all of them, compared with the name.
    Held(Arc<[f32]>),
}

impl Reader {
    /// Reads the end of a field's file; `grid` is that of its product, if that is known.
    ///
    /// # Errors
    /// It cannot be read, is no field, or is of another grid.
    pub async fn open(
        store: &Store,
        key: &ObjectKey,
        grid: Option<&Grid>,
    ) -> Result<Self, StorageError> {
        let stored = stored(store, key);
        match Self::rows_of(stored.clone(), grid).await? {
            Some(reader) => Ok(reader),
            None => Self::held(store, stored, grid).await,
        }
    }

    /// The same of a field that somebody else finds, of a grid.
    ///
    /// # Errors
    /// As of [`Reader::open`]; it is of before rows had checks.
    pub async fn of_rows(stored: Stored, grid: &Grid) -> Result<Self, StorageError> {
        let key = stored.key.clone();
        let found = Self::rows_of(stored, Some(grid)).await?;
        let old = "it is of before its rows had checks, and is not read in parts";
        found.ok_or_else(|| StorageError::damaged(key.as_str(), old))
    }

    /// None where rows have no checks.
    async fn rows_of(stored: Stored, grid: Option<&Grid>) -> Result<Option<Self>, StorageError> {
        let key = stored.key.clone();
        let index = RowIndex::read(&stored).await?;
        let of_file = index.as_ref().and_then(|index| of_file(index.metadata()));
        let (Some(index), Some((shape, period)), Vouched::Values(name)) =
            (index, of_file, key.vouches())
        else {
            return Ok(None);
        };
        let own = grid.copied().unwrap_or(shape);
        if (own.rows, own.cols) != (shape.rows, shape.cols) {
            return Err(damage::found(&key, super::other_grid(&shape, &own)));
        }
        check_count(&own, index.row_count()).map_err(|reason| damage::found(&key, reason))?;
        let source = Source::Rows {
            index: Arc::new(index),
            chunks: field_chunks(&own).into(),
            name,
        };
        Ok(Some(Self {
            stored,
            grid: own,
            period,
            source,
        }))
    }

    /// Reads all of a field at once, compared with its name: for those that are small.
    pub(super) async fn whole(
        store: &Store,
        key: &ObjectKey,
        grid: &Grid,
    ) -> Result<Self, StorageError> {
        Self::held(store, stored(store, key), Some(grid)).await
    }

    async fn held(
        store: &Store,
        stored: Stored,
        grid: Option<&Grid>,
    ) -> Result<Self, StorageError> {
        let content = store.get(&stored.key).await?;
        let (key, grid) = (stored.key.clone(), grid.copied());
        let (grid, values, period) =
            off_thread(move || decode(&key, content, grid.as_ref())).await?;
        Ok(Self {
            stored,
            grid,
            period,
            source: Source::Held(values.into()),
        })
    }

    /// The time that it is of.
    pub fn period(&self) -> Period {
        self.period
    }

    /// Values of some rows, `[row, col]`, stored unit, NaN no data.
    ///
    /// # Errors
    /// Its grid has no such rows; they cannot be read, or are not what their checks say.
    pub async fn rows(&self, rows: Range<u32>) -> Result<Vec<f32>, StorageError> {
        self.window(Window {
            row: rows.start,
            col: 0,
            rows: rows.end.saturating_sub(rows.start),
            cols: self.grid.cols,
        })
        .await
    }

    /// Values of a window, `[row, col]`, stored unit, NaN no data.
    ///
    /// # Errors
    /// Its grid has no such cells; they cannot be read, or are not what their checks say.
    pub async fn window(&self, window: Window) -> Result<Vec<f32>, StorageError> {
        let mut values = self.windows(&[window]).await?;
        Ok(values.pop().unwrap_or_default())
    }

    /// The same of some windows, in the order asked: a chunk that several of them lie in is read once.
    ///
    /// # Errors
    /// As of [`Reader::window`].
    pub async fn windows(&self, windows: &[Window]) -> Result<Vec<Vec<f32>>, StorageError> {
        for window in windows {
            self.check(*window)?;
        }
        let (index, chunks) = match &self.source {
            Source::Held(values) => {
                let of = |window: &Window| {
                    let cells = window.cell_indices(&self.grid);
                    cells.map(|cell| values[cell]).collect()
                };
                return Ok(windows.iter().map(of).collect());
            }
            Source::Rows { index, chunks, .. } => (Arc::clone(index), Arc::clone(chunks)),
        };
        let cut = Cut::new(&self.grid, windows);
        let wanted = cut.chunks();
        let is_quick = wanted.len() <= CHUNKS_AT_HAND;
        let fetched = rows::fetch(&self.stored, Some(index), wanted).await?;
        let period = self.period;
        let picked = move || cut.of(&fetched, &chunks, period);
        if is_quick {
            return picked();
        }
        off_thread(picked).await
    }

    fn check(&self, window: Window) -> Result<(), StorageError> {
        let inside = |first: u32, count: u32, all: u32| {
            count > 0 && first.checked_add(count).is_some_and(|end| end <= all)
        };
        if inside(window.row, window.rows, self.grid.rows)
            && inside(window.col, window.cols, self.grid.cols)
        {
            return Ok(());
        }
        let reason = format!(
            "{window:?} was asked for of {} x {} cells",
            self.grid.rows, self.grid.cols
        );
        Err(StorageError::damaged(self.stored.key.as_str(), reason))
    }

    /// All of it, band by band from the north, each of at most [`BAND_CELLS`] cells or one row of chunks.
    pub fn bands(self) -> Bands {
        self.bands_of(BAND_CELLS)
    }

    /// The same in bands of another size.
    pub fn bands_of(self, most_cells: u64) -> Bands {
        let left: Vec<Range<u32>> = bands(&self.grid, most_cells).collect();
        let check = match &self.source {
            Source::Rows { name, .. } => Some((digest_begun(&self.grid, self.period), *name)),
            Source::Held(_) => None,
        };
        Bands {
            reader: self,
            left: left.into_iter(),
            check,
        }
    }
}

/// The bands of a field; values are sure to be those of its name when there is no further one.
#[derive(Debug)]
pub struct Bands {
    reader: Reader,
    left: std::vec::IntoIter<Range<u32>>,
    check: Option<(ValuesDigest, Digest)>,
}

impl Bands {
    /// The next rows and their values, `[row, col]`; none after the last.
    ///
    /// # Errors
    /// They cannot be read, or are not what their checks say; after the last band, if all together are not those of the name.
    pub async fn next(&mut self) -> Result<Option<(Range<u32>, Vec<f32>)>, StorageError> {
        let Some(rows) = self.left.next() else {
            let is_other = |(digest, name): (ValuesDigest, Digest)| digest.finish() != name;
            if self.check.take().is_some_and(is_other) {
                return Err(damage::found(&self.reader.stored.key, super::OTHER_VALUES));
            }
            return Ok(None);
        };
        let values = self.reader.rows(rows.clone()).await?;
        let Some((mut digest, name)) = self.check.take() else {
            return Ok(Some((rows, values)));
        };
        let (digest, values) = off_thread(move || {
            digest.add(&values);
            Ok((digest, values))
        })
        .await?;
        self.check = Some((digest, name));
        Ok(Some((rows, values)))
    }
}

/// Where a field lies.
fn stored(store: &Store, key: &ObjectKey) -> Stored {
    Stored {
        objects: store.object_store(),
        path: Path::from(key.as_str()),
        key: key.clone(),
    }
}

/// What the end of a file says of its grid and its period; none if it does not say both. The period is compared with the check
/// of every chunk.
pub(super) fn of_file(metadata: &ParquetMetaData) -> Option<(Grid, Period)> {
    let [rows, cols] = shape_of(metadata).ok()?[..] else {
        return None;
    };
    let group = metadata.row_groups().first()?;
    let time = |name: &str| {
        let mut columns = group.columns().iter();
        let column = columns.find(|column| column.column_path().string() == name)?;
        match column.statistics()? {
            Statistics::Int64(times) => TimeMs::new(*times.min_opt()?).ok(),
            _ => None,
        }
    };
    let [start, end] = PERIOD.map(time);
    let period = Period::new(start?, end?).ok()?;
    Some((shape_only(rows, cols), period))
}

#[cfg(test)]
mod tests;
