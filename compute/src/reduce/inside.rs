//! Which blocks of a geometry stored sums stand for: those whose every cell counts as it does in them. The rest is read.

use contract::chunk::Window;
use cube::{BLOCK_CELLS, Basis};
use serde::{Deserialize, Serialize};

use super::cells::{CellWeight, Cells, blocks};

/// Blocks side by side in a shard that lie inside of a geometry.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct InsideRun {
    /// Number of the westernmost block.
    pub(super) first: u32,
    /// That of the easternmost one.
    pub(super) last: u32,
    /// Those of them of whose cells coverage counts other weights: where the sea ends.
    pub(super) coast: Vec<u32>,
}

impl InsideRun {
    /// These blocks, none of them on a coast.
    #[cfg(test)]
    pub(super) fn over(blocks: std::ops::RangeInclusive<u32>) -> Self {
        Self {
            first: *blocks.start(),
            last: *blocks.end(),
            coast: vec![],
        }
    }

    /// Records of sums that are read of it at most.
    pub(super) fn record_count(&self) -> usize {
        2 + self.coast.len()
    }
}

/// A geometry's blocks, parted.
#[derive(Debug, Default)]
pub(super) struct Inside {
    /// Blocks that stored sums stand for.
    pub(super) runs: Vec<InsideRun>,
    /// Numbers of the others, increasing.
    pub(super) rim: Vec<u32>,
}

impl Inside {
    /// Parts the blocks of a geometry, whose numbers increase.
    pub(super) fn of(cells: &Cells<'_>, numbers: &[u32], basis: &Basis) -> Self {
        let windows = blocks(cells.shape);
        let across = cells.shape[1].div_ceil(BLOCK_CELLS);
        let mut own = Self::default();
        for &number in numbers {
            let window = windows[number as usize];
            let weights = cells.window(window);
            if !is_whole(&weights, window, basis) {
                own.rim.push(number);
                continue;
            }
            // Sums begin anew at the west of a shard.
            let is_begun = !(number % across).is_multiple_of(basis.shard_cols);
            match own.runs.last_mut() {
                Some(run) if is_begun && run.last + 1 == number => run.last = number,
                _ => own.runs.push(InsideRun {
                    first: number,
                    last: number,
                    coast: vec![],
                }),
            }
            let is_coast = weights.iter().any(|cell| cell.covered != cell.weight);
            if let Some(run) = own.runs.last_mut().filter(|_| is_coast) {
                run.coast.push(number);
            }
        }
        own
    }

    /// Records and blocks that are read for it.
    pub(super) fn read_counts(&self) -> [usize; 2] {
        let records = self.runs.iter().map(InsideRun::record_count);
        [records.sum(), self.rim.len()]
    }
}

/// Does every cell of a block count as in stored sums?
fn is_whole(cells: &[CellWeight], window: Window, basis: &Basis) -> bool {
    let rows = cells.chunks_exact(window.cols as usize);
    (window.row..).zip(rows).all(|(row, cells)| {
        let whole = basis.row_weights.get(row as usize);
        whole.is_some_and(|whole| cells.iter().all(|cell| cell.weight == *whole))
    })
}

#[cfg(test)]
mod tests {
    use contract::earth::Earth;
    use contract::grid::Grid;
    use contract::quantity::Quantity;
    use contract::region::Region;
    use cube::scale::Scale;
    use cube::weight_unit::{WeightUnit, largest_cell_m2};

    use super::*;
    use crate::region::loaded::RegionWeights;
    use crate::region::weights::compute;

    const GRID: Grid = Grid {
        rows: 450,
        cols: 615,
        north_deg: 30.0,
        west_deg: 100.0,
        dlat_deg: 1.0 / 15.0,
        dlon_deg: 1.0 / 15.0,
    };
    const SHAPE: [u32; 2] = [GRID.rows, GRID.cols];
    /// Two shards side by side.
    const SHARD_COLS: u32 = 39;

    fn basis(unit: WeightUnit) -> Basis {
        let weight = |row: u32| unit.steps(GRID.cell_area_m2(row, Earth::Wgs84));
        Basis {
            scale: Scale::of(Quantity::CarbonFlux).unwrap(),
            row_weights: (0..GRID.rows).map(weight).collect(),
            shard_cols: SHARD_COLS,
        }
    }

    /// A ring with bays round a place, of some 46,000 cells.
    fn outline() -> Region {
        let corner = |at: u32| {
            let angle = std::f64::consts::TAU * f64::from(at % 48) / 48.0;
            let radius = 8.05 + 0.9 * (5.0 * angle).sin() + 0.5 * (9.0 * angle).cos();
            let (lon, lat) = (115.0 + radius * angle.cos(), 15.0 + radius * angle.sin());
            format!("{lon} {lat}")
        };
        let corners: Vec<String> = (0..=48).map(corner).collect();
        format!("POLYGON(({}))", corners.join(",")).parse().unwrap()
    }

    fn inside(region: &Region, sea: &RegionWeights, basis: &Basis, unit: WeightUnit) -> Inside {
        let whole = RegionWeights::new(compute(&GRID, region, Earth::Wgs84).unwrap());
        let cells = Cells {
            shape: SHAPE,
            whole: &whole,
            covered: sea,
            unit,
        };
        let numbers = cells.blocks();
        let found = Inside::of(&cells, &numbers, basis);
        let inside = found.runs.iter().flat_map(|run| run.first..=run.last);
        let mut all: Vec<u32> = inside.chain(found.rim.iter().copied()).collect();
        all.sort_unstable();
        assert_eq!(all, numbers, "every block is in one part");
        found
    }

    #[test]
    fn of_a_region_the_rim_is_read_and_two_records_a_row_of_blocks() {
        let unit = WeightUnit::of(largest_cell_m2(&GRID, Earth::Wgs84));
        let (region, basis) = (outline(), basis(unit));
        let whole = RegionWeights::new(compute(&GRID, &region, Earth::Wgs84).unwrap());
        let found = inside(&region, &whole, &basis, unit);
        let block_count: u32 = found.runs.iter().map(|run| run.last + 1 - run.first).sum();
        let [records, blocks] = found.read_counts();
        assert!(block_count > 550, "{block_count}");
        assert!(blocks < 220 && records < 140, "{blocks} {records}");
        for run in &found.runs {
            let (first, last) = (run.first % 77, run.last % 77);
            assert_eq!(run.first / 77, run.last / 77, "in one row");
            assert_eq!(first / SHARD_COLS, last / SHARD_COLS, "in one shard");
            assert!(run.coast.is_empty());
        }
        // Where coverage counts less of one cell, its block is on the coast.
        let mut coast = compute(&GRID, &region, Earth::Wgs84).unwrap();
        let chunk = coast.len() / 2;
        let cell = coast[chunk].1.len() / 2;
        coast[chunk].1[cell] *= 0.5;
        let found = inside(&region, &RegionWeights::new(coast), &basis, unit);
        let coasts = found.runs.iter().map(|run| run.coast.len());
        assert_eq!(coasts.sum::<usize>(), 1);
        assert_eq!(found.read_counts(), [records + 1, blocks]);
    }

    #[test]
    fn cells_that_count_otherwise_are_all_read() {
        let unit = WeightUnit::of(largest_cell_m2(&GRID, Earth::Wgs84));
        let (region, mut own) = (outline(), basis(unit));
        let whole = RegionWeights::new(compute(&GRID, &region, Earth::Wgs84).unwrap());
        for weight in &mut own.row_weights {
            *weight += 1;
        }
        let found = inside(&region, &whole, &own, unit);
        assert!(found.runs.is_empty() && found.rim.len() > 700);
        // Of one row of cells: its row of blocks.
        let mut own = basis(unit);
        let sound = inside(&region, &whole, &own, unit);
        own.row_weights[225] -= 1;
        let found = inside(&region, &whole, &own, unit);
        let rows = |inside: &Inside| {
            let rows = inside.runs.iter().map(|run| run.first / 77);
            rows.collect::<std::collections::BTreeSet<u32>>()
        };
        assert_eq!(rows(&sound).len(), rows(&found).len() + 1);
        assert!(!rows(&found).contains(&(225 / 8)));
    }
}
