//! Lines on a grid: every edge is a great-circle arc, cut where it crosses the grid's lines; each piece leaves its length in
//! the cell that holds its middle.
//!
//! The way from vertex to vertex is the great circle of the sphere through their longitudes and latitudes; how long it is there is
//! measured on the chosen figure of the earth. What runs along an edge of cells belongs to the cells south and east of it.

use std::collections::BTreeMap;

use contract::chunk::{CHUNK_COLS, CHUNK_ROWS, field_chunks};
use contract::earth::{Earth, SPHERE_RADIUS_M, WGS84_EQUATORIAL_RADIUS_M, WGS84_POLAR_RADIUS_M};
use contract::geometry::Line;
use contract::grid::{Grid, LonLatDeg, rounded_deg};

use super::rings::bad;
use crate::ComputeError;

/// Longest piece that one quadrature takes, radians: 5 degrees.
const PIECE_RAD: f64 = 0.087_266_462_599_716_48;
/// Pieces that a line may have.
const MAX_PIECES: u64 = 8 << 20;
/// Below this an arc has no length, radians: 6 µm.
const NO_LENGTH_RAD: f64 = 1e-12;

type Vector = [f64; 3];

/// Length of a line's share of every cell, m, by chunk number; only chunks with any. A cell that it passes twice has both.
///
/// # Errors
/// It crosses more of the grid's lines than can be answered for.
pub(crate) fn lengths_m(
    grid: &Grid,
    line: &Line,
    earth: Earth,
) -> Result<Vec<(u32, Vec<f64>)>, ComputeError> {
    let windows = field_chunks(grid);
    let across = grid.cols.div_ceil(CHUNK_COLS);
    let mut chunks: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    let mut piece_count = 0;
    for [from, to] in line.edges() {
        let arc = Arc::between(from, to);
        let cuts = arc.cuts(grid);
        piece_count += cuts.len() as u64;
        if piece_count > MAX_PIECES {
            return Err(bad(format!(
                "the line crosses more than {MAX_PIECES} edges of cells: ask for parts of it"
            )));
        }
        for ends in cuts.windows(2) {
            let Some((row, col)) = grid.cell_at(arc.place(0.5 * (ends[0] + ends[1]))) else {
                continue;
            };
            let chunk = row / CHUNK_ROWS * across + col / CHUNK_COLS;
            let window = windows[chunk as usize];
            let cell = (row - window.row) * window.cols + col - window.col;
            let lengths = chunks
                .entry(chunk)
                .or_insert_with(|| vec![0.0; window.cell_count()]);
            lengths[cell as usize] += arc.length_m(ends[0], ends[1], earth);
        }
    }
    chunks.retain(|_chunk, lengths| lengths.iter().any(|length| *length > 0.0));
    Ok(chunks.into_iter().collect())
}

/// Length of a line, m, wherever grids may lie.
pub(crate) fn length_m(line: &Line, earth: Earth) -> f64 {
    line.edges()
        .map(|[from, to]| {
            let arc = Arc::between(from, to);
            arc.length_m(0.0, arc.angle_rad, earth)
        })
        .sum()
}

/// The shorter arc of a great circle between two places: `from` cos t + `towards` sin t, for t from 0 to its angle.
struct Arc {
    from: Vector,
    towards: Vector,
    angle_rad: f64,
    ends: [LonLatDeg; 2],
}

impl Arc {
    fn between(from: LonLatDeg, to: LonLatDeg) -> Self {
        let (a, b) = (unit(from), unit(to));
        let normal = cross(a, b);
        let (sin, cos) = (norm(normal), dot(a, b));
        let towards = cross(normal, a);
        let towards = if sin > 0.0 {
            towards.map(|x| x / sin)
        } else {
            [0.0; 3]
        };
        Self {
            from: a,
            towards,
            angle_rad: sin.atan2(cos),
            ends: [from, to],
        }
    }

    fn at(&self, t: f64) -> Vector {
        let (sin, cos) = t.sin_cos();
        std::array::from_fn(|i| self.from[i] * cos + self.towards[i] * sin)
    }

    /// The place there, without the noise of arithmetic: on an edge of cells it lies on the edge.
    fn place(&self, t: f64) -> LonLatDeg {
        let [x, y, z] = self.at(t);
        let (lon, lat) = (y.atan2(x).to_degrees(), z.atan2(x.hypot(y)).to_degrees());
        LonLatDeg {
            lon: rounded_deg(lon),
            lat: rounded_deg(lat),
        }
    }

    /// Where it crosses lines of a grid, and its ends, in order.
    fn cuts(&self, grid: &Grid) -> Vec<f64> {
        let mut cuts = vec![0.0, self.angle_rad];
        self.cut_at_parallels(grid, &mut cuts);
        self.cut_at_meridians(grid, &mut cuts);
        cuts.retain(|t| (0.0..=self.angle_rad).contains(t));
        cuts.sort_by(f64::total_cmp);
        cuts.dedup_by(|a, b| *a - *b < NO_LENGTH_RAD);
        cuts
    }

    fn cut_at_parallels(&self, grid: &Grid, cuts: &mut Vec<f64>) {
        // The height above the equator is height_max * cos(t - top).
        let (a, b) = (self.from[2], self.towards[2]);
        let (highest, top) = (a.hypot(b), b.atan2(a));
        let turns = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|turn| turn * std::f64::consts::PI);
        let extremes = turns.map(|turn| top + turn);
        let own = extremes.into_iter().chain([0.0, self.angle_rad]);
        let own = own.filter(|t| (0.0..=self.angle_rad).contains(t));
        let heights = own.map(|t| self.at(t)[2].clamp(-1.0, 1.0).asin().to_degrees());
        let (south, north) =
            heights.fold((90.0f64, -90.0f64), |(s, n), lat| (s.min(lat), n.max(lat)));
        let row_of = |lat: f64| (grid.north_deg - lat) / grid.dlat_deg;
        let first = row_of(north).floor().max(0.0) as u32;
        let last = row_of(south).ceil().clamp(0.0, f64::from(grid.rows)) as u32;
        for row in first..=last {
            let height = grid.row_north_deg(row).to_radians().sin();
            if height.abs() <= highest {
                let off = (height / highest).acos();
                for turn in [-1.0, 0.0, 1.0].map(|turn| turn * std::f64::consts::TAU) {
                    cuts.extend([top + off + turn, top - off + turn]);
                }
            }
        }
    }

    fn cut_at_meridians(&self, grid: &Grid, cuts: &mut Vec<f64>) {
        let [from, to] = self.ends.map(|end| end.lon);
        // The shorter way, as the arc goes.
        let width = (to - from + 540.0).rem_euclid(360.0) - 180.0;
        let (west, east) = (from.min(from + width), from.max(from + width));
        for turn in [-720.0, -360.0, 0.0, 360.0, 720.0] {
            let col_of = |lon: f64| (lon - turn - grid.west_deg) / grid.dlon_deg;
            let first = col_of(west).floor().max(0.0);
            let last = col_of(east).ceil().min(f64::from(grid.cols));
            if first > last {
                continue;
            }
            for col in first as u32..=last as u32 {
                let (sin, cos) = grid.col_west_deg(col).to_radians().sin_cos();
                let off = |v: Vector| v[1] * cos - v[0] * sin;
                // The plane of the meridian; also that of the one on the other side, which cuts a piece in two.
                let t = (-off(self.from)).atan2(off(self.towards));
                cuts.extend([t, t + std::f64::consts::PI]);
            }
        }
    }

    /// Length of a part, m: five-point Gauss-Legendre of the speed along it on pieces of at most 5 degrees.
    fn length_m(&self, from: f64, to: f64, earth: Earth) -> f64 {
        /// Abscissas and weights on [-1, 1]: Abramowitz & Stegun (1964), table 25.4, n = 5.
        const POINTS: [(f64, f64); 5] = [
            (0.0, 0.568_888_888_888_888_9),
            (0.538_469_310_105_683, 0.478_628_670_499_366_47),
            (-0.538_469_310_105_683, 0.478_628_670_499_366_47),
            (0.906_179_845_938_664, 0.236_926_885_056_189_08),
            (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
        ];
        if earth == Earth::Sphere {
            return SPHERE_RADIUS_M * (to - from);
        }
        let pieces = ((to - from) / PIECE_RAD).ceil().max(1.0);
        let step = (to - from) / pieces;
        let mut mean = 0.0;
        for piece in 0..pieces as u32 {
            let middle = from + step * (f64::from(piece) + 0.5);
            for (x, weight) in POINTS {
                mean += 0.5 * weight * self.metres_a_radian(middle + 0.5 * step * x, earth);
            }
        }
        (to - from) * mean / pieces
    }

    /// Metres along the figure of the earth in a radian of the arc.
    ///
    /// On WGS84 with the radii of curvature along the meridian (M) and across it (N): √(M² cos²α + N² sin²α), α the azimuth.
    /// Source: Snyder (1987), Map Projections, USGS Professional Paper 1395, eqs. 4-18 to 4-21.
    fn metres_a_radian(&self, t: f64, earth: Earth) -> f64 {
        let (a, b) = (WGS84_EQUATORIAL_RADIUS_M, WGS84_POLAR_RADIUS_M);
        let [x, y, sin_lat] = self.at(t);
        let cos_lat = x.hypot(y);
        match earth {
            Earth::Sphere => SPHERE_RADIUS_M,
            Earth::LocalRadius => {
                let (c, s) = (a * cos_lat, b * sin_lat);
                ((a * c).powi(2) + (b * s).powi(2)).sqrt() / c.hypot(s)
            }
            Earth::Wgs84 => {
                let eccentricity_sq = 1.0 - (b / a).powi(2);
                let w_sq = 1.0 - eccentricity_sq * sin_lat * sin_lat;
                let across = a / w_sq.sqrt();
                let along = across * (1.0 - eccentricity_sq) / w_sq;
                let (sin, cos) = t.sin_cos();
                let rise = self.towards[2] * cos - self.from[2] * sin;
                // At a pole every way leads along a meridian.
                let northward = if cos_lat > f64::EPSILON {
                    (rise / cos_lat).clamp(-1.0, 1.0).powi(2)
                } else {
                    1.0
                };
                (along * along * northward + across * across * (1.0 - northward)).sqrt()
            }
        }
    }
}

fn unit(place: LonLatDeg) -> Vector {
    let (sin_lon, cos_lon) = place.lon.to_radians().sin_cos();
    let (sin_lat, cos_lat) = place.lat.to_radians().sin_cos();
    [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat]
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests;
