//! Weights as a question of their own: a geometry on a grid as text in a query, computed by whoever reads it and stored by
//! nobody.

use contract::digest::Digest;
use contract::earth::Earth;
use contract::geometry::{Geometry, Line, Sampling};
use contract::grid::{Grid, LonLatDeg};
use contract::region::{Polygon, Region};
use serde::{Deserialize, Serialize};
use storage::weights::SharedAreas;

use super::cut::bounds_deg;
use super::line_cover::lengths_m;
use super::place_cover;
use super::shares::Shares;
use super::weights::{Surface, shared_of};
use crate::ComputeError;
use crate::awaited::Awaited;

/// What such a text begins with; addresses of stored weights do not.
const MARK: &str = "computed:";
/// Most cells that a region's bounds may hold: their areas take 64 MiB, and a process keeps them for a while.
const MAX_CELLS: u64 = 8 << 20;

/// What weights are computed from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ComputedWeights {
    pub(crate) grid: Grid,
    pub(crate) geometry: Geometry,
    pub(crate) earth: Earth,
    pub(crate) surface: Surface,
    /// Address of the field that the surface takes its shares from.
    pub(crate) shares_at: Option<String>,
}

impl ComputedWeights {
    /// As it stands in a query.
    pub(crate) fn text(&self) -> String {
        let json = serde_json::to_string(&Written::of(self)).expect("it is plain numbers");
        format!("{MARK}{json}")
    }

    /// The question of a text; none if it is an address.
    ///
    /// # Errors
    /// `Inconsistent` if it is neither.
    pub(crate) fn of_text(text: &str) -> Result<Option<Self>, ComputeError> {
        let Some(json) = text.strip_prefix(MARK) else {
            return Ok(None);
        };
        serde_json::from_str::<Written>(json)
            .map_err(|e| ComputeError::inconsistent("weights to compute", e))?
            .read()
            .map(Some)
    }

    /// What the answer to a text is remembered by; none if it is an address.
    pub(crate) fn name(text: &str) -> Option<String> {
        let is_question = text.starts_with(MARK);
        is_question.then(|| format!("{MARK}{}", Digest::of(text.as_bytes())))
    }

    /// # Errors
    /// `Region` if its weights could take more memory than a question that stores nothing may.
    pub(crate) fn check_size(&self) -> Result<(), ComputeError> {
        let Geometry::Region(region) = &self.geometry else {
            return Ok(());
        };
        let cells = cells_in_bounds(&self.grid, region);
        if cells <= MAX_CELLS {
            return Ok(());
        }
        let reason = format!(
            "it spans {cells} cells; at most {MAX_CELLS} are weighed for a question over the network: ask for a named or a \
             smaller region, or with `fluxglobe budget`, which stores the weights"
        );
        Err(ComputeError::Region { reason })
    }

    /// The shares of sea that areas of a region are weighed by; none if this is no region of such.
    pub(crate) fn weighed_by(&self) -> Option<&Shares> {
        match &self.geometry {
            Geometry::Region(_) => self.surface.shares(),
            Geometry::Line(_) | Geometry::Point { .. } => None,
        }
    }

    /// The same with shares that are read band by band, which areas of all of a region are to be weighed by: without them.
    pub(crate) fn to_weigh(
        &self,
        awaited: &Awaited,
    ) -> Result<Vec<(u32, SharedAreas)>, ComputeError> {
        match (&self.geometry, self.weighed_by()) {
            (Geometry::Region(region), Some(_shares)) => {
                self.check_size()?;
                shared_of(&self.grid, region, self.earth, &Surface::All, None, awaited)
            }
            _ => self.chunks(None, awaited),
        }
    }

    /// Areas of a region's share of every cell, m², lengths of a line's, m, or shares of a place, by chunk; `shares` is `[row, col]`, where the surface needs them.
    pub(crate) fn chunks(
        &self,
        shares: Option<&[f32]>,
        awaited: &Awaited,
    ) -> Result<Vec<(u32, SharedAreas)>, ComputeError> {
        self.check_size()?;
        match &self.geometry {
            Geometry::Region(region) => {
                let (grid, surface) = (&self.grid, &self.surface);
                shared_of(grid, region, self.earth, surface, shares, awaited)
            }
            Geometry::Line(line) => lengths_m(&self.grid, line, self.earth).map(shared),
            Geometry::Point { place, sampling } => {
                let shares = place_cover::shares(&self.grid, *place, *sampling);
                Ok(shared(shares))
            }
        }
    }
}

fn shared(chunks: Vec<(u32, Vec<f64>)>) -> Vec<(u32, SharedAreas)> {
    let chunks = chunks.into_iter();
    chunks
        .map(|(chunk, weights)| (chunk, weights.into()))
        .collect()
}

/// The same as text: numbers by their bits, since readers of decimal numbers may differ in the last one, and weights that
/// were computed here and there are the same.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    cells: [u32; 2],
    north_west_dlat_dlon: [u64; 4],
    geometry: WrittenGeometry,
    earth: Earth,
    surface: Surface,
    shares_at: Option<String>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum WrittenGeometry {
    Global,
    Box([u64; 4]),
    /// Each an outer ring and its holes.
    Polygons(Vec<Vec<Vec<[u64; 2]>>>),
    /// Vertices of each part.
    Line(Vec<Vec<[u64; 2]>>),
    Point {
        at: [u64; 2],
        is_bilinear: bool,
    },
}

impl Written {
    fn of(weights: &ComputedWeights) -> Self {
        let (grid, bits) = (&weights.grid, |numbers: [f64; 4]| numbers.map(f64::to_bits));
        let ring = |ring: &Vec<[f64; 2]>| ring.iter().map(|at| at.map(f64::to_bits)).collect();
        let rings = |polygon: &Polygon| {
            let outer = std::iter::once(&polygon.outer);
            outer.chain(&polygon.holes).map(ring).collect()
        };
        Self {
            cells: [grid.rows, grid.cols],
            north_west_dlat_dlon: bits([
                grid.north_deg,
                grid.west_deg,
                grid.dlat_deg,
                grid.dlon_deg,
            ]),
            geometry: match &weights.geometry {
                Geometry::Region(Region::Global) => WrittenGeometry::Global,
                Geometry::Region(Region::Box {
                    west,
                    south,
                    east,
                    north,
                }) => WrittenGeometry::Box(bits([*west, *south, *east, *north])),
                Geometry::Region(Region::Polygons(polygons)) => {
                    WrittenGeometry::Polygons(polygons.iter().map(rings).collect())
                }
                Geometry::Line(line) => {
                    let part = |part: &Vec<LonLatDeg>| part.iter().map(place_bits).collect();
                    WrittenGeometry::Line(line.parts().iter().map(part).collect())
                }
                Geometry::Point { place, sampling } => WrittenGeometry::Point {
                    at: place_bits(place),
                    is_bilinear: *sampling == Sampling::Bilinear,
                },
            },
            earth: weights.earth,
            surface: weights.surface.clone(),
            shares_at: weights.shares_at.clone(),
        }
    }

    fn read(self) -> Result<ComputedWeights, ComputeError> {
        let [rows, cols] = self.cells;
        let [north_deg, west_deg, dlat_deg, dlon_deg] =
            self.north_west_dlat_dlon.map(f64::from_bits);
        let ring = |ring: Vec<[u64; 2]>| ring.iter().map(|at| at.map(f64::from_bits)).collect();
        let polygon = |rings: Vec<Vec<[u64; 2]>>| {
            let mut rings = rings.into_iter().map(ring);
            Polygon {
                outer: rings.next().unwrap_or_default(),
                holes: rings.collect(),
            }
        };
        Ok(ComputedWeights {
            grid: Grid {
                rows,
                cols,
                north_deg,
                west_deg,
                dlat_deg,
                dlon_deg,
            },
            geometry: match self.geometry {
                WrittenGeometry::Global => Geometry::Region(Region::Global),
                WrittenGeometry::Box(edges) => {
                    let [west, south, east, north] = edges.map(f64::from_bits);
                    Geometry::Region(Region::Box {
                        west,
                        south,
                        east,
                        north,
                    })
                }
                WrittenGeometry::Polygons(polygons) => {
                    let polygons = polygons.into_iter().map(polygon).collect();
                    Geometry::Region(Region::Polygons(polygons))
                }
                WrittenGeometry::Line(parts) => {
                    let parts: Vec<Vec<[f64; 2]>> = parts.into_iter().map(ring).collect();
                    Geometry::Line(Line::new(&parts)?)
                }
                WrittenGeometry::Point { at, is_bilinear } => {
                    let [lon, lat] = at.map(f64::from_bits);
                    Geometry::Point {
                        place: LonLatDeg::new(lon, lat)?,
                        sampling: if is_bilinear {
                            Sampling::Bilinear
                        } else {
                            Sampling::Cell
                        },
                    }
                }
            },
            earth: self.earth,
            surface: self.surface,
            shares_at: self.shares_at,
        })
    }
}

fn place_bits(place: &LonLatDeg) -> [u64; 2] {
    [place.lon, place.lat].map(f64::to_bits)
}

/// How many cells of a grid a region can touch at most.
fn cells_in_bounds(grid: &Grid, region: &Region) -> u64 {
    let [west, south, east, north] = match region {
        Region::Global => return grid.cell_count() as u64,
        Region::Box {
            west,
            south,
            east,
            north,
        } => [*west, *south, *east, *north],
        Region::Polygons(polygons) => {
            let corners = |polygon: &'_ Polygon| polygon.outer.clone();
            bounds_deg(&polygons.iter().flat_map(corners).collect::<Vec<_>>())
        }
    };
    let across = |degrees: f64, cell_deg: f64, most: u32| {
        // Both ends may lie inside a cell.
        ((degrees / cell_deg).ceil() as u64 + 1).min(u64::from(most))
    };
    across(north - south, grid.dlat_deg, grid.rows) * across(east - west, grid.dlon_deg, grid.cols)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(cells_a_degree: u32, region: &str) -> ComputedWeights {
        ComputedWeights {
            grid: Grid {
                rows: 180 * cells_a_degree,
                cols: 360 * cells_a_degree,
                north_deg: 90.0,
                west_deg: -180.0,
                dlat_deg: 1.0 / f64::from(cells_a_degree),
                dlon_deg: 1.0 / f64::from(cells_a_degree),
            },
            geometry: Geometry::Region(region.parse().unwrap()),
            earth: Earth::Wgs84,
            surface: Surface::All,
            shares_at: None,
        }
    }

    #[test]
    fn a_question_is_read_as_it_is_written_and_addresses_are_none() {
        let holed = "POLYGON((0.1 0,10 0.3,10 10,0.1 0),(5 1,6 1,6 2,5 1))";
        for region in ["global", "-0.1,0.2,170.3,0.30000000000000004", holed] {
            let question = asked(7, region);
            let text = question.text();
            assert!(ComputedWeights::name(&text).is_some());
            assert_eq!(ComputedWeights::of_text(&text).unwrap(), Some(question));
        }
        let line = Geometry::Line(
            "0.1,0.2;170.3,-80;-170,0.30000000000000004"
                .parse()
                .unwrap(),
        );
        let point = Geometry::Point {
            place: LonLatDeg::new(0.1, 0.2).unwrap(),
            sampling: Sampling::Bilinear,
        };
        for geometry in [line, point] {
            let question = ComputedWeights {
                geometry,
                ..asked(7, "global")
            };
            let text = question.text();
            assert_eq!(ComputedWeights::of_text(&text).unwrap(), Some(question));
        }
        assert_eq!(ComputedWeights::of_text("file:///weights/a").unwrap(), None);
        assert_eq!(ComputedWeights::name("file:///weights/a"), None);
        assert!(ComputedWeights::of_text("computed:{}").is_err());
    }

    #[test]
    fn what_could_take_much_memory_is_refused_before_it_is_computed() {
        for (region, cells) in [
            ("global", 21_600 * 10_800),
            ("-180,-90,180,90", 21_600 * 10_800),
        ] {
            assert_eq!(
                cells_in_bounds(&asked(60, region).grid, &region.parse().unwrap()),
                cells
            );
            let refused = asked(60, region).chunks(None, &Awaited::always());
            let refused = refused.unwrap_err().to_string();
            assert!(refused.contains("fluxglobe budget"), "{refused}");
        }
        let polygon = "POLYGON((10 10,20 10,20 20,10 10))";
        assert_eq!(
            cells_in_bounds(&asked(60, polygon).grid, &polygon.parse().unwrap()),
            601 * 601
        );
        assert!(asked(60, polygon).check_size().is_ok());
        assert!(asked(1, "global").check_size().is_ok());
    }
}
