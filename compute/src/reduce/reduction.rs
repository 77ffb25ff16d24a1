//! Values of a piece in, block by block or chunk by chunk, what is accumulated of them out.

use std::ops::Range;

use cube::BLOCK_CELLS;

use super::accumulator::{Accumulated, too_large};
use super::cells::CellWeight;
use super::kernel::{Summing, Target, add_weights};
use super::question::{Piece, Question, Wanted};
use super::region_sums::{CellArea, RegionScratch, RegionStepSums};
use super::values::Values;
use crate::ComputeError;
use crate::budget::fixed::OutOfRange;

/// What cells have of a geometry, row by row.
#[derive(Debug)]
pub(super) enum CellShares {
    Weights(Vec<CellWeight>),
    Areas(Vec<CellArea>),
}

impl CellShares {
    /// Rows of a block that have some of the geometry, a bit each, the first one lowest.
    pub(super) fn block_rows(&self) -> u8 {
        let is_wanted = |cell: usize| match self {
            Self::Weights(cells) => cells[cell].weight != 0,
            Self::Areas(cells) => cells[cell].whole_m2 != 0.0 || cells[cell].sea_m2 != 0.0,
        };
        let count = match self {
            Self::Weights(cells) => cells.len(),
            Self::Areas(cells) => cells.len(),
        };
        let own = (0..count).filter(|cell| is_wanted(*cell));
        own.fold(0, |bits, cell| bits | 1 << (cell / BLOCK_CELLS as usize))
    }
}

/// What is accumulated of a piece.
pub(super) struct Reduction<'a> {
    question: &'a Question,
    piece: &'a Piece,
    targets: Vec<Target>,
    /// Those of the steps that were added to last, counted from the first of these: mostly the same for all blocks.
    own_targets: (Range<usize>, Vec<Target>),
    sums: Option<Summing>,
    regions: Vec<RegionStepSums>,
    /// Of each step what its values are multiplied with besides the area; nothing where no sums over a region are wanted.
    seconds: Vec<f64>,
    all: Accumulated,
}

impl<'a> Reduction<'a> {
    /// Of a piece whose values are multiplied with `seconds` of each step, where sums over a region are wanted.
    pub(super) fn of(question: &'a Question, piece: &'a Piece, seconds: Vec<f64>) -> Self {
        let is_of_region = matches!(question.wanted, Wanted::RegionSums { .. });
        let steps = piece.steps.len();
        let sums = match question.wanted {
            Wanted::Sums {
                with_squares,
                with_extremes,
            } => {
                let wanted = [with_squares, with_extremes];
                Some(Summing::new(steps, question.scale, wanted))
            }
            Wanted::Histograms { .. } | Wanted::RegionSums { .. } => None,
        };
        Self {
            seconds,
            question,
            piece,
            targets: piece.targets(&question.wanted),
            own_targets: (0..0, vec![]),
            sums,
            regions: vec![RegionStepSums::default(); if is_of_region { steps } else { 0 }],
            all: Accumulated::default(),
        }
    }

    /// Adds values whose summed steps are `steps` of the piece, counted from its first summed one.
    pub(super) fn add(
        &mut self,
        values: Values<'_>,
        cells: &CellShares,
        steps: Range<usize>,
    ) -> Result<(), ComputeError> {
        let refused = |e: OutOfRange| ComputeError::inconsistent(self.piece.key.as_str(), e);
        match (&self.question.wanted, cells) {
            (Wanted::Sums { .. }, CellShares::Weights(cells)) => match &mut self.sums {
                Some(sums) => sums.add(values, cells, steps).map_err(refused),
                None => Ok(()),
            },
            (Wanted::Histograms { ranges, .. }, CellShares::Weights(cells)) => {
                if self.own_targets.0 != steps {
                    let own = self.targets.iter().filter(|it| steps.contains(&it.step));
                    let own = own.map(|it| Target {
                        step: it.step - steps.start,
                        ranges: it.ranges.clone(),
                    });
                    let own = own.collect();
                    self.own_targets = (steps, own);
                }
                let own = &self.own_targets.1;
                let added = add_weights(values, cells, own, ranges, &mut self.all.histograms);
                added.ok_or_else(too_large)
            }
            (Wanted::RegionSums { .. }, CellShares::Areas(cells)) => {
                let (seconds, sums) = (&self.seconds[steps.clone()], &mut self.regions[steps]);
                let mut scratch = RegionScratch::new(seconds.len());
                scratch.add(values, cells, seconds, sums).map_err(refused)
            }
            _ => Err(ComputeError::inconsistent(
                self.piece.key.as_str(),
                "its cells are not what is summed",
            )),
        }
    }

    pub(super) fn accumulated(mut self) -> Accumulated {
        let first = self.piece.first_step + self.piece.steps.start;
        if let Some(sums) = self.sums {
            // Without extremes unless they are wanted: stored sums know none, and those of the rest would be some of all.
            let own = (first..).zip(sums.finish());
            self.all
                .steps
                .extend(own.filter(|(_, sums)| sums.count > 0));
        }
        self.all.regions.extend((first..).zip(self.regions));
        self.all
    }
}

impl Piece {
    /// Ranges that its steps add to.
    fn targets(&self, wanted: &Wanted) -> Vec<Target> {
        let Wanted::Histograms { steps, .. } = wanted else {
            return vec![];
        };
        let first = self.first_step + self.steps.start;
        let own = steps.range(first..self.first_step + self.steps.end);
        let target = |(step, ranges): (&u32, &Vec<(u32, i64)>)| Target {
            step: (step - first) as usize,
            ranges: ranges.clone(),
        };
        own.map(target).collect()
    }
}
