//! Weights of a region on a grid: computed once, stored under the hash of what they depend on, reused ever after.

use contract::chunk::{CHUNK_ROWS, field_chunks};
use contract::digest::Digest;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::region::Region;
use serde::{Deserialize, Serialize};
use storage::weights::SharedAreas;
use storage::{StorageError, Store, fields};

use super::box_cover::{self, Bounds};
use super::found::Found;
use super::polygon_cover::Band;
use super::ring::Ring;
use super::rings::rings_while;
use super::sea::sea;
use super::shares::{Shares, Weighing};
use crate::ComputeError;
use crate::awaited::Awaited;
use crate::workshop::Workshop;

/// Version of the way weights of boxes are computed: it changes when their bits do.
const BOX_METHOD: u32 = 1;
/// The same of polygons and of the sea. 2: edges are as wide as they are written, what overlaps counts once.
const POLYGON_METHOD: u32 = 2;
/// The same of polygons with corners along straight edges, which changed their sea.
const STRAIGHTENED_METHOD: u32 = 3;
/// Distance from the line between its neighbours up to which a corner may have been one of these once it is rounded, degrees.
const STRAIGHT_DEG: f64 = 2e-6;
/// The figure of the earth that weights and sums of named regions are stored for.
pub const EARTH: Earth = Earth::Wgs84;

/// What of a region is weighed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Surface {
    /// All of it.
    All,
    /// The sea in it: what is no land of Natural Earth.
    Ocean,
    /// The sea in it by the shares of cells that a product says.
    Shares(Shares),
}

impl Surface {
    /// The shares it takes from a product.
    pub(crate) fn shares(&self) -> Option<&Shares> {
        match self {
            Self::Shares(shares) => Some(shares),
            Self::All | Self::Ocean => None,
        }
    }
}

/// A region on a grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OnGrid<'a> {
    pub(crate) grid: &'a Grid,
    pub(crate) region: &'a Region,
    pub(crate) earth: Earth,
    /// How its sea is told.
    pub(crate) ocean: &'a Surface,
}

/// Where the weights of a region on a grid are, whether they are there or not.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionKeys {
    /// Of all of it.
    pub all: ObjectKey,
    /// Of the sea in it.
    pub ocean: ObjectKey,
}

impl RegionKeys {
    /// Those of a region on a grid.
    pub fn new(grid: &Grid, region: &Region, earth: Earth) -> Self {
        Self::of(OnGrid {
            grid,
            region,
            earth,
            ocean: &Surface::Ocean,
        })
    }

    pub(crate) fn of(asked: OnGrid<'_>) -> Self {
        let key = |surface| key_of(asked.grid, asked.region, asked.earth, surface);
        Self {
            all: key(&Surface::All),
            ocean: key(asked.ocean),
        }
    }

    /// The same, once both are stored; none if the region lies outside the grid. The sea's may hold no chunk.
    pub async fn stored(
        store: &Store,
        grid: &Grid,
        region: &Region,
        earth: Earth,
    ) -> Result<Option<Self>, ComputeError> {
        let ocean = &Surface::Ocean;
        let asked = OnGrid {
            grid,
            region,
            earth,
            ocean,
        };
        Self::stored_of(store, asked).await
    }

    pub(crate) async fn stored_of(
        store: &Store,
        asked: OnGrid<'_>,
    ) -> Result<Option<Self>, ComputeError> {
        let (grid, region, earth) = (asked.grid, asked.region, asked.earth);
        if stored(store, grid, region, earth).await?.is_none() {
            return Ok(None);
        }
        let ocean = stored_of(store, grid, region, earth, asked.ocean).await?;
        Ok(ocean.map(|_there| Self::of(asked)))
    }
}

/// What weights depend on.
#[derive(Serialize)]
struct Job<'a> {
    method: u32,
    layout: u32,
    grid: &'a Grid,
    region: &'a Region,
    earth: Earth,
    #[serde(skip_serializing_if = "Option::is_none")]
    surface: Option<&'a Surface>,
}

/// Areas of a region's share of every cell, m², by chunk number; only chunks with any area.
pub fn compute(
    grid: &Grid,
    region: &Region,
    earth: Earth,
) -> Result<Vec<(u32, Vec<f64>)>, ComputeError> {
    compute_of(grid, region, earth, &Surface::All, None)
}

/// The same of a surface; `shares` is the field `[row, col]` that it takes its shares from, where it does.
pub fn compute_of(
    grid: &Grid,
    region: &Region,
    earth: Earth,
    surface: &Surface,
    shares: Option<&[f32]>,
) -> Result<Vec<(u32, Vec<f64>)>, ComputeError> {
    let shared = shared_of(grid, region, earth, surface, shares, &Awaited::always())?;
    Ok(shared
        .into_iter()
        .map(|(chunk, areas_m2)| (chunk, areas_m2.to_vec()))
        .collect())
}

/// The same with equal chunks held once: of a box and of the open sea one a row of chunks.
///
/// # Errors
/// `Region` if they take more than may be held; `NotAwaited`.
pub(crate) fn shared_of(
    grid: &Grid,
    region: &Region,
    earth: Earth,
    surface: &Surface,
    shares: Option<&[f32]>,
    awaited: &Awaited,
) -> Result<Vec<(u32, SharedAreas)>, ComputeError> {
    if let Surface::Shares(own) = surface {
        let values = shares.filter(|values| values.len() == grid.cell_count());
        let values = values.ok_or_else(|| {
            ComputeError::inconsistent(own.field.as_str(), "it was not read, or is of another grid")
        })?;
        let all = shared_of(grid, region, earth, &Surface::All, None, awaited)?;
        return own.weigh(grid, &all, values);
    }
    let bounds = match region {
        _ if *surface == Surface::Ocean => {
            let rings = rings_while(region, awaited)?;
            awaited.check()?;
            return ring_chunks(grid, &sea(&rings)?, earth, awaited);
        }
        Region::Polygons(_) => {
            let rings = rings_while(region, awaited)?;
            return ring_chunks(grid, &rings, earth, awaited);
        }
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
    };
    let mut found = Found::default();
    for (chunk, window) in field_chunks(grid).into_iter().enumerate() {
        awaited.check()?;
        let areas_m2 = box_cover::areas_m2(bounds, grid, window, earth);
        found.add(chunk as u32, &areas_m2)?;
    }
    Ok(found.chunks)
}

/// Has a region any area on a grid?
pub(crate) fn covers(grid: &Grid, region: &Region, earth: Earth) -> Result<bool, ComputeError> {
    let awaited = &Awaited::always();
    let shared = shared_of(grid, region, earth, &Surface::All, None, awaited)?;
    Ok(!shared.is_empty())
}

/// Areas inside of rings.
fn ring_chunks(
    grid: &Grid,
    rings: &[Ring],
    earth: Earth,
    awaited: &Awaited,
) -> Result<Vec<(u32, SharedAreas)>, ComputeError> {
    let mut found = Found::default();
    let mut band = None;
    for (chunk, window) in field_chunks(grid).into_iter().enumerate() {
        debug_assert_eq!(window.row % CHUNK_ROWS, 0, "chunks start at band rows");
        let current = match band.take() {
            Some((row, current)) if row == window.row => current,
            _ => Band::new(rings, grid, window.row, earth, awaited)?,
        };
        found.add(chunk as u32, &current.window(window))?;
        band = Some((window.row, current));
    }
    Ok(found.chunks)
}

/// Where weights are stored, whether they are there or not.
pub fn key(grid: &Grid, region: &Region, earth: Earth) -> ObjectKey {
    key_of(grid, region, earth, &Surface::All)
}

/// The same of a surface.
pub fn key_of(grid: &Grid, region: &Region, earth: Earth, surface: &Surface) -> ObjectKey {
    let is_polygonal = *surface == Surface::Ocean || matches!(region, Region::Polygons(_));
    ObjectKey::weights(&Digest::of_json(&Job {
        method: if is_polygonal {
            polygon_method(region)
        } else {
            BOX_METHOD
        },
        layout: storage::weights::LAYOUT,
        grid,
        region,
        earth,
        // Left out for whole regions, whose keys are older than this.
        surface: (*surface != Surface::All).then_some(surface),
    }))
}

fn polygon_method(region: &Region) -> u32 {
    let is_straight = |[from, by, to]: [[f64; 2]; 3]| {
        let [a, b] = [
            [by[0] - from[0], by[1] - from[1]],
            [to[0] - from[0], to[1] - from[1]],
        ];
        (a[0] * b[1] - a[1] * b[0]).abs() <= STRAIGHT_DEG * b[0].hypot(b[1])
    };
    let has_straight = |ring: &Vec<[f64; 2]>| {
        let mut ring = ring.clone();
        ring.dedup();
        // The first corner may be repeated at the end.
        if ring.len() > 1 && ring.first() == ring.last() {
            ring.pop();
        }
        let next = |step: usize| ring.iter().cycle().skip(step);
        let mut corners = ring.iter().zip(next(1)).zip(next(2));
        corners.any(|((from, by), to)| is_straight([*from, *by, *to]))
    };
    let Region::Polygons(polygons) = region else {
        return POLYGON_METHOD;
    };
    let mut rings = polygons
        .iter()
        .flat_map(|polygon| std::iter::once(&polygon.outer).chain(&polygon.holes));
    if rings.any(has_straight) {
        STRAIGHTENED_METHOD
    } else {
        POLYGON_METHOD
    }
}

/// The key of stored weights, which are computed if nobody did before or if they are damaged; none if the region lies
/// outside the grid.
pub async fn stored(
    store: &Store,
    grid: &Grid,
    region: &Region,
    earth: Earth,
) -> Result<Option<ObjectKey>, ComputeError> {
    stored_of(store, grid, region, earth, &Surface::All).await
}

/// The same of a surface. Of the sea they are stored also where the region on the grid is all land, and hold no chunk.
pub async fn stored_of(
    store: &Store,
    grid: &Grid,
    region: &Region,
    earth: Earth,
    surface: &Surface,
) -> Result<Option<ObjectKey>, ComputeError> {
    let key = key_of(grid, region, earth, surface);
    let is_damaged = match storage::weights::check(store, &key).await {
        Ok(()) => return Ok(Some(key)),
        Err(e) if e.is_not_found() => false,
        Err(error @ StorageError::Damaged { .. }) => {
            tracing::warn!(%error, "weights are computed again");
            true
        }
        Err(e) => return Err(e.into()),
    };
    let workshop = Workshop::of(store);
    let chunks = Box::pin(weighed(workshop, grid, region, earth, surface)).await?;
    if chunks.is_empty() && *surface == Surface::All {
        return Ok(None);
    }
    if is_damaged {
        storage::weights::write_over(store, &key, &chunks).await?;
    } else {
        storage::weights::write(store, &key, &chunks).await?;
    }
    Ok(Some(key))
}

/// Areas of a surface; shares that a product says are read band by band.
async fn weighed(
    workshop: Workshop<'_>,
    grid: &Grid,
    region: &Region,
    earth: Earth,
    surface: &Surface,
) -> Result<Vec<(u32, SharedAreas)>, ComputeError> {
    let covered = match surface {
        Surface::Shares(_) => Surface::All,
        own => own.clone(),
    };
    let (own, region) = (*grid, region.clone());
    // It is stored, for whoever asks next too.
    let awaited = Awaited::always();
    let cover = move || shared_of(&own, &region, earth, &covered, None, &awaited);
    let chunks = tokio::task::spawn_blocking(cover)
        .await
        .map_err(|e| ComputeError::inconsistent("weights", e))??;
    let Surface::Shares(shares) = surface else {
        return Ok(chunks);
    };
    let mut weighing = Weighing::new(shares, grid, &chunks);
    let (store, band_cells) = (workshop.store, workshop.band_cells);
    let mut bands = fields::bands(store, &shares.field, grid, band_cells).await?;
    while let Some((rows, values)) = bands.next().await? {
        weighing.band(rows, &values)?;
    }
    weighing.finish()
}

#[cfg(test)]
mod tests;
