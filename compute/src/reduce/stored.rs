//! Stored sums of blocks and weights of coverage in, sums of the steps of a run of blocks out: the same integers that the values
//! would be summed to.

use std::collections::BTreeSet;

use cube::{BLOCK_CELLS, Numbers, Piece as InRun, Record};

use super::accumulator::StepSums;
use super::cells::CellWeight;
use super::inside::InsideRun;

/// What a record is read for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Use {
    /// Sums up to the last block of a run.
    UpTo,
    /// What lies west of its first block.
    West,
    /// Which cells of a block on the coast hold data.
    Coast,
}

/// A record that is read.
#[derive(Debug, Clone, Copy)]
struct Term {
    block: u32,
    /// Which run of blocks it is read for.
    run: usize,
    of: Use,
}

/// Records that runs of blocks are made of.
#[derive(Debug)]
pub(super) struct Terms(Vec<Term>);

impl Terms {
    /// Those of some runs of blocks; `across` are blocks in a row of the grid, `shard_cols` those in a shard.
    pub(super) fn of(runs: &[InsideRun], across: u32, shard_cols: u32) -> Self {
        let mut terms = vec![];
        for (number, run) in runs.iter().enumerate() {
            let mut put = |block: u32, of: Use| {
                let run = number;
                terms.push(Term { block, run, of });
            };
            // First the one that tells whether there are sums.
            put(run.last, Use::UpTo);
            if !(run.first % across).is_multiple_of(shard_cols) {
                put(run.first - 1, Use::West);
            }
            for block in &run.coast {
                put(*block, Use::Coast);
            }
        }
        Self(terms)
    }

    /// Numbers of the blocks whose records are read.
    pub(super) fn blocks(&self) -> impl Iterator<Item = u32> {
        self.0.iter().map(|term| term.block)
    }
}

/// Sums of some steps while records are added, in the order of their terms.
#[derive(Debug)]
pub(super) struct Stored<'a> {
    terms: &'a Terms,
    /// Where the steps lie in the run of steps.
    steps: &'a [InRun],
    with_squares: bool,
    sums: Vec<Signed>,
    /// Runs of blocks that hold values which cannot be summed.
    unsummed: BTreeSet<usize>,
}

/// Sums of a step.
#[derive(Debug, Clone, Copy, Default)]
struct Signed {
    count: i64,
    weight: i128,
    covered: i128,
    sum: i128,
    squares: i128,
}

impl<'a> Stored<'a> {
    pub(super) fn new(terms: &'a Terms, steps: &'a [InRun], with_squares: bool) -> Self {
        let count = steps.iter().map(|own| own.asked + own.count).max();
        Self {
            terms,
            steps,
            with_squares,
            sums: vec![Signed::default(); count.unwrap_or(0)],
            unsummed: BTreeSet::new(),
        }
    }

    /// What is needed of the record of a term.
    pub(super) fn wanted(&self) -> impl Fn(usize) -> Numbers + use<'a> {
        let (terms, with_squares) = (self.terms, self.with_squares);
        move |term| match terms.0[term].of {
            Use::Coast => Numbers::Valid,
            Use::UpTo | Use::West if with_squares => Numbers::SumsAndSquares,
            Use::UpTo | Use::West => Numbers::Sums,
        }
    }

    /// Adds the record of a term; `cells` gives the weights of a block's cells, 8 x 8.
    pub(super) fn add(
        &mut self,
        term: usize,
        record: &Record,
        cells: impl Fn(u32) -> Vec<CellWeight>,
    ) {
        let Term { block, run, of } = self.terms.0[term];
        if of == Use::UpTo && !record.is_summed {
            self.unsummed.insert(run);
        }
        if self.unsummed.contains(&run) {
            return;
        }
        match of {
            Use::UpTo => self.add_sums(record, 1),
            Use::West => self.add_sums(record, -1),
            Use::Coast => self.add_coast(record, &cells(block)),
        }
    }

    fn add_sums(&mut self, record: &Record, sign: i8) {
        let (sign, wide) = (i64::from(sign), i128::from(sign));
        for piece in self.steps {
            let own = &mut self.sums[piece.asked..piece.asked + piece.count];
            for (own, at) in own.iter_mut().zip(piece.in_run..) {
                let weight = i128::from(record.weights[at]) * wide;
                own.count += i64::from(record.counts[at]) * sign;
                own.weight += weight;
                own.covered += weight;
                own.sum += record.sums[at] * wide;
                if self.with_squares {
                    own.squares += record.squares[at] * wide;
                }
            }
        }
    }

    /// Coverage counts other weights there than sums do.
    fn add_coast(&mut self, record: &Record, cells: &[CellWeight]) {
        debug_assert_eq!(cells.len(), (BLOCK_CELLS * BLOCK_CELLS) as usize);
        let difference = |valid: u64| {
            let held = cells.iter().enumerate();
            let held = held.filter(|(cell, _)| valid >> cell & 1 == 1);
            held.map(|(_, own)| i128::from(own.covered) - i128::from(own.weight))
                .sum::<i128>()
        };
        // Mostly they are the same cells at every step.
        let mut last = (0, 0);
        for piece in self.steps {
            let own = &mut self.sums[piece.asked..piece.asked + piece.count];
            for (own, valid) in own.iter_mut().zip(&record.valid[piece.in_run..]) {
                if *valid != last.0 {
                    last = (*valid, difference(*valid));
                }
                own.covered += last.1;
            }
        }
    }

    /// Sums of all steps, and the numbers of the runs of blocks whose values have to be read.
    pub(super) fn finish(self) -> (Vec<StepSums>, BTreeSet<usize>) {
        let sums = self.sums.iter().map(|own| StepSums {
            count: own.count.unsigned_abs(),
            weight: own.weight,
            covered: own.covered,
            sum: own.sum,
            squares: own.squares,
            ..StepSums::default()
        });
        (sums.collect(), self.unsummed)
    }
}
