//! Where statistics are asked for: at a point, along a line, over a region.

mod line;

use serde::Serialize;
use utoipa::ToSchema;

use crate::ContractError;
use crate::grid::{LonLatDeg, rounded_deg};
use crate::region::{AskedRegion, Region};

pub use line::{AskedLine, Line, MAX_VERTICES};

/// How the value at a point is made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Sampling {
    /// That of the cell that holds it.
    #[default]
    Cell,
    /// Of the four cells whose centres lie around it, by their nearness along both axes; of those that hold data.
    Bilinear,
}

impl std::fmt::Display for Sampling {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Cell => "cell",
            Self::Bilinear => "bilinear",
        })
    }
}

impl std::str::FromStr for Sampling {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "cell" => Ok(Self::Cell),
            "bilinear" => Ok(Self::Bilinear),
            _ => Err(ContractError::invalid(
                "sampling",
                s,
                "use cell or bilinear",
            )),
        }
    }
}

/// A place, a line or a region.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Geometry {
    /// A place.
    Point {
        /// Where.
        place: LonLatDeg,
        /// What its value is.
        sampling: Sampling,
    },
    /// Great-circle arcs from vertex to vertex.
    Line(Line),
    /// A region.
    Region(Region),
}

impl Geometry {
    /// `point`, `line` or `area`.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Point { .. } => "point",
            Self::Line(_) => "line",
            Self::Region(_) => "area",
        }
    }
}

/// A geometry and its name in answers.
#[derive(Debug, Clone, PartialEq)]
pub struct AskedGeometry {
    /// Its shape.
    pub geometry: Geometry,
    /// Its name, or the text or file that it was asked for with; of a long text its digest.
    pub name: String,
}

impl AskedGeometry {
    /// A place, called by its coordinates.
    pub fn point(place: LonLatDeg, sampling: Sampling) -> Self {
        Self {
            geometry: Geometry::Point { place, sampling },
            name: format!("{},{}", rounded_deg(place.lon), rounded_deg(place.lat)),
        }
    }

    /// A line by the text that it is written as.
    ///
    /// # Errors
    /// As of [`Line`].
    pub fn line(text: &str) -> Result<Self, ContractError> {
        Ok(text.parse::<AskedLine>()?.into())
    }
}

impl From<AskedLine> for AskedGeometry {
    fn from(asked: AskedLine) -> Self {
        Self {
            geometry: Geometry::Line(asked.line),
            name: asked.name,
        }
    }
}

impl From<AskedRegion> for AskedGeometry {
    fn from(asked: AskedRegion) -> Self {
        Self {
            geometry: Geometry::Region(asked.region),
            name: asked.name,
        }
    }
}
