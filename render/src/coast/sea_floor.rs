//! A coarse relief of all land and sea floor, packed in the program: what shades a plain globe.
//!
//! ETOPO5 (NOAA NGDC 1988, public domain) in means of half a degree; `sea_floor.py` packs it.

use std::sync::LazyLock;

use contract::grid::Grid;

/// A grey picture, rows from the north, columns from 180 W.
const PACKED: &[u8] = include_bytes!("sea_floor.png");
/// A byte is `ZERO + SCALE sign(h) |h|^POWER` of a height in metres: steps of 12 m at the coast, of 75 m in the deep.
const ZERO: f64 = 151.0;
const SCALE: f64 = 0.238;
const POWER: f64 = 0.7;

/// Its cells.
pub const GRID: Grid = Grid {
    rows: 360,
    cols: 720,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 0.5,
    dlon_deg: 0.5,
};

/// Height of every cell above the level of the sea, m.
pub static HEIGHTS_M: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let format = image::ImageFormat::Png;
    let grey = image::load_from_memory_with_format(PACKED, format)
        .expect("the relief in the program is whole; a test reads it")
        .into_luma8();
    grey.into_raw().into_iter().map(height_m).collect()
});

fn height_m(byte: u8) -> f32 {
    let scaled = (f64::from(byte) - ZERO) / SCALE;
    (scaled.signum() * scaled.abs().powf(1.0 / POWER)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(lon_deg: f64, lat_deg: f64) -> f32 {
        let col = ((lon_deg - GRID.west_deg) / GRID.dlon_deg) as usize;
        let row = ((GRID.north_deg - lat_deg) / GRID.dlat_deg) as usize;
        HEIGHTS_M[row * GRID.cols as usize + col]
    }

    #[test]
    fn mountains_and_trenches_are_where_they_are() {
        assert_eq!(HEIGHTS_M.len(), GRID.cell_count());
        GRID.validate().unwrap();
        for (lon, lat, low, high, place) in [
            (88.0, 33.0, 4500.0, 5500.0, "Tibet"),
            (-40.0, 72.0, 2500.0, 3400.0, "Greenland's ice"),
            (
                142.3,
                11.3,
                -10_000.0,
                -6000.0,
                "Challenger Deep, in the mean of its cell",
            ),
            (-30.0, 30.0, -4500.0, -1500.0, "the Mid-Atlantic Ridge"),
            (-20.0, -75.0, -2000.0, 2000.0, "the Weddell Sea's edge"),
            (3.0, 54.5, -80.0, -10.0, "the North Sea"),
            (-150.0, 20.0, -6000.0, -4500.0, "the abyss of the Pacific"),
        ] {
            let height = at(lon, lat);
            assert!((low..=high).contains(&height), "{place}: {height}");
        }
        assert!(height_m(151).abs() < 1e-6 && height_m(152) < 12.0 && height_m(150) > -12.0);
    }

    #[test]
    fn seven_tenths_of_the_earth_are_below_the_sea() {
        let cols = GRID.cols as usize;
        let (mut sea, mut all, mut depth) = (0.0, 0.0, 0.0);
        for (row, heights) in HEIGHTS_M.chunks_exact(cols).enumerate() {
            let share = (90.0 - 0.5 * (row as f64 + 0.5)).to_radians().cos();
            for height in heights {
                all += share;
                if *height < 0.0 {
                    sea += share;
                    depth -= share * f64::from(*height);
                }
            }
        }
        // 70.8 % and 3.7 km (NOAA); cells on a coast are counted whole.
        assert!((sea / all - 0.708).abs() < 0.01, "{}", sea / all);
        assert!((depth / sea - 3700.0).abs() < 100.0, "{}", depth / sea);
    }
}
