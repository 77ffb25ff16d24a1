//! Weights of a region on a grid: computed once, stored under the hash of what they depend on, reused ever after.

use contract::chunk::{CHUNK_ROWS, frame_chunks};
use contract::digest::Digest;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::region::Region;
use serde::Serialize;
use storage::{StorageError, Store};

use super::box_cover::{self, Bounds};
use super::polygon_cover::Band;
use super::rings::rings;
use crate::ComputeError;

/// Version of the way weights are computed: it changes when their bits do.
const METHOD: u32 = 1;

/// What weights depend on.
#[derive(Serialize)]
struct Job<'a> {
    method: u32,
    layout: u32,
    grid: &'a Grid,
    region: &'a Region,
    earth: Earth,
}

/// Areas of a region's share of every cell, m², by chunk number; only chunks with any area.
pub fn compute(
    grid: &Grid,
    region: &Region,
    earth: Earth,
) -> Result<Vec<(u32, Vec<f64>)>, ComputeError> {
    let mut chunks = vec![];
    let mut keep = |chunk: usize, areas: Vec<f64>| {
        if areas.iter().any(|&area| area > 0.0) {
            chunks.push((chunk as u32, areas));
        }
    };
    let bounds = match region {
        Region::Global => Bounds::global(grid),
        Region::Box {
            west,
            south,
            east,
            north,
        } => Bounds {
            west: *west,
            south: *south,
            east: *east,
            north: *north,
        },
        Region::Polygons(polygons) => {
            let rings = rings(polygons)?;
            let mut band = None;
            for (chunk, window) in frame_chunks(grid).into_iter().enumerate() {
                debug_assert_eq!(window.row % CHUNK_ROWS, 0, "chunks start at band rows");
                let current = match band.take() {
                    Some((row, current)) if row == window.row => current,
                    _ => Band::new(&rings, grid, window.row, earth)?,
                };
                keep(chunk, current.window(window));
                band = Some((window.row, current));
            }
            return Ok(chunks);
        }
    };
    for (chunk, window) in frame_chunks(grid).into_iter().enumerate() {
        keep(chunk, box_cover::areas_m2(bounds, grid, window, earth));
    }
    Ok(chunks)
}

/// Where weights are stored, whether they are there or not.
pub fn key(grid: &Grid, region: &Region, earth: Earth) -> ObjectKey {
    ObjectKey::weights(&Digest::of_json(&Job {
        method: METHOD,
        layout: storage::weights::LAYOUT,
        grid,
        region,
        earth,
    }))
}

/// The key of stored weights, which are computed if nobody did before or if they are damaged; none if the region lies
/// outside the grid.
pub async fn stored(
    store: &Store,
    grid: &Grid,
    region: &Region,
    earth: Earth,
) -> Result<Option<ObjectKey>, ComputeError> {
    let key = key(grid, region, earth);
    let is_damaged = match storage::weights::check(store, &key).await {
        Ok(()) => return Ok(Some(key)),
        Err(e) if e.is_not_found() => false,
        Err(error @ StorageError::Damaged { .. }) => {
            tracing::warn!(%error, "weights are computed again");
            true
        }
        Err(e) => return Err(e.into()),
    };
    let (grid, region) = (*grid, region.clone());
    let chunks = tokio::task::spawn_blocking(move || compute(&grid, &region, earth))
        .await
        .map_err(|e| ComputeError::inconsistent("weights", e))??;
    if chunks.is_empty() {
        return Ok(None);
    }
    if is_damaged {
        storage::weights::write_over(store, &key, &chunks).await?;
    } else {
        storage::weights::write(store, &key, &chunks).await?;
    }
    Ok(Some(key))
}

#[cfg(test)]
mod tests;
