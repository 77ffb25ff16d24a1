//! A geometry on a product's grid: where its weights are, how large it is, and what coverage is a share of.

use std::sync::Arc;

use contract::ContractError;
use contract::geometry::Geometry;
use contract::manifest::Manifest;
use contract::region::{Cells as CountedCells, Region};
use contract::statistics::StatisticsQuery;
use cube::weight_unit::WeightUnit;

use super::cells::{Cells, Shape, unit_of_areas, unit_of_largest};
use crate::budget::over_region::{AskedArea, extent_of, weights, with_shares};

use crate::region::computed::ComputedWeights;
use crate::region::line_cover::length_m;
use crate::region::loaded::{RegionWeights, weights_failed};
use crate::region::shares;
use crate::region::weights::Surface;
use crate::{ComputeError, Engine};

/// Share of a line that a grid must lack before a reader is told.
const OUTSIDE_SHARE: f64 = 1e-6;

/// A geometry, its weights at hand.
pub(super) struct Weighed {
    pub(super) shape: Shape,
    /// Address of what is summed, and of what coverage counts.
    pub(super) addresses: [Arc<str>; 2],
    pub(super) whole: Arc<RegionWeights>,
    covered: Arc<RegionWeights>,
    pub(super) unit: WeightUnit,
    /// How large it is wherever the grid lies: m², m or 1.
    pub(super) size: f64,
    pub(super) size_unit: &'static str,
    /// How much of it coverage is a share of.
    pub(super) covered_size: f64,
    pub(super) coverage_basis: &'static str,
    pub(super) ocean_source: Option<String>,
    pub(super) notes: Vec<String>,
}

impl Weighed {
    pub(super) async fn of(
        engine: &Engine,
        manifest: &Manifest,
        query: &StatisticsQuery,
    ) -> Result<Self, ComputeError> {
        match &query.geometry {
            Geometry::Region(region) => {
                Box::pin(Self::region(engine, manifest, query, region)).await
            }
            Geometry::Line(line) => {
                let size = length_m(line, query.earth);
                Self::plain(engine, manifest, query, size).await
            }
            Geometry::Point { place, .. } => {
                manifest.cell_inside(*place)?;
                Self::plain(engine, manifest, query, 1.0).await
            }
        }
    }

    /// Its weights on the grid.
    pub(super) fn cells(&self) -> Cells<'_> {
        Cells {
            shape: self.shape,
            whole: &self.whole,
            covered: &self.covered,
            unit: self.unit,
        }
    }

    async fn region(
        engine: &Engine,
        manifest: &Manifest,
        query: &StatisticsQuery,
        region: &Region,
    ) -> Result<Self, ComputeError> {
        let asked = AskedArea {
            region,
            earth: query.earth,
            ocean: query.ocean.as_deref(),
        };
        // Each takes some ten milliseconds of a region that nobody asked for before.
        let weighing = async {
            let address = weights(engine, manifest, asked).await?;
            let (whole, sea) =
                futures::try_join!(loaded(engine, &address.all), loaded(engine, &address.ocean))?;
            Ok::<_, ComputeError>((address, whole, sea))
        };
        let (extent, weighed) = futures::join!(extent_of(engine, asked), weighing);
        let mut extent = extent?;
        let (address, whole, sea) = weighed?;
        let unit = unit_of_areas(&manifest.grid, query.earth, &whole);
        if query.ocean.is_some() {
            extent = with_shares(extent, total(&whole), total(&sea));
        }
        let summed = match query.cells {
            CountedCells::Whole => (address.all, whole),
            CountedCells::OceanShare => (address.ocean.clone(), Arc::clone(&sea)),
        };
        Ok(Self {
            shape: [manifest.grid.rows, manifest.grid.cols],
            addresses: [summed.0, address.ocean],
            whole: summed.1,
            covered: sea,
            unit,
            size: extent.area_m2,
            size_unit: "m²",
            covered_size: extent.ocean_m2,
            coverage_basis: "area of the region's sea, and time of the row",
            ocean_source: Some(shares::source(query.ocean.as_deref())),
            notes: extent.notes,
        })
    }

    /// A line or a place: of which all counts.
    async fn plain(
        engine: &Engine,
        manifest: &Manifest,
        query: &StatisticsQuery,
        size: f64,
    ) -> Result<Self, ComputeError> {
        let question = ComputedWeights {
            grid: manifest.grid,
            geometry: query.geometry.clone(),
            earth: query.earth,
            surface: Surface::All,
            shares_at: None,
        };
        let address: Arc<str> = question.text().into();
        let whole = loaded(engine, &address).await?;
        let is_line = matches!(query.geometry, Geometry::Line(_));
        let on_grid = total(&whole);
        if on_grid <= 0.0 {
            let reason = format!(
                "it lies outside the grid of {}, which covers {}",
                manifest.product,
                manifest.bounds_text()
            );
            return Err(ContractError::invalid("line", &query.geometry_name, reason).into());
        }
        let mut notes = vec![];
        if is_line && on_grid < size * (1.0 - OUTSIDE_SHARE) {
            notes.push(format!(
                "of the line's {:.3} km {:.3} lie on the grid",
                size / 1e3,
                on_grid / 1e3
            ));
        }
        Ok(Self {
            shape: [manifest.grid.rows, manifest.grid.cols],
            addresses: [address.clone(), address],
            unit: unit_of_largest(&whole),
            covered: Arc::clone(&whole),
            whole,
            size,
            size_unit: if is_line { "m" } else { "1" },
            covered_size: size,
            coverage_basis: if is_line {
                "length of the line, and time of the row"
            } else {
                "weight of the cells of the place, and time of the row"
            },
            ocean_source: None,
            notes,
        })
    }
}

fn total(weights: &RegionWeights) -> f64 {
    weights.cells().sum()
}

async fn loaded(engine: &Engine, address: &str) -> Result<Arc<RegionWeights>, ComputeError> {
    let found = engine.objects().weights(address).await;
    found.map_err(weights_failed)
}
