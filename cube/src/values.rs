//! A version of a product in, its values along time out, from where they are read fastest: runs of its cube that are
//! time-major, map-major chunks of it, and fields where a few cells are wanted, or where the cube does not have the version or is behind.
//!
//! Steps are the same where their periods and the digests of their values are, so that all three give the same bits, and a
//! cube of another version serves wherever it holds the same steps.

use std::cell::LazyCell;
use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::Arc;

use contract::chunk::Window;
use contract::key::ObjectKey;
use contract::kind::Vouched;
use contract::manifest::Manifest;
use futures::future::BoxFuture;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use storage::{Store, fields};

use crate::blocks::with_decoder;
use crate::field_bands::FieldBands;
use crate::field_windows::{FieldWindows, Found};
use crate::follow::folder;
use crate::joined::joined_window;
use crate::layout::{BLOCK_CELLS, RUN_STEPS};
use crate::stored_chunks::{StoredChunks, Undecoded};
use crate::{At, Cube, CubeError, LevelWindow, Repository};

/// Runs that are read at a time.
const RUNS_AT_ONCE: usize = 16;
/// Steps that are read map-major at a time.
const STEPS_AT_ONCE: usize = 4;
/// Fields that are read at a time, whole.
const FIELDS_AT_ONCE: usize = 2;

/// Where a step is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// At its place in one of the states of the cube.
    Cube { cube: usize, step: usize },
    /// In its field.
    Field,
}

/// Values of one version of a product. It does not change; clones share it.
#[derive(Clone)]
pub struct Values(Arc<Inner>);

struct Inner {
    store: Store,
    manifest: Arc<Manifest>,
    /// The newest state and, if that has not all steps, the version's own.
    cubes: Vec<Cube>,
    /// Of each step of the version.
    places: Vec<Place>,
    /// Where the cube is and how it was when its steps were looked for; none where there was none.
    seen: Option<Seen>,
}

/// A cube as it was seen.
struct Seen {
    repository: Repository,
    /// Its newest state.
    snapshot: String,
    /// Had the version a state of its own?
    has_own: bool,
}

/// Values of a block of cells in some steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Row and column of blocks, each of [`BLOCK_CELLS`] cells a side, from the north-west corner on.
    pub at: [u32; 2],
    /// Its cells; less than a whole block's where the grid ends.
    pub window: Window,
    /// `[cell, step]`, stored unit, NaN no data; cells row by row.
    pub values: Vec<f32>,
}

impl Block {
    /// A block without data.
    fn empty(manifest: &Manifest, at: [u32; 2], steps: usize) -> Result<Self, CubeError> {
        let grid = &manifest.grid;
        let corner = at.map(|side| side.saturating_mul(BLOCK_CELLS));
        if corner[0] >= grid.rows || corner[1] >= grid.cols {
            return Err(CubeError::Outside {
                what: format!("block {at:?}"),
                steps: manifest.steps.len(),
                rows: grid.rows,
                cols: grid.cols,
            });
        }
        let window = Window {
            row: corner[0],
            col: corner[1],
            rows: BLOCK_CELLS.min(grid.rows - corner[0]),
            cols: BLOCK_CELLS.min(grid.cols - corner[1]),
        };
        let values = vec![f32::NAN; window.cell_count() * steps];
        Ok(Self { at, window, values })
    }

    /// Puts one step's values in, `[row, col]` of its window.
    fn put_map(&mut self, map: &[f32], step: usize, steps: usize) {
        for (cell, value) in map.iter().enumerate() {
            self.values[cell * steps + step] = *value;
        }
    }
}

/// Steps side by side in a run that are side by side among those asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece {
    /// Place of the first one in the run.
    pub in_run: usize,
    /// Its place among those asked for.
    pub asked: usize,
    /// How many they are.
    pub count: usize,
}

/// Blocks of a run of steps, read and not decoded yet.
pub struct EncodedBlocks {
    cube: Cube,
    run: usize,
    at: Vec<[u32; 2]>,
    content: StoredChunks,
    pieces: Vec<Piece>,
}

impl EncodedBlocks {
    /// Where the steps that were asked for lie in the run.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// The same in parts of so many blocks each, in their order; a block's place is that among those of its part.
    pub fn split(self, each: usize) -> Vec<Self> {
        let each = each.max(1);
        let count = self.at.len().div_ceil(each);
        let parts = self.at.chunks(each).zip(self.content.split(each, count));
        let part = |(at, content): (&[[u32; 2]], StoredChunks)| Self {
            cube: self.cube.clone(),
            run: self.run,
            at: at.to_vec(),
            content,
            pieces: self.pieces.clone(),
        };
        parts.map(part).collect()
    }

    /// Bytes of all of them as they are stored.
    pub fn stored_bytes(&self) -> usize {
        self.content.stored_bytes()
    }

    /// Reads and decodes one block after the other, as they lie in their shards, and hands over its place among those asked for and its values, `[cell, step]` of 8 x 8
    /// cells and [`RUN_STEPS`](crate::RUN_STEPS) steps, stored unit, NaN no data; those without any data are left out. `rows` says of a block which of its rows of cells
    /// are wanted, a bit each, the northernmost lowest; values of others are any. `take` says whether to go on.
    ///
    /// # Errors
    /// The first block that is damaged; [`EncodedBlocks::error`] makes an error of it.
    pub fn each(
        &self,
        rows: impl Fn(usize) -> u8,
        mut take: impl FnMut(usize, &[f32]) -> bool,
    ) -> Result<(), Undecoded> {
        let decoded = with_decoder(|decoder| {
            self.content.each(|number, content| {
                let values = decoder.decode(content, rows(number));
                let values = values.map_err(|reason| Undecoded(number, reason))?;
                Ok(take(number, values))
            })
        });
        decoded.map_err(|reason| Undecoded(0, reason))?
    }

    /// The error of a block that cannot be decoded, which names its object.
    pub async fn error(&self, undecoded: Undecoded) -> CubeError {
        let Undecoded(number, reason) = undecoded;
        self.cube
            .undecoded(self.run, self.at[number], &reason)
            .await
    }
}

/// What is to be read for some steps, by their places among those asked for.
#[derive(Default)]
struct Reads {
    /// Of which states which runs.
    runs: BTreeMap<(usize, usize), Vec<Piece>>,
    /// State, step in it, asked step.
    maps: Vec<(usize, usize, usize)>,
    /// Step of the version, asked step.
    fields: Vec<(usize, usize)>,
}

impl Reads {
    /// Takes steps that lie side by side in a run.
    fn take(&mut self, piece: Option<((usize, usize), Piece)>) {
        if let Some((run, piece)) = piece {
            self.runs.entry(run).or_default().push(piece);
        }
    }
}

impl Values {
    /// Finds where the steps of a version are.
    ///
    /// # Errors
    /// A store that does not answer; a cube whose state cannot be read.
    pub fn of<'a>(
        store: &'a Store,
        manifest: &'a Arc<Manifest>,
    ) -> BoxFuture<'a, Result<Self, CubeError>> {
        Box::pin(async move {
            let mut own = Inner {
                store: store.clone(),
                places: vec![Place::Field; manifest.steps.len()],
                manifest: Arc::clone(manifest),
                cubes: vec![],
                seen: None,
            };
            let repository = match Repository::open(store, &folder(&manifest.product)).await {
                Ok(repository) => repository,
                Err(CubeError::Missing { .. }) => return Ok(Self(Arc::new(own))),
                Err(error) => return Err(error),
            };
            let newest = repository.at(&At::Newest).await?;
            let snapshot = newest.snapshot().await;
            own.take(newest);
            let mut has_own = false;
            if own.places.contains(&Place::Field) {
                let version = At::Version(manifest.number.to_string());
                match repository.at(&version).await {
                    Ok(cube) => {
                        has_own = true;
                        own.take(cube);
                    }
                    Err(CubeError::NoVersion { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
            own.seen = Some(Seen {
                repository,
                snapshot,
                has_own,
            });
            Ok(Self(Arc::new(own)))
        })
    }

    /// Had its product a cube, which can be asked whether it is the same still?
    pub fn has_cube(&self) -> bool {
        self.0.seen.is_some()
    }

    /// Would opening the version again find the same? By one read of what the cube's repository tells of all its states, or two where
    /// the cube lacks steps of it; a version whose product had no cube is to be opened again.
    ///
    /// # Errors
    /// A store that does not answer.
    pub fn is_current(&self) -> BoxFuture<'_, Result<bool, CubeError>> {
        Box::pin(async move {
            let Some(seen) = &self.0.seen else {
                return Ok(false);
            };
            if seen.repository.newest_snapshot().await? != seen.snapshot {
                return Ok(false);
            }
            if seen.has_own || !self.0.places.contains(&Place::Field) {
                return Ok(true);
            }
            // A state may be given the version's name without any change of the newest one.
            let version = self.0.manifest.number.to_string();
            Ok(!seen.repository.has_version(&version).await?)
        })
    }

    /// The version.
    pub fn manifest(&self) -> &Manifest {
        &self.0.manifest
    }

    /// Is all of it in the cube, and every run time-major that compaction would make? Then it is as fast as it will be.
    pub fn is_settled(&self) -> bool {
        let Inner { places, cubes, .. } = &*self.0;
        let is_compact = |cube: &Cube| cube.runs().first_missing(cube.steps()).is_none();
        !places.contains(&Place::Field) && cubes.iter().all(is_compact)
    }

    /// Steps that have to be read from their fields.
    pub fn in_fields_count(&self) -> usize {
        let places = self.0.places.iter();
        places.filter(|place| **place == Place::Field).count()
    }

    /// Runs of steps that the time-major copy holds, in the order of the version's steps.
    pub fn time_major(&self) -> Vec<Range<usize>> {
        let is_held = |run: &Range<usize>| match self.0.places[run.start] {
            Place::Cube { cube, step } => self.0.cubes[cube].run_of(step).is_some(),
            Place::Field => false,
        };
        self.runs().into_iter().filter(is_held).collect()
    }

    /// Where runs of steps begin and end that are best asked for together, so that no chunk is read twice: those of the
    /// time-major copy, and pieces of at most as many steps of the rest.
    pub fn runs(&self) -> Vec<Range<usize>> {
        let places = &self.0.places;
        let run_of = |place: &Place| match place {
            Place::Cube { cube, step } => {
                let run = self.0.cubes[*cube].run_of(*step);
                run.map(|run| (*cube, run))
            }
            Place::Field => None,
        };
        let mut runs: Vec<Range<usize>> = vec![];
        let mut before = None;
        for (step, place) in places.iter().enumerate() {
            let run = run_of(place);
            match runs.last_mut() {
                Some(last) if before == Some(run) && last.len() < RUN_STEPS => last.end = step + 1,
                _ => runs.push(step..step + 1),
            }
            before = Some(run);
        }
        runs
    }

    /// Values of one cell at every step, stored unit, NaN no data.
    ///
    /// # Errors
    /// `Outside` if there is no such cell; a chunk that is damaged or gone, by its name.
    pub fn cell(&self, row: u32, col: u32) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        Box::pin(async move {
            let steps = 0..self.0.places.len();
            let at = [row / BLOCK_CELLS, col / BLOCK_CELLS];
            let mut block = Block::empty(&self.0.manifest, at, 0)?;
            let Window { rows, cols, .. } = block.window;
            if row - block.window.row >= rows || col - block.window.col >= cols {
                return Err(self.outside(&format!("cell {row}, {col}")));
            }
            block.window = Window {
                row,
                col,
                rows: 1,
                cols: 1,
            };
            block.values = vec![f32::NAN; steps.len()];
            let mut blocks = vec![block];
            self.read(&mut blocks, steps).await?;
            Ok(blocks.pop().map(|block| block.values).unwrap_or_default())
        })
    }

    /// Values of some blocks in a run of steps of the version, in the order asked for. As many are held at once.
    ///
    /// # Errors
    /// As [`Values::cell`].
    pub fn blocks<'a>(
        &'a self,
        blocks: &'a [[u32; 2]],
        steps: Range<usize>,
    ) -> BoxFuture<'a, Result<Vec<Block>, CubeError>> {
        Box::pin(async move {
            if steps.start > steps.end || steps.end > self.0.places.len() {
                return Err(self.outside(&format!("steps {steps:?}")));
            }
            let empty = |at: &[u32; 2]| Block::empty(&self.0.manifest, *at, steps.len());
            let mut found: Vec<Block> = blocks.iter().map(empty).collect::<Result<_, _>>()?;
            self.read(&mut found, steps).await?;
            Ok(found)
        })
    }

    /// Values of some windows of cells of one step, `[row, col]` of each, in the order asked: of its map-major chunks those that
    /// they touch, each once; of the field's where those are less, or where the cube does not have the step.
    ///
    /// # Errors
    /// As [`Values::cell`].
    pub async fn windows(
        &self,
        step: usize,
        windows: &[Window],
    ) -> Result<Vec<Vec<f32>>, CubeError> {
        let Inner {
            store,
            manifest,
            places,
            cubes,
            ..
        } = &*self.0;
        match places.get(step) {
            None => Err(self.outside(&format!("step {step}"))),
            Some(Place::Cube {
                cube,
                step: in_cube,
            }) => {
                let of_fields = FieldWindows::new(store, &manifest.grid, windows);
                if of_fields.are_quicker() {
                    let field = manifest.steps[step].field.clone();
                    if let Some(mut found) = of_fields.of_sound(vec![(field, step)]).await? {
                        return Ok(found.pop().map(|(_, values)| values).unwrap_or_default());
                    }
                }
                cubes[*cube].windows(*in_cube, windows).await
            }
            Some(Place::Field) => {
                let grid = &manifest.grid;
                for window in windows {
                    let Window { row, col, .. } = *window;
                    if row.saturating_add(window.rows) > grid.rows
                        || col.saturating_add(window.cols) > grid.cols
                    {
                        return Err(self.outside(&format!("{window:?}")));
                    }
                }
                let field = &manifest.steps[step].field;
                let reader = fields::Reader::open(store, field, Some(grid)).await?;
                Ok(reader.windows(windows).await?)
            }
        }
    }

    /// A window of cells of a coarser level of one step, by the level's number; level 0 are the values themselves. Of the cube the
    /// chunks that it touches; where that has no levels of the step, they are made of the field.
    ///
    /// # Errors
    /// As [`Values::cell`].
    pub async fn window_at(
        &self,
        level: u32,
        window: Window,
        step: usize,
    ) -> Result<LevelWindow, CubeError> {
        let Inner {
            store,
            manifest,
            places,
            cubes,
            ..
        } = &*self.0;
        let Some(place) = places.get(step) else {
            return Err(self.outside(&format!("step {step}")));
        };
        if let Place::Cube { cube, step } = place
            && let Some(found) = cubes[*cube].window_at(level, window, *step).await?
        {
            return Ok(found);
        }
        if level == 0 {
            let mut values = self.windows(step, &[window]).await?;
            return Ok(LevelWindow::of_cells(values.pop().unwrap_or_default()));
        }
        let mut bands = FieldBands::new(store, &manifest.steps[step].field, &manifest.grid);
        let of = (&manifest.grid, manifest.quantity);
        joined_window(of, level, window, &mut bands).await
    }

    /// Blocks of a run of steps as they are stored, where the time-major copy holds all of these steps; they are decoded one
    /// after the other, and none of them is copied. None where it does not.
    ///
    /// # Errors
    /// As [`Values::cell`].
    pub fn encoded<'a>(
        &'a self,
        blocks: &'a [[u32; 2]],
        steps: Range<usize>,
    ) -> BoxFuture<'a, Result<Option<EncodedBlocks>, CubeError>> {
        Box::pin(async move {
            if steps.start > steps.end || steps.end > self.0.places.len() {
                return Err(self.outside(&format!("steps {steps:?}")));
            }
            let Some((cube, run, pieces)) = self.run_of(&steps) else {
                return Ok(None);
            };
            let content = cube.stored_blocks(run, blocks).await?;
            Ok(Some(EncodedBlocks {
                cube,
                run,
                at: blocks.to_vec(),
                content,
                pieces,
            }))
        })
    }

    /// The one run that holds all of these steps, and where; none where several do, or none.
    pub(crate) fn run_of(&self, steps: &Range<usize>) -> Option<(Cube, usize, Vec<Piece>)> {
        if steps.start > steps.end || steps.end > self.0.places.len() {
            return None;
        }
        let reads = self.reads(steps);
        let is_all = reads.maps.is_empty() && reads.fields.is_empty();
        let mut runs = reads.runs.into_iter();
        let (Some(((cube, run), pieces)), None, true) = (runs.next(), runs.next(), is_all) else {
            return None;
        };
        Some((self.0.cubes[cube].clone(), run, pieces))
    }

    fn outside(&self, what: &str) -> CubeError {
        let Manifest { grid, steps, .. } = &*self.0.manifest;
        CubeError::Outside {
            what: what.to_owned(),
            steps: steps.len(),
            rows: grid.rows,
            cols: grid.cols,
        }
    }

    /// Where the asked steps are.
    fn reads(&self, steps: &Range<usize>) -> Reads {
        let mut reads = Reads::default();
        // Steps side by side are mostly of one run.
        let mut last = None;
        for (asked, step) in steps.clone().enumerate() {
            let Place::Cube { cube, step } = self.0.places[step] else {
                reads.fields.push((step, asked));
                continue;
            };
            let Some(run) = self.0.cubes[cube].run_of(step) else {
                reads.maps.push((cube, step, asked));
                continue;
            };
            let in_run = step % RUN_STEPS;
            match &mut last {
                Some((
                    own,
                    Piece {
                        in_run: first,
                        asked: begun,
                        count,
                    },
                )) if *own == (cube, run)
                    && *first + *count == in_run
                    && *begun + *count == asked =>
                {
                    *count += 1;
                }
                last => {
                    let piece = Piece {
                        in_run,
                        asked,
                        count: 1,
                    };
                    reads.take(last.replace(((cube, run), piece)));
                }
            }
        }
        reads.take(last);
        reads
    }

    /// Fills blocks with the values of some steps.
    async fn read(&self, blocks: &mut [Block], steps: Range<usize>) -> Result<(), CubeError> {
        let cubes = &self.0.cubes;
        let reads = self.reads(&steps);
        let asked: Vec<[u32; 2]> = blocks.iter().map(|block| block.at).collect();
        let windows: Vec<Window> = blocks.iter().map(|block| block.window).collect();
        let asked = &asked;
        let find = |((cube, run), pieces): ((usize, usize), Vec<Piece>)| async move {
            let content = cubes[cube].stored_blocks(run, asked).await?;
            Ok::<_, CubeError>(EncodedBlocks {
                cube: cubes[cube].clone(),
                run,
                at: asked.clone(),
                content,
                pieces,
            })
        };
        let found = stream::iter(reads.runs).map(find).buffered(RUNS_AT_ONCE);
        let mut found = found.try_chunks(RUNS_AT_ONCE);
        while let Some(runs) = found.try_next().await.map_err(|e| e.1)? {
            for run in decoded(runs, &windows).await? {
                run.put(blocks, steps.len());
            }
        }
        self.read_maps(blocks, &windows, (reads.maps, &steps))
            .await?;
        self.read_fields(blocks, &windows, (reads.fields, &steps))
            .await
    }

    /// Fills blocks with the values of steps that no run holds: from a few chunks of their fields, or from maps in the cube.
    async fn read_maps(
        &self,
        blocks: &mut [Block],
        windows: &[Window],
        (maps, steps): (Vec<(usize, usize, usize)>, &Range<usize>),
    ) -> Result<(), CubeError> {
        let Inner {
            store,
            manifest,
            cubes,
            ..
        } = &*self.0;
        let of_fields = FieldWindows::new(store, &manifest.grid, windows);
        if !maps.is_empty() && of_fields.are_quicker() {
            let field = |(_cube, _step, asked): &(usize, usize, usize)| {
                let field = &manifest.steps[steps.start + asked].field;
                (field.clone(), *asked)
            };
            let found = of_fields.of_sound(maps.iter().map(field).collect());
            if let Some(found) = found.await? {
                put_maps(blocks, &found, steps.len());
                return Ok(());
            }
        }
        let read = |(cube, step, asked): (usize, usize, usize)| async move {
            let maps = cubes[cube].windows(step, windows).await?;
            Ok::<_, CubeError>((asked, maps))
        };
        let mut found = stream::iter(maps).map(read).buffered(STEPS_AT_ONCE);
        while let Some(found) = found.try_next().await? {
            put_maps(blocks, &[found], steps.len());
        }
        Ok(())
    }

    /// Fills blocks with the values of steps that the cube does not have.
    async fn read_fields(
        &self,
        blocks: &mut [Block],
        windows: &[Window],
        (asked, steps): (Vec<(usize, usize)>, &Range<usize>),
    ) -> Result<(), CubeError> {
        let Inner {
            store, manifest, ..
        } = &*self.0;
        let grid = &manifest.grid;
        let asked = asked.into_iter();
        let asked = asked.map(|(step, asked)| (manifest.steps[step].field.clone(), asked));
        let of_fields = FieldWindows::new(store, grid, windows);
        if of_fields.are_few() {
            let found = of_fields.of(asked.collect()).await?;
            put_maps(blocks, &found, steps.len());
            return Ok(());
        }
        let read = |(field, asked): (ObjectKey, usize)| async move {
            let values = fields::read(store, &field, grid).await?;
            Ok::<_, CubeError>((asked, values))
        };
        let mut found = stream::iter(asked).map(read).buffered(FIELDS_AT_ONCE);
        while let Some((asked, values)) = found.try_next().await? {
            for block in blocks.iter_mut() {
                let own = block.window.cell_indices(grid);
                let map: Vec<f32> = own.map(|index| values[index]).collect();
                block.put_map(&map, asked, steps.len());
            }
        }
        Ok(())
    }
}

/// Puts values of steps into blocks, by the number of each among so many that are asked for.
fn put_maps(blocks: &mut [Block], found: &[Found], steps: usize) {
    for (asked, maps) in found {
        for (block, map) in blocks.iter_mut().zip(maps) {
            block.put_map(map, *asked, steps);
        }
    }
}

/// Values of blocks in the steps of a run that are asked for, `[cell, step]` of each window.
struct DecodedRun {
    pieces: Vec<Piece>,
    /// By the number of a block; those without any data are left out.
    blocks: Vec<(usize, Vec<f32>)>,
}

impl DecodedRun {
    /// Of `windows` those cells that blocks have.
    fn of(encoded: &EncodedBlocks, windows: &[Window]) -> Result<Self, Undecoded> {
        let mut blocks = vec![];
        let rows = |number: usize| {
            let Window { row, rows, .. } = windows[number];
            (row..row + rows).fold(0, |bits, row| bits | 1 << (row % BLOCK_CELLS))
        };
        encoded.each(rows, |number, values| {
            blocks.push((number, picked(values, windows[number], encoded.pieces())));
            true
        })?;
        Ok(Self {
            pieces: encoded.pieces.clone(),
            blocks,
        })
    }

    /// Puts its values among those of `steps` steps.
    fn put(&self, blocks: &mut [Block], steps: usize) {
        let own_steps = self.pieces.iter().map(|piece| piece.count).sum();
        for (number, values) in &self.blocks {
            let cells = values.chunks_exact(own_steps);
            let targets = blocks[*number].values.chunks_exact_mut(steps);
            for (target, mut values) in targets.zip(cells) {
                for piece in &self.pieces {
                    let (own, rest) = values.split_at(piece.count);
                    target[piece.asked..piece.asked + piece.count].copy_from_slice(own);
                    values = rest;
                }
            }
        }
    }
}

/// Values of the cells of a window of a block, `[cell, step]` of a whole one, as far as their steps are asked for.
fn picked(values: &[f32], window: Window, pieces: &[Piece]) -> Vec<f32> {
    let Window { row, col, cols, .. } = window;
    let (top, left) = (row % BLOCK_CELLS, col % BLOCK_CELLS);
    let mut picked = vec![];
    for cell in 0..window.cell_count() {
        let (down, right) = (cell as u32 / cols, cell as u32 % cols);
        let in_block = ((top + down) * BLOCK_CELLS + left + right) as usize;
        for piece in pieces {
            let from = in_block * RUN_STEPS + piece.in_run;
            picked.extend_from_slice(&values[from..from + piece.count]);
        }
    }
    picked
}

/// Reads and decodes runs, on as many threads as there are processors: a thread a run would take longer to begin than to decode.
async fn decoded(
    runs: Vec<EncodedBlocks>,
    windows: &[Window],
) -> Result<Vec<DecodedRun>, CubeError> {
    let threads = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let each = runs.len().div_ceil(threads).max(1);
    let (runs, windows): (Arc<[EncodedBlocks]>, Arc<[Window]>) = (runs.into(), windows.into());
    let part = |from: usize| {
        let (runs, windows) = (Arc::clone(&runs), Arc::clone(&windows));
        tokio::task::spawn_blocking(move || {
            let own = from..runs.len().min(from + each);
            let decoded = own.map(|run| {
                let decoded = DecodedRun::of(&runs[run], &windows);
                decoded.map_err(|undecoded| (run, undecoded))
            });
            decoded.collect::<Result<Vec<DecodedRun>, _>>()
        })
    };
    let parts: Vec<_> = (0..runs.len()).step_by(each).map(part).collect();
    let mut all = vec![];
    for part in parts {
        let part = part.await;
        match part.map_err(|e| CubeError::library("a thread", "decoding values", &e))? {
            Ok(decoded) => all.extend(decoded),
            Err((run, undecoded)) => return Err(runs[run].error(undecoded).await),
        }
    }
    Ok(all)
}

impl Inner {
    /// Takes the steps of a state of the cube that are the version's.
    fn take(&mut self, cube: Cube) {
        let (own, there) = (&self.manifest, cube.description());
        let is_same_cells = (own.grid.rows, own.grid.cols) == (there.grid.rows, there.grid.cols)
            && own.quantity.is_same_kind(there.quantity);
        if there.product != own.product || !is_same_cells {
            return;
        }
        // Its own name is costly to compute, and needed for old fields only.
        let is_version = LazyCell::new(|| {
            let version = there.version.as_ref();
            version.is_some_and(|it| it.number == own.number && *it == own.id())
        });
        let number = self.cubes.len();
        for (place, step) in self.places.iter_mut().zip(&own.steps) {
            let start = step.period.start;
            let found = cube
                .steps()
                .binary_search_by_key(&start, |it| it.period.start);
            let Ok(found) = found else { continue };
            let there = &cube.steps()[found];
            let is_same = match step.field.vouches() {
                Vouched::Values(digest) => there.values_sha256 == digest,
                // Named by its bytes: only the version's own state is known to hold them.
                Vouched::Bytes(_) | Vouched::Nothing => *is_version,
            };
            if *place == Place::Field && is_same && there.period == step.period {
                *place = Place::Cube {
                    cube: number,
                    step: found,
                };
            }
        }
        self.cubes.push(cube);
    }
}
