//! Windows of cells of stored fields, many fields at a time: of each the chunks that hold them, a tenth of what a chunk of a map in the
//! cube holds. So a few cells of many steps are read that are not laid out by time yet, or not in the cube at all.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::sync::Arc;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS, Window};
use contract::grid::Grid;
use contract::key::ObjectKey;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use storage::Store;
use storage::fields::{self, FileWindows};
use tokio::task::JoinSet;

use crate::{CubeError, Layout};

/// Fields that a task reads at a time.
const FIELDS_OF_A_TASK: usize = 8;
/// Fields that a thread reads before it asks whether it shall go on.
const FIELDS_OF_A_THREAD: usize = 256;
/// Fewer fields are not worth a task.
const LEAST_OF_A_TASK: usize = 16;
/// To open a file and find the place of a chunk costs as much as to decode so many chunks.
const OPEN_CHUNKS: usize = 3;

/// Windows that are read of every field.
#[derive(Clone)]
pub(crate) struct FieldWindows {
    store: Store,
    grid: Grid,
    windows: Arc<[Window]>,
}

/// A field, and the number of the step that it is wanted for.
pub(crate) type Asked = (ObjectKey, usize);
/// The number of a step, and its values by window, `[row, col]`.
pub(crate) type Found = (usize, Vec<Vec<f32>>);

impl FieldWindows {
    pub(crate) fn new(store: &Store, grid: &Grid, windows: &[Window]) -> Self {
        Self {
            store: store.clone(),
            grid: *grid,
            windows: windows.into(),
        }
    }

    /// Are they quicker to read of a field than of chunks of a map in the cube?
    pub(crate) fn are_quicker(&self) -> bool {
        let layout = Layout::of(&self.grid);
        let of_maps = |window: &Window| layout.chunks_of(*window).collect::<Vec<_>>();
        let maps: BTreeSet<[u32; 2]> = self.windows.iter().flat_map(of_maps).collect();
        let map_cells = layout.chunk[0] as usize * layout.chunk[1] as usize;
        let chunks = self.chunk_count() + OPEN_CHUNKS;
        chunks * ((CHUNK_ROWS * CHUNK_COLS) as usize) < maps.len() * map_cells
    }

    /// Are they a small part of the field?
    pub(crate) fn are_few(&self) -> bool {
        let chunks = self.chunk_count() + OPEN_CHUNKS;
        chunks * ((CHUNK_ROWS * CHUNK_COLS) as usize) < self.grid.cell_count()
    }

    /// Chunks of a field that hold them.
    fn chunk_count(&self) -> usize {
        let touched = |window: &Window| {
            let rows = window.row / CHUNK_ROWS..(window.row + window.rows).div_ceil(CHUNK_ROWS);
            let cols = window.col / CHUNK_COLS..(window.col + window.cols).div_ceil(CHUNK_COLS);
            let of_row = move |row: u32| cols.clone().map(move |col| [row, col]);
            rows.flat_map(of_row).collect::<Vec<_>>()
        };
        let all: BTreeSet<[u32; 2]> = self.windows.iter().flat_map(touched).collect();
        all.len()
    }

    /// Values of the windows in these fields, on all processors; numbers are in increasing order, as asked.
    ///
    /// # Errors
    /// The first field that is gone or damaged.
    pub(crate) async fn of(&self, fields: Vec<Asked>) -> Result<Vec<Found>, CubeError> {
        let processors = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let each = fields.len().div_ceil(processors).max(LEAST_OF_A_TASK);
        let mut tasks = JoinSet::new();
        let mut left = fields.into_iter();
        loop {
            let own: Vec<Asked> = left.by_ref().take(each).collect();
            if own.is_empty() {
                break;
            }
            let windows = self.clone();
            let number = tasks.len();
            tasks.spawn(async move { (number, windows.one_by_one(own).await) });
        }
        let mut parts: Vec<Vec<Found>> = (0..tasks.len()).map(|_| vec![]).collect();
        while let Some(ended) = tasks.join_next().await {
            let (number, found) =
                ended.map_err(|e| CubeError::library("a task", "reading fields", &e))?;
            parts[number] = found?;
        }
        Ok(parts.into_iter().flatten().collect())
    }

    /// The same of steps that the cube has too; none where a field is gone or damaged: the cube holds the same values.
    ///
    /// # Errors
    /// A store that does not answer.
    pub(crate) async fn of_sound(
        &self,
        fields: Vec<Asked>,
    ) -> Result<Option<Vec<Found>>, CubeError> {
        match self.of(fields).await {
            Err(error) if !error.is_retryable() => {
                tracing::warn!(%error, "a field cannot be read: the cube is");
                Ok(None)
            }
            found => found.map(Some),
        }
    }

    async fn one_by_one(&self, fields: Vec<Asked>) -> Result<Vec<Found>, CubeError> {
        let is_on_disk = |(field, _): &Asked| self.store.field_file(field).is_some();
        if !fields.iter().any(is_on_disk) {
            return self.by_requests(fields).await;
        }
        let mut found = vec![];
        let mut left = fields.into_iter();
        loop {
            let some: Vec<Asked> = left.by_ref().take(FIELDS_OF_A_THREAD).collect();
            if some.is_empty() {
                return Ok(found);
            }
            found.extend(self.some(some).await?);
        }
    }

    /// The same of as many as are read to the end once they are begun, whoever still waits for them.
    async fn some(&self, fields: Vec<Asked>) -> Result<Vec<Found>, CubeError> {
        let own = self.clone();
        let of_files = tokio::task::spawn_blocking(move || own.of_files(fields));
        let (mut found, others) = of_files
            .await
            .map_err(|e| CubeError::library("a thread", "reading fields", &e))?;
        if !others.is_empty() {
            found.extend(self.by_requests(others).await?);
            found.sort_unstable_by_key(|(number, _)| *number);
        }
        Ok(found)
    }

    /// Those that are files of this machine, and the others.
    fn of_files(&self, fields: Vec<Asked>) -> (Vec<Found>, Vec<Asked>) {
        let Some(windows) = FileWindows::new(&self.grid, &self.windows) else {
            return (vec![], fields);
        };
        let (mut found, mut others) = (vec![], vec![]);
        for (field, number) in fields {
            let file = self.store.field_file(&field);
            match file.and_then(|file| windows.read(&file, &field)) {
                Some(values) => found.push((number, values)),
                None => others.push((field, number)),
            }
        }
        (found, others)
    }

    async fn by_requests(&self, fields: Vec<Asked>) -> Result<Vec<Found>, CubeError> {
        let read = |(field, number): Asked| async move {
            let reader = fields::Reader::open(&self.store, &field, Some(&self.grid)).await?;
            let values = reader.windows(&self.windows).await?;
            Ok::<_, CubeError>((number, values))
        };
        let read = stream::iter(fields).map(read).buffered(FIELDS_OF_A_TASK);
        read.try_collect().await
    }
}
