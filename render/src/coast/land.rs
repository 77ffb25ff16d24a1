//! How much of every place of the earth is land, as grids of bytes from fine to coarse: what a globe shows below its
//! particles, whatever data there are.

use std::ops::Range;
use std::sync::LazyLock;

use contract::land::LAND;

/// Cells of the finest level for each degree.
pub const FINEST_PER_DEG: u32 = 16;
/// Levels, each half as fine as the one before.
pub const LEVELS: u32 = 4;
/// Lines through each row of cells along which the share of land is exact.
const LINES: u32 = 4;

/// Coverage of all levels, the finest first, rows from the north, columns from 180 W; four cells to a word, the first in
/// the lowest bits. 255 is all land.
pub static COVER: LazyLock<Vec<u32>> = LazyLock::new(|| {
    let mut level = finest();
    let mut words = vec![];
    for number in 0..LEVELS {
        if number > 0 {
            level = coarser(&level, number);
        }
        words.extend(level.chunks_exact(4).map(|cells| {
            cells
                .iter()
                .rev()
                .fold(0u32, |word, &cell| word << 8 | u32::from(cell))
        }));
    }
    words
});

/// Columns and rows of a level.
pub fn size(level: u32) -> [u32; 2] {
    let per_deg = FINEST_PER_DEG >> level;
    [360 * per_deg, 180 * per_deg]
}

/// The first word of a level.
fn first_word(level: u32) -> u32 {
    (0..level)
        .map(|finer| size(finer).iter().product::<u32>() / 4)
        .sum()
}

/// Cells of a level for each radian.
pub fn per_rad(level: u32) -> f64 {
    f64::from(FINEST_PER_DEG >> level).to_degrees()
}

/// The words of a level.
pub fn words(level: u32) -> Range<usize> {
    first_word(level) as usize..first_word(level + 1) as usize
}

/// The level with so many columns.
pub fn level_of(cols: u32) -> u32 {
    (360 * FINEST_PER_DEG / cols.max(1)).ilog2()
}

/// The level whose cells are about as large as a pixel, or a little larger.
pub fn level(px_per_deg: f64) -> u32 {
    let wanted = (f64::from(FINEST_PER_DEG) / px_per_deg.max(1e-6)).log2();
    wanted.ceil().clamp(0.0, f64::from(LEVELS - 1)) as u32
}

/// An edge of a ring: from its southern end to its northern one, and which ring.
struct Edge {
    south: [f64; 2],
    north: [f64; 2],
    ring: u32,
}

fn finest() -> Vec<u8> {
    let [cols, rows] = size(0);
    // Edges by the degrees of latitude that they cross.
    let mut bands: Vec<Vec<Edge>> = (0..180).map(|_| vec![]).collect();
    for (number, ring) in (0..).zip(LAND.iter()) {
        let ends = ring.iter().zip(ring.iter().cycle().skip(1));
        for (&a, &b) in ends {
            let (south, north) = if a[1] <= b[1] { (a, b) } else { (b, a) };
            let band = |lat: f64| (lat + 90.0).floor().clamp(0.0, 179.0) as usize;
            for band in &mut bands[band(south[1])..=band(north[1])] {
                let ring = number;
                band.push(Edge { south, north, ring });
            }
        }
    }
    let mut cover = Vec::with_capacity(cols as usize * rows as usize);
    for row in 0..rows {
        let mut shares = vec![0f64; cols as usize];
        for line in 0..LINES {
            let below = (f64::from(row) + (f64::from(line) + 0.5) / f64::from(LINES))
                / f64::from(FINEST_PER_DEG);
            let lat = 90.0 - below;
            let band = &bands[(lat + 90.0).floor().clamp(0.0, 179.0) as usize];
            add_line(band, lat, &mut shares);
        }
        cover.extend(
            shares
                .iter()
                .map(|share| (share / f64::from(LINES) * 255.0).round() as u8),
        );
    }
    cover
}

/// Adds to every cell the share of it that is land along a parallel.
fn add_line(edges: &[Edge], lat: f64, shares: &mut [f64]) {
    let mut crossings: Vec<(u32, f64)> = edges
        .iter()
        .filter(|edge| edge.south[1] <= lat && lat < edge.north[1])
        .map(|edge| {
            let share = (lat - edge.south[1]) / (edge.north[1] - edge.south[1]);
            let lon = edge.south[0] + (edge.north[0] - edge.south[0]) * share;
            (edge.ring, lon)
        })
        .collect();
    crossings.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    // What one ring goes round, from the west; together with that of others where rings lie in rings.
    let mut spans: Vec<[f64; 2]> = crossings
        .chunks_exact(2)
        .map(|pair| [pair[0].1, pair[1].1])
        .collect();
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut done = f64::NEG_INFINITY;
    for [west, east] in spans {
        let west = west.max(done);
        if east > west {
            add_span([west, east], shares);
            done = east;
        }
    }
}

fn add_span(span: [f64; 2], shares: &mut [f64]) {
    let [west, east] =
        span.map(|lon| ((lon + 180.0) * f64::from(FINEST_PER_DEG)).clamp(0.0, shares.len() as f64));
    let (first, last) = (west.floor() as usize, east.floor() as usize);
    let end = shares.len() - 1;
    if first == last {
        shares[first.min(end)] += east - west;
        return;
    }
    shares[first] += (first + 1) as f64 - west;
    for share in &mut shares[first + 1..last] {
        *share += 1.0;
    }
    if last <= end {
        shares[last] += east - last as f64;
    }
}

/// Means of two by two cells.
fn coarser(fine: &[u8], level: u32) -> Vec<u8> {
    let [cols, rows] = size(level).map(|cells| cells as usize);
    let at = |row: usize, col: usize| u32::from(fine[row * 2 * cols + col]);
    let cells = (0..rows).flat_map(|row| (0..cols).map(move |col| (2 * row, 2 * col)));
    cells
        .map(|(row, col)| {
            let sum = at(row, col) + at(row, col + 1) + at(row + 1, col) + at(row + 1, col + 1);
            ((sum + 2) / 4) as u8
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(level: u32, lon: f64, lat: f64) -> u32 {
        let [cols, _] = size(level);
        let per_deg = f64::from(FINEST_PER_DEG >> level);
        let col = ((lon + 180.0) * per_deg) as u32;
        let row = ((90.0 - lat) * per_deg) as u32;
        let at = row * cols + col;
        COVER[(first_word(level) + at / 4) as usize] >> (at % 4 * 8) & 255
    }

    #[test]
    fn land_is_where_land_is_at_every_level() {
        for level in 0..LEVELS {
            for (lon, lat, place) in [
                (15.0, 47.0, "Austria"),
                (-100.0, 40.0, "Nebraska"),
                (90.0, 60.0, "Siberia"),
                (179.99, 68.0, "Chukotka, west of the date line"),
                (-179.99, 68.0, "Chukotka, east of it"),
                (0.0, -85.0, "Antarctica"),
            ] {
                assert_eq!(cell(level, lon, lat), 255, "{place}, level {level}");
            }
            for (lon, lat, place) in [
                (-140.0, 0.0, "the Pacific"),
                (0.0, 89.0, "the Arctic Ocean"),
                (18.5, 40.2, "the Strait of Otranto"),
                (-179.9, -30.0, "at the date line"),
            ] {
                assert_eq!(cell(level, lon, lat), 0, "{place}, level {level}");
            }
        }
    }

    #[test]
    fn the_area_of_all_cells_is_that_of_the_land() {
        // On the sphere, of what the rings go round; `compute` has 147.13e12 m² on the ellipsoid for the same rings.
        for level in 0..LEVELS {
            let [cols, rows] = size(level);
            let first = first_word(level) as usize;
            let bytes: Vec<u8> = COVER[first..first + (cols * rows / 4) as usize]
                .iter()
                .flat_map(|word| word.to_le_bytes())
                .collect();
            let sphere_m2 = 4.0 * std::f64::consts::PI * 6.371_007_2e6f64.powi(2);
            let area: f64 = (0..rows)
                .zip(bytes.chunks_exact(cols as usize))
                .map(|(row, cells)| {
                    let edge = |row: u32| {
                        (90.0 - 180.0 * f64::from(row) / f64::from(rows))
                            .to_radians()
                            .sin()
                    };
                    let band = (edge(row) - edge(row + 1)) / 2.0;
                    let land: f64 = cells.iter().map(|&cell| f64::from(cell) / 255.0).sum();
                    band * land / f64::from(cols) * sphere_m2
                })
                .sum();
            assert!(
                (area / 147.13e12 - 1.0).abs() < 2e-3,
                "level {level}: {area}"
            );
        }
    }

    #[test]
    fn levels_follow_the_size_of_a_pixel() {
        assert_eq!(
            [100.0, 16.0, 9.0, 8.0, 3.0, 0.1].map(level),
            [0, 0, 1, 1, 3, 3]
        );
    }
}
