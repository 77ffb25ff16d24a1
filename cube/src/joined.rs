//! A field in, a window of one of its coarser levels out, where no cube has it: the same bits, made from the rows below the window.

use contract::chunk::Window;
use contract::grid::Grid;
use contract::level::{self, Level};
use contract::quantity::Quantity;

use crate::joining::Joiner;
use crate::{Bands, CubeError, LevelWindow};

/// Values of a field that are held at a time, about.
const BAND_CELLS: u32 = 1 << 24;

/// Smallest and largest value of a field, 0 and 0 without data; it is read a band at a time.
///
/// # Errors
/// Whatever `bands` fail with.
pub async fn range_of_field(grid: &Grid, bands: &mut dyn Bands) -> Result<[f32; 2], CubeError> {
    let at_once = (BAND_CELLS / grid.cols).max(1);
    let mut range: Option<[f32; 2]> = None;
    let mut next = 0;
    while next < grid.rows {
        let rows = next..grid.rows.min(next.saturating_add(at_once));
        next = rows.end;
        for value in bands.rows(rows).await? {
            if value.is_finite() {
                let [least, most] = range.unwrap_or([value; 2]);
                range = Some([least.min(value), most.max(value)]);
            }
        }
    }
    Ok(range.unwrap_or_default())
}

/// A window of a level of a field, by the level's number, from 1 on. The rows below it are read, of all columns, a band at a time.
///
/// # Errors
/// `Outside` if there is no such level or window; whatever `bands` fail with.
pub async fn joined_window(
    (grid, quantity): (&Grid, Quantity),
    level: u32,
    window: Window,
    bands: &mut dyn Bands,
) -> Result<LevelWindow, CubeError> {
    let mut levels = level::levels(grid);
    levels.truncate(level as usize);
    let outside = || CubeError::Outside {
        what: format!("level {level}, {window:?}"),
        steps: 1,
        rows: grid.rows,
        cols: grid.cols,
    };
    let own: Level = *levels.last().filter(|_| level > 0).ok_or_else(outside)?;
    let fits = |from: u32, count: u32, all: u32| {
        count > 0 && from.checked_add(count).is_some_and(|end| end <= all)
    };
    if own.number != level
        || !fits(window.row, window.rows, own.grid.rows)
        || !fits(window.col, window.cols, own.grid.cols)
    {
        return Err(outside());
    }
    let edges = own.row_edges(grid);
    let (first, end) = (
        edges[window.row as usize],
        edges[(window.row + window.rows) as usize],
    );
    let mut joiner = Joiner::new(grid, quantity, &levels, first);
    let at_once = (BAND_CELLS / grid.cols).max(1);
    let mut found = LevelWindow {
        values: vec![],
        coverage: vec![],
    };
    let (from, to) = (window.col as usize, (window.col + window.cols) as usize);
    let mut next = first;
    while next < end {
        let rows = next..end.min(next.saturating_add(at_once));
        next = rows.end;
        let values = bands.rows(rows).await?;
        let joined = tokio::task::spawn_blocking(move || {
            joiner.take(&values);
            joiner
        });
        joiner = joined
            .await
            .map_err(|e| CubeError::library("a thread", "joining cells", e))?;
        let done = joiner.done(levels.len() - 1);
        let cols = own.grid.cols as usize;
        for row in done.values.chunks_exact(cols) {
            found.values.extend(&row[from..to]);
        }
        for row in done.coverage.chunks_exact(cols) {
            found.coverage.extend(&row[from..to]);
        }
    }
    Ok(found)
}
