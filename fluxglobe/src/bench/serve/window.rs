//! Windows of a map: a rectangle of tiles around each tile that lies on a product.

use anyhow::Result;
use contract::tile::Tile;

use super::questions::{tile_address, tiles_on};
use crate::bench::listed::Listed;
use crate::bench::window_size::WindowSize;
use crate::cli::BenchServe;

/// The tiles that one viewer sees.
#[derive(Debug, Clone)]
pub(super) struct Window {
    /// Addresses without their instant.
    pub(super) addresses: Vec<String>,
}

impl Window {
    /// One around every tile that lies on the product.
    pub(super) fn all(product: &Listed, options: &BenchServe) -> Result<Vec<Self>> {
        let zoom = options.zoom();
        let around = |tile: &Tile| Self {
            addresses: tiles_around(*tile, options.window)
                .into_iter()
                .map(|tile| tile_address(product, options, tile))
                .collect(),
        };
        Ok(tiles_on(product, zoom)?.iter().map(around).collect())
    }
}

/// Round the earth in columns, no farther than the poles in rows; each tile once.
fn tiles_around(tile: Tile, size: WindowSize) -> Vec<Tile> {
    let side = 1u32 << tile.z;
    let (columns, rows) = (size.columns.min(side), size.rows.min(side));
    let first_x = tile.x + side - columns / 2;
    let first_y = tile.y.saturating_sub(rows / 2).min(side - rows);
    let tile = |row: u32, column: u32| Tile {
        z: tile.z,
        x: (first_x + column) % side,
        y: first_y + row,
    };
    (0..rows)
        .flat_map(|row| (0..columns).map(move |column| tile(row, column)))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn windows_go_round_the_earth_and_end_at_the_poles() {
        let size: WindowSize = "4x3".parse().unwrap();
        let at = |z, x, y| -> Vec<(u32, u32)> {
            let tiles = tiles_around(Tile { z, x, y }, size);
            tiles.iter().map(|tile| (tile.x, tile.y)).collect()
        };
        let middle = at(4, 8, 8);
        assert_eq!((middle[0], middle[11]), ((6, 7), (9, 9)));
        assert_eq!(at(4, 0, 0)[0], (14, 0));
        assert_eq!(at(4, 15, 15)[11], (0, 15));
        // A world of two by two tiles is seen once.
        let small: BTreeSet<_> = at(1, 1, 1).into_iter().collect();
        assert_eq!((small.len(), at(1, 1, 1).len()), (4, 4));
    }
}
