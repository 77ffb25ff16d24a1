//! The map-major arrays that a step has chunks in: its values, and of each coarser level values and how much of cells holds data.
//! Bands of rows in, objects in the store out.

use std::ops::Range;
use std::sync::Arc;

use contract::grid::Grid;
use contract::level::{self, Level};
use contract::quantity::Quantity;
use futures::stream::{StreamExt as _, TryStreamExt as _};
use icechunk::format::manifest::ChunkPayload;
use icechunk::format::{ChunkIndices, Path};
use icechunk::session::{Session, SessionError};
use tokio::sync::RwLock;

use crate::field::{EncodedObject, Encoder, Number};
use crate::joining::Joiner;
use crate::plain::{self, OBJECTS_AT_ONCE};
use crate::{Bands, CubeError, Description, Layout, arrays};

/// Objects of a step in one array, by row and column; none where no cell has data.
pub(crate) type Objects = Vec<([u32; 2], Option<ChunkPayload>)>;

/// Writes steps of one product.
pub(crate) struct Parts {
    grid: Grid,
    quantity: Quantity,
    values: Arc<Encoder<f32>>,
    levels: Vec<LevelParts>,
}

struct LevelParts {
    values: Arc<Encoder<f32>>,
    coverage: Arc<Encoder<u8>>,
}

/// An array along time: its path, and rows and columns of all objects of a step.
pub(crate) struct Track {
    pub(crate) path: Path,
    pub(crate) indices: Vec<[u32; 2]>,
}

/// A step whose objects are in the store.
pub(crate) struct SentStep {
    /// In each array, in the order of [`Parts::tracks`].
    pub(crate) objects: Vec<Objects>,
    /// Smallest and largest value, 0 and 0 without data or levels.
    pub(crate) range: [f32; 2],
}

/// What of a step is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sent {
    All,
    /// Its values are in the store.
    Levels,
}

impl Parts {
    pub(crate) fn new(description: &Description) -> Result<Self, CubeError> {
        let of_level = |level: &Level| {
            let (grid, layout) = (&level.grid, Layout::of_level(&level.grid));
            let values = arrays::level_values(description, level, 1)?;
            let coverage = arrays::level_coverage(description, level, 1)?;
            Ok(LevelParts {
                values: Arc::new(Encoder::of(values, grid, layout)),
                coverage: Arc::new(Encoder::of(coverage, grid, layout)),
            })
        };
        let levels = level::levels(&description.grid);
        Ok(Self {
            grid: description.grid,
            quantity: description.quantity,
            values: Arc::new(Encoder::new(description)?),
            levels: levels
                .iter()
                .map(of_level)
                .collect::<Result<_, CubeError>>()?,
        })
    }

    /// Have steps levels?
    pub(crate) fn has_levels(&self) -> bool {
        !self.levels.is_empty()
    }

    /// All arrays, in the order in which objects of a step are told: that of values first.
    pub(crate) fn tracks(&self) -> Result<Vec<Track>, CubeError> {
        let of_levels = self.levels.iter().flat_map(|level| {
            let values = (level.values.path(), level.values.indices());
            [values, (level.coverage.path(), level.coverage.indices())]
        });
        let values = (self.values.path(), self.values.indices());
        let all = std::iter::once(values).chain(of_levels);
        let track = |(path, indices): (&str, _)| {
            let named = Path::new(path);
            let path = named.map_err(|e| CubeError::library(path, "naming an array", e))?;
            Ok(Track { path, indices })
        };
        all.map(track).collect()
    }

    /// Sends a step, a band of rows at a time.
    pub(crate) async fn send(
        &self,
        session: &RwLock<Session>,
        bands: &mut dyn Bands,
        sent: Sent,
    ) -> Result<SentStep, CubeError> {
        let mut objects: Vec<Objects> = vec![vec![]; 1 + 2 * self.levels.len()];
        let mut joiner = Joiner::of_all(&self.grid, self.quantity);
        let mut waiting: Vec<LevelBand> =
            self.levels.iter().map(|_| LevelBand::default()).collect();
        for (row, rows) in self.values.bands().enumerate() {
            let count = rows.len() * self.grid.cols as usize;
            let band: Arc<[f32]> = bands.rows(rows).await?.into();
            plain::check_length(&band, count)?;
            if self.has_levels() {
                let own = Arc::clone(&band);
                let joined = tokio::task::spawn_blocking(move || {
                    joiner.take(&own);
                    joiner
                });
                joiner = joined
                    .await
                    .map_err(|e| CubeError::library("a thread", "joining cells", e))?;
            }
            if sent == Sent::All {
                let found = upload(session, &self.values, row as u32, band).await?;
                objects[0].extend(found);
            }
            for (number, (level, waiting)) in self.levels.iter().zip(&mut waiting).enumerate() {
                waiting.add(joiner.done(number));
                let [values, coverage] = level.send(session, waiting).await?;
                objects[1 + 2 * number].extend(values);
                objects[2 + 2 * number].extend(coverage);
            }
        }
        let range = joiner.range();
        Ok(SentStep { objects, range })
    }
}

/// Rows of a level that wait until they fill a row of objects.
#[derive(Default)]
struct LevelBand {
    values: Vec<f32>,
    coverage: Vec<u8>,
    /// Rows of objects that were sent.
    sent: u32,
}

impl LevelBand {
    fn add(&mut self, rows: crate::joining::LevelRows) {
        self.values.extend(rows.values);
        self.coverage.extend(rows.coverage);
    }
}

impl LevelParts {
    /// Sends the rows of objects that are complete.
    async fn send(
        &self,
        session: &RwLock<Session>,
        waiting: &mut LevelBand,
    ) -> Result<[Objects; 2], CubeError> {
        let mut found = [vec![], vec![]];
        let bands: Vec<Range<u32>> = self.values.bands().collect();
        while let Some(rows) = bands.get(waiting.sent as usize) {
            let count = rows.len() * self.values.cols();
            if waiting.values.len() < count {
                break;
            }
            let values: Arc<[f32]> = waiting.values.drain(..count).collect();
            let coverage: Arc<[u8]> = waiting.coverage.drain(..count).collect();
            found[0].extend(upload(session, &self.values, waiting.sent, values).await?);
            found[1].extend(upload(session, &self.coverage, waiting.sent, coverage).await?);
            waiting.sent += 1;
        }
        Ok(found)
    }
}

/// Encodes a row of objects and sends them.
async fn upload<T: Number>(
    session: &RwLock<Session>,
    encoder: &Arc<Encoder<T>>,
    row: u32,
    band: Arc<[T]>,
) -> Result<Objects, CubeError> {
    let failed = |e: SessionError| CubeError::library(encoder.path(), "storing a chunk", e);
    let path = Path::new(encoder.path());
    let path = path.map_err(|e| CubeError::library(encoder.path(), "naming an array", e))?;
    let path = &path;
    let send = |object: Result<EncodedObject, CubeError>| async move {
        let EncodedObject { index, content } = object?;
        let Some(content) = content else {
            return Ok((index, None));
        };
        let [row, col] = index;
        // The place in time is not known yet; it is part of the request's label only.
        let here = ChunkIndices(vec![0, row, col]);
        let writer = session.read().await.get_chunk_writer(path, &here);
        let payload = writer.map_err(failed)?(content).await.map_err(failed)?;
        Ok((index, Some(payload)))
    };
    plain::encoded(encoder, row, band)
        .map(send)
        .buffer_unordered(OBJECTS_AT_ONCE)
        .try_collect()
        .await
}
