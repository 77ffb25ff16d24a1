//! Tiles that are asked for often: what is worth drawing before it is asked for again.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use contract::job::{Mode, View};
use contract::product::ProductId;
use contract::tile::Tile;
use contract::time::TimeMs;

/// Tiles remembered.
const MOST_TILES: usize = 4096;
/// A tile that was not asked for during this is not hot, however often it was before.
const MEMORY: Duration = Duration::from_hours(1);

/// A tile at an instant, or at whatever is the newest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
struct Place {
    tile: (u8, u32, u32),
    size_px: u32,
    time: Option<TimeMs>,
}

/// A tile that was asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HotTile {
    /// Mode.
    pub mode: Mode,
    /// View.
    pub view: View,
    /// Instant; none where none was asked for, which means the newest step there is.
    pub time: Option<TimeMs>,
    /// How often.
    pub asked: u64,
}

#[derive(Debug, Clone, Copy)]
struct TileUse {
    times: u64,
    last: Instant,
}

/// The hot tiles of one server.
#[derive(Debug, Default)]
pub struct HotTiles {
    tiles: Mutex<HashMap<(ProductId, Mode, Place), TileUse>>,
}

impl HotTiles {
    /// Remembers that a tile was asked for.
    pub fn asked(&self, product: &ProductId, mode: Mode, view: &View, time: Option<TimeMs>) {
        let View::Tile { tile, size_px } = *view else {
            return;
        };
        let place = Place {
            tile: (tile.z, tile.x, tile.y),
            size_px,
            time,
        };
        let now = Instant::now();
        let mut tiles = self.lock();
        let entry = tiles
            .entry((product.clone(), mode, place))
            .or_insert(TileUse {
                times: 0,
                last: now,
            });
        entry.times += 1;
        entry.last = now;
        if tiles.len() > MOST_TILES {
            forget_half(&mut tiles);
        }
    }

    /// The hottest tiles of a product at times that `is_touched`, hottest first, at most `most`.
    pub fn of(
        &self,
        product: &ProductId,
        most: usize,
        is_touched: impl Fn(Option<TimeMs>) -> bool,
    ) -> Vec<HotTile> {
        let tiles = self.lock();
        let mut found: Vec<_> = tiles
            .iter()
            .filter(|((of, _, place), asked)| {
                of == product && asked.last.elapsed() < MEMORY && is_touched(place.time)
            })
            .map(|((_, mode, place), asked)| (asked.times, *mode, *place))
            .collect();
        drop(tiles);
        // Ties in a fixed order, so that replicas ask for the same ones.
        found.sort_by(|a, b| b.0.cmp(&a.0).then_with(|| (a.1, a.2).cmp(&(b.1, b.2))));
        let hot = |(asked, mode, place): (u64, Mode, Place)| HotTile {
            mode,
            view: View::Tile {
                tile: Tile {
                    z: place.tile.0,
                    x: place.tile.1,
                    y: place.tile.2,
                },
                size_px: place.size_px,
            },
            time: place.time,
            asked,
        };
        found.into_iter().take(most).map(hot).collect()
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<(ProductId, Mode, Place), TileUse>> {
        // Changed by single insertions and removals: a poisoned lock guards a whole map.
        self.tiles.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Forgets the half that was asked for the longest time ago; what stays counts half, so that old fame fades.
fn forget_half(tiles: &mut HashMap<(ProductId, Mode, Place), TileUse>) {
    let mut last: Vec<Instant> = tiles.values().map(|asked| asked.last).collect();
    last.sort_unstable();
    let middle = last[last.len() / 2];
    tiles.retain(|_, asked| {
        asked.times = asked.times.div_ceil(2);
        asked.last > middle
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product() -> ProductId {
        "flux".parse().unwrap()
    }

    fn view(x: u32) -> View {
        View::Tile {
            tile: Tile { z: 16, x, y: 0 },
            size_px: 256,
        }
    }

    fn time(text: &str) -> TimeMs {
        text.parse().unwrap()
    }

    #[test]
    fn the_hottest_touched_tiles_come_first() {
        let hot = HotTiles::default();
        for (x, times) in [(1, 3), (2, 5), (3, 1)] {
            (0..times)
                .for_each(|_| hot.asked(&product(), Mode::Volume, &view(x), Some(time("2000-05"))));
        }
        hot.asked(&product(), Mode::Volume, &view(9), Some(time("2000-09")));
        let found = hot.of(&product(), 2, |t| t < Some(time("2000-06")));
        assert_eq!(found.iter().map(|t| t.asked).collect::<Vec<_>>(), [5, 3]);
        assert_eq!(found[0].view, view(2));
        assert!(hot.of(&"other".parse().unwrap(), 9, |_| true).is_empty());
    }

    #[test]
    fn memory_is_bounded() {
        let hot = HotTiles::default();
        for x in 0..20_000 {
            hot.asked(&product(), Mode::Map, &view(x), Some(time("2000")));
        }
        assert!(hot.lock().len() <= MOST_TILES);
        // What was asked for last is among what is remembered, and half of the room is in use.
        let found = hot.of(&product(), 20_000, |_| true);
        assert!(found.iter().any(|tile| tile.view == view(19_999)));
        assert!(found.len() >= MOST_TILES / 2, "{}", found.len());
    }
}
