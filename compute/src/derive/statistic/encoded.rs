//! Blocks of cells of a version along time: found by whoever waits for a store, decoded by whoever computes with them.

use std::ops::Range;

use contract::chunk::Window;
use cube::{BLOCK_CELLS, Block, CubeError, EncodedBlocks, RUN_STEPS, Undecoded, Values};
use futures::{FutureExt as _, StreamExt as _, TryStreamExt as _, stream};

use crate::ComputeError;

/// Time-major runs that are looked for at once.
const RUNS_AT_ONCE: usize = 16;

/// Some blocks in some steps, not decoded yet.
pub(super) struct Encoded {
    windows: Vec<Window>,
    /// Steps of the version, with what they are decoded from.
    runs: Vec<(Range<usize>, Run)>,
}

/// A run of steps.
enum Run {
    /// As the time-major copy has it.
    Encoded(EncodedBlocks),
    /// Read map by map.
    Read(Vec<Block>),
}

/// A run that cannot be decoded, by its place among those that were asked for, and why.
pub(super) struct Damaged(usize, Undecoded);

impl Encoded {
    /// Finds some blocks, by their cells, in some steps of a version.
    ///
    /// # Errors
    /// As [`Values::blocks`].
    pub(super) async fn find(
        values: &Values,
        windows: Vec<Window>,
        steps: Range<usize>,
    ) -> Result<Self, CubeError> {
        let at = at(&windows);
        let find = |run: Range<usize>| {
            let at = &at;
            async move { Ok::<_, CubeError>((values.encoded(at, run.clone()).await?, run)) }.boxed()
        };
        let runs = values.runs().into_iter();
        let runs = runs.map(|run| run.start.max(steps.start)..run.end.min(steps.end));
        let found = stream::iter(runs.filter(|run| !run.is_empty()).map(find));
        let found: Vec<_> = found.buffered(RUNS_AT_ONCE).try_collect().await?;
        let mut runs = vec![];
        for (encoded, run) in found {
            let own = match encoded {
                Some(encoded) => Run::Encoded(encoded),
                // One after the other: each reads several maps at once as it is.
                None => Run::Read(values.blocks(&at, run.clone()).await?),
            };
            runs.push((run, own));
        }
        Ok(Self { windows, runs })
    }

    /// The same in parts of so many blocks each, in their order.
    pub(super) fn split(self, each: usize) -> Vec<Self> {
        let parts = self.windows.chunks(each);
        let mut parts: Vec<Self> = parts
            .map(|windows| Self {
                windows: windows.to_vec(),
                runs: vec![],
            })
            .collect();
        for (steps, run) in self.runs {
            match run {
                Run::Encoded(encoded) => {
                    for (part, own) in parts.iter_mut().zip(encoded.split(each)) {
                        part.runs.push((steps.clone(), Run::Encoded(own)));
                    }
                }
                Run::Read(blocks) => {
                    let mut blocks = blocks.into_iter();
                    for part in &mut parts {
                        let own = blocks.by_ref().take(part.windows.len()).collect();
                        part.runs.push((steps.clone(), Run::Read(own)));
                    }
                }
            }
        }
        parts
    }

    /// Their cells.
    pub(super) fn windows(&self) -> &[Window] {
        &self.windows
    }

    /// Decodes them: `[cell, step]` of these steps of the version, cells as windows have them, one window after the other; NaN no data,
    /// and at steps that were not looked for.
    pub(super) fn values(&self, steps: &Range<usize>) -> Result<Vec<f32>, Damaged> {
        let mut first = vec![];
        let mut cells = 0;
        for window in &self.windows {
            first.push(cells);
            cells += window.cell_count();
        }
        let mut values = vec![f32::NAN; cells * steps.len()];
        for (number, (of_run, run)) in self.runs.iter().enumerate() {
            let from = of_run.start - steps.start;
            let mut put = |cell: usize, at: usize, own: &[f32]| {
                values[cell * steps.len() + from + at..][..own.len()].copy_from_slice(own);
            };
            match run {
                Run::Read(blocks) => {
                    for (block, first) in blocks.iter().zip(&first) {
                        let cells = block.values.chunks_exact(of_run.len());
                        for (cell, own) in cells.enumerate() {
                            put(first + cell, 0, own);
                        }
                    }
                }
                Run::Encoded(encoded) => {
                    let all_rows = |_block| u8::MAX;
                    let decoded = encoded.each(all_rows, |block, own| {
                        let window = self.windows[block];
                        for cell in 0..window.cell_count() {
                            let (down, right) =
                                (cell as u32 / window.cols, cell as u32 % window.cols);
                            let in_block = (down * BLOCK_CELLS + right) as usize;
                            for piece in encoded.pieces() {
                                let at = in_block * RUN_STEPS + piece.in_run;
                                put(first[block] + cell, piece.asked, &own[at..][..piece.count]);
                            }
                        }
                        true
                    });
                    decoded.map_err(|undecoded| Damaged(number, undecoded))?;
                }
            }
        }
        Ok(values)
    }

    /// The error of what cannot be decoded, which names its object.
    pub(super) async fn error(&self, Damaged(number, undecoded): Damaged) -> ComputeError {
        match &self.runs[number].1 {
            Run::Encoded(encoded) => encoded.error(undecoded).await.into(),
            Run::Read(_) => ComputeError::inconsistent("blocks of cells", "they were decoded"),
        }
    }
}

/// Rows and columns of blocks.
fn at(blocks: &[Window]) -> Vec<[u32; 2]> {
    let at = |block: &Window| [block.row, block.col].map(|side| side / BLOCK_CELLS);
    blocks.iter().map(at).collect()
}
