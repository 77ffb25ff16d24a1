//! Fields that a step is made of, read from the north to the south: of several the same rows at a time, or of one those rows that
//! are still needed.

use std::collections::VecDeque;
use std::ops::Range;

use contract::grid::Grid;
use contract::key::ObjectKey;
use storage::fields::{self, Bands};

use crate::ComputeError;
use crate::workshop::Workshop;

/// Bands of all inputs of a step, side by side.
pub(super) struct Inputs {
    /// One a field: the same field under two names is read once.
    bands: Vec<Bands>,
    /// Of each input, which of these it is.
    pub(super) of: Vec<usize>,
}

impl Inputs {
    /// All inputs together hold a band's cells, or a row of chunks each.
    pub(super) async fn open(
        workshop: Workshop<'_>,
        grid: &Grid,
        keys: &[ObjectKey],
    ) -> Result<Self, ComputeError> {
        let mut distinct: Vec<&ObjectKey> = vec![];
        let mut of = vec![];
        for key in keys {
            let there = distinct.iter().position(|own| *own == key);
            of.push(there.unwrap_or(distinct.len()));
            if there.is_none() {
                distinct.push(key);
            }
        }
        let most_cells = if grid.cell_count() as u64 <= workshop.band_cells {
            workshop.band_cells
        } else {
            workshop.band_cells / distinct.len().max(1) as u64
        };
        let mut bands = vec![];
        for key in distinct {
            bands.push(fields::bands(workshop.store, key, grid, most_cells).await?);
        }
        Ok(Self { bands, of })
    }

    /// The next rows of each field; none after the last, when all are what their names say.
    pub(super) async fn next(&mut self) -> Result<Option<Vec<Vec<f32>>>, ComputeError> {
        let mut read = vec![];
        for bands in &mut self.bands {
            read.extend(bands.next().await?.map(|(_rows, values)| values));
        }
        // All are of one grid, and end together.
        Ok((!read.is_empty()).then_some(read))
    }
}

/// Rows of one field, of which bands are held as long as they are needed.
pub(super) struct SlidingRows {
    bands: Bands,
    held: VecDeque<(Range<u32>, Vec<f32>)>,
}

impl SlidingRows {
    pub(super) async fn open(
        workshop: Workshop<'_>,
        grid: &Grid,
        key: &ObjectKey,
    ) -> Result<Self, ComputeError> {
        Ok(Self {
            bands: fields::bands(workshop.store, key, grid, workshop.band_cells).await?,
            held: VecDeque::new(),
        })
    }

    /// The band that a row is in; those that end before it and before `kept_from` are let go.
    pub(super) async fn holding(
        &mut self,
        row: u32,
        kept_from: u32,
    ) -> Result<(Range<u32>, &[f32]), ComputeError> {
        let needed = row.min(kept_from);
        let is_done = |held: &VecDeque<(Range<u32>, Vec<f32>)>| {
            held.front().is_some_and(|(rows, _)| rows.end <= needed)
        };
        while is_done(&self.held) {
            self.held.pop_front();
        }
        while self.held.back().is_none_or(|(rows, _)| rows.end <= row) {
            let Some(band) = self.bands.next().await? else {
                let reason = format!("a field has no row {row}");
                return Err(ComputeError::inconsistent("regridding", reason));
            };
            if band.0.end > needed {
                self.held.push_back(band);
            }
        }
        let found = self.held.iter().find(|(rows, _)| rows.contains(&row));
        let (rows, values) = found.ok_or_else(|| {
            ComputeError::inconsistent("regridding", format!("row {row} was let go"))
        })?;
        Ok((rows.clone(), values))
    }

    /// Reads what nobody needs: only all of a field is what its name says.
    pub(super) async fn read_to_the_end(mut self) -> Result<(), ComputeError> {
        self.held.clear();
        while self.bands.next().await?.is_some() {}
        Ok(())
    }
}
