//! The same windows of very many fields that are files of this machine, by a thread of its own: of each the end and the chunks that
//! hold them, without a request each.

use std::fs::File;
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use contract::chunk::{Window, field_chunks};
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::Vouched;

use super::check_count;
use super::cut::Cut;
use super::reader::of_file;
use crate::rows::{Fetched, RowIndex, TAIL_BYTES};

/// Windows that are read of files.
#[derive(Debug)]
pub struct FileWindows {
    grid: Grid,
    /// All of the grid.
    chunks: Vec<Window>,
    cut: Cut,
}

impl FileWindows {
    /// Some windows of a grid; none if one is not inside.
    pub fn new(grid: &Grid, windows: &[Window]) -> Option<Self> {
        let is_inside = |window: &Window| {
            let end = |first: u32, count: u32| first.checked_add(count).filter(|_| count > 0);
            end(window.row, window.rows).is_some_and(|end| end <= grid.rows)
                && end(window.col, window.cols).is_some_and(|end| end <= grid.cols)
        };
        windows.iter().all(is_inside).then(|| Self {
            grid: *grid,
            chunks: field_chunks(grid),
            cut: Cut::new(grid, windows),
        })
    }

    /// Values of the windows in the field that is a file, `[row, col]` of each, stored unit, NaN no data: as [`super::Reader::windows`].
    ///
    /// None where that is to be asked instead: it is not there, damaged, or of before its rows had checks. It says which.
    pub fn read(&self, file: &Path, key: &ObjectKey) -> Option<Vec<Vec<f32>>> {
        let Vouched::Values(_) = key.vouches() else {
            return None;
        };
        let file = File::open(file).ok()?;
        let size_bytes = file.metadata().ok()?.len();
        let start = size_bytes.saturating_sub(TAIL_BYTES as u64);
        let tail = bytes(&file, start..size_bytes)?;
        let index = RowIndex::of_end(&tail, size_bytes)?;
        let (shape, period) = of_file(index.metadata())?;
        if (shape.rows, shape.cols) != (self.grid.rows, self.grid.cols) {
            return None;
        }
        check_count(&self.grid, index.row_count()).ok()?;
        let wanted = self.cut.chunks();
        let part = |range: Range<u64>| {
            let content = if range.start >= start && range.end <= size_bytes {
                tail.slice((range.start - start) as usize..(range.end - start) as usize)
            } else {
                bytes(&file, range.clone())?
            };
            Some((range, content))
        };
        let ranges = index.ranges(&wanted)?;
        let is_inside = |range: &Range<u64>| range.start <= range.end && range.end <= size_bytes;
        if !ranges.iter().all(is_inside) {
            return None;
        }
        let parts = ranges.into_iter().map(part).collect::<Option<Vec<_>>>()?;
        let fetched = Fetched::of_parts(key, Arc::new(index), wanted, parts);
        self.cut.of(&fetched, &self.chunks, period).ok()
    }
}

/// Some bytes of a file.
fn bytes(file: &File, range: Range<u64>) -> Option<Bytes> {
    let mut content = vec![0; usize::try_from(range.end - range.start).ok()?];
    file.read_exact_at(&mut content, range.start).ok()?;
    Some(content.into())
}

#[cfg(test)]
mod tests {
    use contract::product::ProductId;
    use contract::time::Period;

    use super::*;
    use crate::Store;
    use crate::fields::{Reader, write};

    /// Two groups of the file, the last chunks cut off.
    const GRID: Grid = Grid {
        rows: 435,
        cols: 1270,
        north_deg: 43.5,
        west_deg: 0.0,
        dlat_deg: 0.1,
        dlon_deg: 0.1,
    };

    fn window(row: u32, col: u32, rows: u32, cols: u32) -> Window {
        Window {
            row,
            col,
            rows,
            cols,
        }
    }

    #[tokio::test]
    async fn windows_of_a_file_are_those_of_the_store_and_what_is_no_such_file_is_left_to_it() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path().to_str().unwrap()).unwrap();
        let product: ProductId = "p".parse().unwrap();
        let value = |cell: usize| {
            if cell.is_multiple_of(7) {
                f32::NAN
            } else {
                cell as f32
            }
        };
        let values: Vec<f32> = (0..GRID.cell_count()).map(value).collect();
        let period = Period::month(2000, 1).unwrap();
        let key = write(&store, &product, &GRID, &values, period)
            .await
            .unwrap();
        let file = store.field_file(&key).unwrap();
        // In one chunk, over the corner of four, in the last group, and twice the same.
        let one = window(3, 6, 1, 1);
        let asked = [one, window(58, 118, 4, 4), window(430, 1260, 5, 10), one];
        let reader = Reader::open(&store, &key, Some(&GRID)).await.unwrap();
        let by_requests = reader.windows(&asked).await.unwrap();
        let of_files = FileWindows::new(&GRID, &asked).unwrap();
        let found = of_files.read(&file, &key).unwrap();
        let bits = |windows: &[Vec<f32>]| -> Vec<u32> {
            windows
                .iter()
                .flatten()
                .map(|value| value.to_bits())
                .collect()
        };
        assert_eq!(bits(&found), bits(&by_requests));
        assert_eq!(found[0], [value(3 * 1270 + 6)]);
        for outside in [
            window(435, 0, 1, 1),
            window(0, 0, 0, 1),
            window(1, 1265, 1, 6),
        ] {
            assert!(FileWindows::new(&GRID, &[outside]).is_none(), "{outside:?}");
        }
        let narrower = Grid { cols: 1260, ..GRID };
        let of_others = FileWindows::new(&narrower, &[one]).unwrap();
        assert!(of_others.read(&file, &key).is_none(), "of another grid");
        let nowhere = folder.path().join("nowhere");
        assert!(of_files.read(&nowhere, &key).is_none(), "not there");
        let whole = std::fs::read(&file).unwrap();
        for length in [0, 7, 20_000, whole.len() - 1] {
            std::fs::write(&file, &whole[..length]).unwrap();
            assert!(of_files.read(&file, &key).is_none(), "{length} bytes");
        }
        let mut damaged = whole;
        damaged[10_000] ^= 4;
        std::fs::write(&file, &damaged).unwrap();
        assert!(
            of_files.read(&file, &key).is_none(),
            "its first chunk is damaged"
        );
    }
}
