//! Blocks of map tiles: the tile and its neighbours whose light is made once for all of them.

use contract::job::{Mode, RenderJob, View};
use contract::tile::Tile;

/// Side of a block, pixels. The light of a block of four by four tiles is six times as large as that of one of them:
/// the margin from which shadows fall into it is shared, too.
const BLOCK_PX: u32 = 1024;

/// Texels of a light on the absolute pixel grid of a zoom level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LightWindow {
    /// First column and row, counted from the level's corner.
    pub first: [i64; 2],
    /// Columns and rows.
    pub texels: [u32; 2],
}

/// The picture of the block that a tile belongs to, as a job that is larger than anybody may ask for; none for pictures
/// that share light with no other.
pub(crate) fn of(job: &RenderJob) -> Option<RenderJob> {
    let View::Tile { tile, size_px } = job.view else {
        return None;
    };
    let levels = (BLOCK_PX / size_px.max(1)).max(1).ilog2();
    let levels = levels.min(u32::from(tile.z));
    if job.mode != Mode::Volume || levels == 0 {
        return None;
    }
    let mut block = job.clone();
    block.view = View::Tile {
        tile: Tile {
            z: tile.z - levels as u8,
            x: tile.x >> levels,
            y: tile.y >> levels,
        },
        size_px: size_px << levels,
    };
    Some(block)
}
