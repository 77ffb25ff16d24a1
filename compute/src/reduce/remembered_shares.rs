//! What cells of blocks have of a geometry, made once for all runs of steps.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::reduction::CellShares;

/// Blocks that are remembered, some KiB each: those of a region of 500,000 cells. Others are made for each run of steps.
const MOST_BLOCKS: usize = 1 << 13;

/// Shares of the cells of blocks, by the number of the block.
#[derive(Debug, Default)]
pub(super) struct RememberedShares(Mutex<HashMap<u32, Arc<CellShares>>>);

impl RememberedShares {
    /// Those of some blocks, in their order; `made` makes those of a block that are not remembered.
    pub(super) fn of(
        &self,
        blocks: &[u32],
        made: impl Fn(u32) -> CellShares,
    ) -> Vec<Arc<CellShares>> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found: Vec<Option<Arc<CellShares>>> = blocks
            .iter()
            .map(|block| known.get(block).cloned())
            .collect();
        let room = MOST_BLOCKS.saturating_sub(known.len());
        drop(known);
        let mut new = vec![];
        let all = blocks.iter().zip(found).map(|(block, found)| {
            found.unwrap_or_else(|| {
                let own = Arc::new(made(*block));
                if new.len() < room {
                    new.push((*block, Arc::clone(&own)));
                }
                own
            })
        });
        let all = all.collect();
        known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.extend(new);
        all
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;
    use crate::reduce::cells::CellWeight;

    #[test]
    fn each_block_is_made_once_and_found_by_its_number() {
        let (remembered, made) = (RememberedShares::default(), RefCell::new(vec![]));
        let of = |blocks: &[u32]| -> Vec<i64> {
            let found = remembered.of(blocks, |block| {
                made.borrow_mut().push(block);
                CellShares::Weights(vec![CellWeight {
                    weight: block.into(),
                    covered: 0,
                }])
            });
            let weight = |own: &Arc<CellShares>| match &**own {
                CellShares::Weights(cells) => cells[0].weight,
                CellShares::Areas(_) => -1,
            };
            found.iter().map(weight).collect()
        };
        assert_eq!(of(&[7, 3]), [7, 3]);
        assert_eq!(of(&[3, 5, 7]), [3, 5, 7]);
        assert_eq!(*made.borrow(), [7, 3, 5]);
    }

    #[test]
    fn no_more_are_remembered_than_there_is_room_for() {
        let remembered = RememberedShares::default();
        let blocks: Vec<u32> = (0..MOST_BLOCKS as u32 + 5).collect();
        for _ in 0..2 {
            let found = remembered.of(&blocks, |_| CellShares::Weights(vec![]));
            assert_eq!(found.len(), blocks.len());
        }
        assert_eq!(remembered.0.lock().unwrap().len(), MOST_BLOCKS);
    }
}
