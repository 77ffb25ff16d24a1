//! The part of a product that bands are made of: a box or polygons in; bands, what their coverage is a share of, and notes out.

use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{HovmollerBand, HovmollerQuery};
use contract::grid::{Grid, rounded_deg};
use contract::manifest::Manifest;
use contract::region::Region;

use super::band_shares::BandShares;
use super::bands::{BandAreas, Bands};
use crate::budget::over_region::{AskedArea, beside_grid, extent_of, weights};
use crate::region::loaded::weights_failed;
use crate::{ComputeError, Engine};

/// Bands over a box or polygons.
pub(super) struct Banded {
    pub(super) bands: Arc<Bands>,
    /// West, south, east, north, degrees: of the box, or of the cells that the polygons touch.
    pub(super) bounds_deg: [f64; 4],
    /// What the polygons are called; none of a box.
    pub(super) region: Option<String>,
    /// How the region was taken.
    notes: Vec<String>,
    /// Area of the polygons, wherever the grid lies, and on the grid, m².
    areas_m2: [f64; 2],
}

impl Banded {
    /// Bands of the cells whose middles lie in a box: west, south, east, north.
    ///
    /// # Errors
    /// No cell is one.
    pub(super) fn of_box(
        manifest: &Manifest,
        query: &HovmollerQuery,
        band_deg: f64,
        bounds_deg: [f64; 4],
    ) -> Result<Self, ContractError> {
        let grid = &manifest.grid;
        let bands = Bands::of(grid, query.along, band_deg, bounds_deg, query.earth);
        if bands.edges_deg().is_empty() {
            let product = &manifest.product;
            let [dlat, dlon] = [grid.dlat_deg, grid.dlon_deg].map(rounded_deg);
            let reason = if is_between_middles(grid, bounds_deg) {
                format!(
                    "no cell of {product} has its middle in it: it is narrower than these cells, of {dlon} by {dlat} degrees; ask for a box \
                     that is no smaller, or for the same place as a polygon, of which cells count by their share"
                )
            } else {
                let covered = manifest.bounds_text();
                format!("no cell of {product} has its middle in it; it covers {covered}")
            };
            let text = bounds_deg.map(|edge| edge.to_string()).join(",");
            return Err(ContractError::invalid("region", &text, reason));
        }
        Ok(Self {
            bands: Arc::new(bands),
            bounds_deg,
            region: None,
            notes: vec![],
            areas_m2: [0.0; 2],
        })
    }

    /// Bands of polygons' exact share of every cell.
    ///
    /// # Errors
    /// `RegionOutside` if they have nothing in common with the grid, and what their weights meet.
    pub(super) async fn of_region(
        engine: &Engine,
        manifest: &Manifest,
        query: &HovmollerQuery,
        (band_deg, region): (f64, &Region),
    ) -> Result<Self, ComputeError> {
        let asked = AskedArea {
            region,
            earth: query.earth,
            ocean: None,
        };
        let extent = extent_of(engine, asked).await?;
        let address = weights(engine, manifest, asked).await?;
        let objects = engine.objects();
        let (whole, sea) = futures::try_join!(
            objects.weights(&address.all),
            objects.weights(&address.ocean)
        )
        .map_err(weights_failed)?;
        let grid = &manifest.grid;
        let on_grid_m2: f64 = whole.cells().sum();
        let shares = BandShares::new((grid, query.earth), whole, sea);
        let touched = shares
            .touched()
            .ok_or_else(|| ComputeError::RegionOutside {
                product: manifest.product.clone(),
                bounds: manifest.bounds_text(),
            })?;
        let bounds_deg = touched.bounds_deg;
        let bands = Bands::of_region(grid, query.along, band_deg, (shares, touched));
        Ok(Self {
            bands: Arc::new(bands),
            bounds_deg,
            region: query.region.as_ref().map(|asked| asked.name.clone()),
            notes: extent.notes,
            areas_m2: [extent.area_m2, on_grid_m2],
        })
    }

    /// What coverage is a share of, in words.
    pub(super) fn coverage_basis(&self) -> &'static str {
        if self.region.is_some() {
            "area of the region's sea in the band on the grid, and time of the row"
        } else {
            "area of the band's cells that hold data in some step, and time of the row"
        }
    }

    /// The same of a band, m²; of its areas some cells are those that hold data in some step.
    pub(super) fn covered_m2(&self, areas: &BandAreas) -> f64 {
        if self.region.is_some() {
            areas.covered_m2
        } else {
            areas.some_m2
        }
    }

    /// A band as answers have it.
    pub(super) fn band(&self, (low_deg, high_deg): (f64, f64), areas: &BandAreas) -> HovmollerBand {
        let of_region = |area_m2: f64| self.region.as_ref().map(|_name| area_m2);
        HovmollerBand {
            low_deg,
            high_deg,
            area_m2: areas.some_m2,
            region_area_m2: of_region(areas.all_m2),
            ocean_area_m2: of_region(areas.covered_m2),
        }
    }

    /// What may surprise, and what else is to be said; `areas` are those of all bands.
    pub(super) fn notes(&self, areas: &[BandAreas], more: Option<String>) -> Vec<String> {
        let mut notes = self.notes.clone();
        if self.region.is_some() {
            let [area_m2, on_grid_m2] = self.areas_m2;
            let beside = beside_grid(area_m2, on_grid_m2);
            notes.extend(
                beside.map(|beside| format!("{beside}: coverage is a share of the sea in these")),
            );
            let untouched = areas.iter().filter(|own| own.all_m2 <= 0.0).count();
            if untouched > 0 {
                notes.push(format!(
                    "{untouched} of {} bands hold nothing of the region: they are empty",
                    areas.len()
                ));
            }
        }
        notes.extend(more);
        notes
    }
}

/// Does a box lie on a grid and have room for less than a cell, one way or the other?
fn is_between_middles(grid: &Grid, [west, south, east, north]: [f64; 4]) -> bool {
    let width_deg = f64::from(grid.cols) * grid.dlon_deg;
    let is_beside = south >= grid.north_deg
        || north <= grid.south_deg()
        || ((west - grid.west_deg).rem_euclid(360.0) >= width_deg
            && (grid.west_deg - west).rem_euclid(360.0) >= east - west);
    !is_beside && (north - south < grid.dlat_deg || east - west < grid.dlon_deg)
}
