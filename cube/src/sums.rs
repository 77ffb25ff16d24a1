//! Sums of blocks of cells that are stored beside the time-major copy: of which runs of steps they are there, and what values
//! and cells count in them.
//!
//! A run's sums have the name of its steps, as the run has: whoever reads takes them only where the run of that name is
//! read. Cells weigh what a whole one weighs in questions of areas on WGS84, a number a row that is stored with them: who asks
//! compares the weights of cells with these, so that sums are used where every cell counts as it does here and nowhere else.

use std::sync::Arc;

use contract::earth::Earth;
use icechunk::format::Path;
use icechunk::session::{Session, SessionErrorKind};
use serde_json::{Map, Value, json};
use tokio::sync::RwLock;
use zarrs::group::Group;
use zarrs::storage::{AsyncReadableStorageTraits, AsyncWritableStorageTraits};

use crate::arrays::{self, SUMS};
use crate::error::first_lines;
use crate::layout::BLOCK_CELLS;
use crate::scale::Scale;
use crate::series::Runs;
use crate::weight_unit::row_weights;
use crate::{CubeError, Description, Layout, axis};

/// Version of what records hold: sums of another are not read, and made anew.
const LAYOUT: u32 = 1;
/// Attribute of the group that holds what this program reads.
const ATTRIBUTE: &str = "fluxglobe_sums";
/// The figure of the earth that cells are weighed on.
const EARTH: Earth = Earth::Wgs84;

/// How values and cells count in stored sums.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    /// What a value counts.
    pub scale: Scale,
    /// What a cell of each row of the grid weighs, in steps.
    pub row_weights: Vec<i64>,
    /// Columns of blocks in a shard: sums begin anew in each.
    pub shard_cols: u32,
}

impl Basis {
    /// That of what is summed now; none of a quantity whose range is not known.
    fn of(description: &Description) -> Option<Self> {
        Some(Self {
            scale: Scale::of(description.quantity)?,
            row_weights: row_weights(&description.grid, EARTH),
            shard_cols: shard_cols(description),
        })
    }

    fn attributes(&self) -> Map<String, Value> {
        let mut attributes = Map::new();
        let written = json!({ "layout": LAYOUT, "scale": self.scale });
        attributes.insert(ATTRIBUTE.to_owned(), written);
        let comment = "sums over blocks of 8 x 8 cells in runs of 128 steps, for questions of regions; docs/decisions/029-stored-sums.md of Fluxglobe says how they are written";
        attributes.insert("comment".to_owned(), comment.into());
        attributes
    }
}

fn shard_cols(description: &Description) -> u32 {
    Layout::of(&description.grid).series_object()[1] / BLOCK_CELLS
}

/// What a state of a cube has of sums.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sums {
    /// How values count in those that are there; none where there are none, or those of another layout.
    pub(crate) basis: Option<Arc<Basis>>,
    /// Of which steps those of each run were made.
    pub(crate) runs: Runs,
    /// Is the group there, whatever it holds?
    is_there: bool,
}

impl Sums {
    /// Reads which there are.
    pub(crate) async fn read<S>(
        session: &Session,
        arrays: &Arc<S>,
        description: &Description,
        place: &str,
    ) -> Result<Self, CubeError>
    where
        S: AsyncReadableStorageTraits + 'static,
    {
        match session.get_node(&path(place)?).await {
            Ok(_group) => {}
            Err(e) if matches!(e.kind, SessionErrorKind::NodeNotFound { .. }) => {
                return Ok(Self::default());
            }
            Err(e) => return Err(CubeError::library(place, "looking for sums", e)),
        }
        let there = Self {
            is_there: true,
            ..Self::default()
        };
        let group = Group::async_open(Arc::clone(arrays), &format!("/{SUMS}")).await;
        let group = group.map_err(|e| CubeError::foreign(place, SUMS.to_owned(), e))?;
        let written = group.attributes().get(ATTRIBUTE);
        let scale = written.filter(|own| own["layout"] == LAYOUT);
        let scale = scale.and_then(|own| serde_json::from_value(own["scale"].clone()).ok());
        let Some(scale) = scale.filter(|own| Scale::of(description.quantity) == Some(*own)) else {
            return Ok(there);
        };
        let array = axis::open(arrays, &arrays::row_weights(&description.grid)?, place).await?;
        let weights = array.async_retrieve_chunk_if_exists::<Vec<i64>>(&[0]).await;
        let damaged = |reason: String| CubeError::chunk(arrays::name(&array), vec![0], reason);
        let row_weights = weights.map_err(|e| damaged(first_lines(&e)))?;
        let row_weights = row_weights.ok_or_else(|| damaged("it is not there".to_owned()))?;
        Ok(Self {
            basis: Some(Arc::new(Basis {
                scale,
                row_weights,
                shard_cols: shard_cols(description),
            })),
            runs: Runs::read(session, arrays, SUMS, place).await?,
            ..there
        })
    }

    /// How values count in those that are made next: as in those that are there.
    pub(crate) fn next_basis(&self, description: &Description) -> Option<Arc<Basis>> {
        let own = self.basis.clone();
        own.or_else(|| Basis::of(description).map(Arc::new))
    }

    /// Puts those of a run beside the others, which are forgotten if they are of another layout.
    pub(crate) async fn write<S>(
        &self,
        session: &RwLock<Session>,
        store: &Arc<S>,
        description: &Description,
        (basis, runs): (&Basis, &Runs),
    ) -> Result<(), CubeError>
    where
        S: AsyncWritableStorageTraits + 'static,
    {
        let failed = |e: String| CubeError::library(SUMS, "writing", e);
        if self.is_there && self.basis.is_none() {
            let mut session = session.write().await;
            let gone = session.delete_group(path(SUMS)?).await;
            gone.map_err(|e| failed(e.to_string()))?;
        }
        let array = arrays::sums(description, runs.len())?;
        runs.write(store, (SUMS, basis.attributes()), array).await?;
        if self.basis.is_none() {
            let array = arrays::row_weights(&description.grid)?;
            let array = array.with_storage(Arc::clone(store));
            let stored = array.async_store_metadata().await;
            stored.map_err(|e| failed(e.to_string()))?;
            let stored = array.async_store_chunk(&[0], basis.row_weights.clone());
            stored.await.map_err(|e| failed(e.to_string()))?;
        }
        Ok(())
    }
}

fn path(place: &str) -> Result<Path, CubeError> {
    let path = Path::new(&format!("/{SUMS}"));
    path.map_err(|e| CubeError::library(place, "naming sums", e))
}
