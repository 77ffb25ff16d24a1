//! Rings as plain data: corners and the edges between them.

/// A closed ring: corners `[lon, lat]` in degrees, edges straight between these numbers, the first not repeated at the
/// end. Outer rings run against the clock, holes with it, so that signed areas add up.
#[derive(Debug, Clone)]
pub(super) struct Ring {
    corners: Vec<[f64; 2]>,
}

impl Ring {
    /// A ring that runs as its corners do.
    pub(super) fn new(corners: Vec<[f64; 2]>) -> Self {
        Self { corners }
    }

    /// A box as a ring against the clock.
    pub(super) fn rectangle([west, south, east, north]: [f64; 4]) -> Self {
        Self::new(vec![
            [west, south],
            [east, south],
            [east, north],
            [west, north],
        ])
    }

    /// Its corners.
    pub(super) fn corners(&self) -> &[[f64; 2]] {
        &self.corners
    }

    /// Edges as pairs of corners.
    pub(super) fn edges(&self) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|(&from, &to)| [from, to])
    }

    /// Westernmost and easternmost longitude.
    pub(super) fn lon_range_deg(&self) -> (f64, f64) {
        let lons = || self.corners.iter().map(|corner| corner[0]);
        (
            lons().fold(f64::INFINITY, f64::min),
            lons().fold(f64::NEG_INFINITY, f64::max),
        )
    }
}

/// A polygon whose corners are places: rings are not closed, at least a triangle each, and no wider than the earth.
#[derive(Debug, Clone)]
pub(super) struct Checked {
    pub(super) outer: Vec<[f64; 2]>,
    pub(super) holes: Vec<Vec<[f64; 2]>>,
}

impl Checked {
    /// All its rings, the outer one first.
    pub(super) fn rings(&self) -> impl Iterator<Item = &Vec<[f64; 2]>> {
        std::iter::once(&self.outer).chain(&self.holes)
    }
}
