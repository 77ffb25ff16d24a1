//! Some cells of a map, `[row, col]`: a set of their numbers, compressed.

use std::ops::Range;

use roaring::RoaringBitmap;

/// Cells that are a byte of bits.
const BYTE_BITS: usize = 8;

/// Some cells of a map, `[row, col]`. Equal sets are equal, whichever way they were made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cells {
    pub(super) set: RoaringBitmap,
    pub(super) count: usize,
}

impl Cells {
    /// None of so many cells, 2³¹ at most.
    pub fn none(count: usize) -> Self {
        Self {
            set: RoaringBitmap::new(),
            count,
        }
    }

    /// Those of a map with a flag a cell that is true.
    pub fn of(flags: &[bool]) -> Self {
        let mut cells = Self::none(flags.len());
        cells.add_where(0, flags, |flag| *flag);
        cells
    }

    /// Cells of the map.
    pub fn map_count(&self) -> usize {
        self.count
    }

    /// Is there any?
    pub fn is_any(&self) -> bool {
        !self.set.is_empty()
    }

    /// Is it one of them? A search: of many cells side by side [`Self::flags`] tells it sooner.
    ///
    /// # Panics
    /// The map has no such cell.
    pub fn has(&self, cell: usize) -> bool {
        self.check(cell..cell + 1);
        self.set.contains(cell as u32)
    }

    /// How many of the cells of a range are of them.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn count_in(&self, cells: Range<usize>) -> usize {
        self.check(cells.clone());
        self.set
            .range_cardinality(cells.start as u32..cells.end as u32) as usize
    }

    /// All of them, ascending.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = usize> + '_ {
        self.set.iter().map(|cell| cell as usize)
    }

    /// Those of a range, ascending.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn within(&self, cells: Range<usize>) -> impl DoubleEndedIterator<Item = usize> + '_ {
        self.check(cells.clone());
        let own = self.set.range(cells.start as u32..cells.end as u32);
        own.map(|cell| cell as usize)
    }

    /// Those of a range, as ranges of cells side by side, ascending; two of them may touch.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn runs(&self, cells: Range<usize>) -> impl Iterator<Item = Range<usize>> + '_ {
        self.check(cells.clone());
        let mut own = self.set.range(cells.start as u32..cells.end as u32);
        std::iter::from_fn(move || {
            let run = own.next_range()?;
            Some(*run.start() as usize..*run.end() as usize + 1)
        })
    }

    /// Of each cell of a range whether it is one of them.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn flags(&self, cells: Range<usize>) -> Vec<bool> {
        let first = cells.start;
        let mut flags = vec![false; cells.len()];
        for run in self.runs(cells) {
            flags[run.start - first..run.end - first].fill(true);
        }
        flags
    }

    /// Adds one.
    ///
    /// # Panics
    /// The map has no such cell.
    pub fn insert(&mut self, cell: usize) {
        self.check(cell..cell + 1);
        self.set.insert(cell as u32);
    }

    /// Adds those of the cells from `first` on that hold a value; NaN is none.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn add_valued(&mut self, first: usize, values: &[f32]) {
        self.add_where(first, values, |value| !value.is_nan());
    }

    /// Adds those of the cells from `first` on for which it holds of what is told of each.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn add_where<T>(&mut self, first: usize, of_cells: &[T], is_one: impl Fn(&T) -> bool) {
        self.check(first..first + of_cells.len());
        self.unpack();
        self.set |= set_of(first, of_cells, is_one);
    }

    /// Takes those of the cells from `first` on away that hold a value.
    ///
    /// # Panics
    /// The map has not so many.
    pub fn remove_valued(&mut self, first: usize, values: &[f32]) {
        self.check(first..first + values.len());
        self.unpack();
        self.set -= set_of(first, values, |value| !value.is_nan());
    }

    /// Adds others of the same map.
    ///
    /// # Panics
    /// They are of a larger one.
    pub fn add(&mut self, others: &Self) {
        assert!(others.count <= self.count, "cells of a larger map");
        self.unpack();
        self.set |= &others.set;
    }

    /// Takes others of the same map away.
    pub fn remove(&mut self, others: &Self) {
        self.unpack();
        self.set -= &others.set;
    }

    /// What was read lies in runs, which are small, and slow to change cell by cell: as bits they are quick.
    fn unpack(&mut self) {
        self.set.remove_run_compression();
    }

    fn check(&self, cells: Range<usize>) {
        let count = self.count;
        assert!(cells.end <= count, "cells {cells:?} of a map of {count}");
    }
}

/// The cells from `first` on for which it holds.
pub(super) fn set_of<T>(
    first: usize,
    of_cells: &[T],
    is_one: impl Fn(&T) -> bool,
) -> RoaringBitmap {
    let byte = |own: &[T]| {
        let bits = own.iter().enumerate();
        bits.fold(0, |byte, (at, one)| byte | u8::from(is_one(one)) << at)
    };
    // Of so many at a time the compiler makes a few instructions.
    let (whole, rest) = of_cells.as_chunks::<BYTE_BITS>();
    let whole = whole.iter().map(|own| byte(own));
    let rest = (!rest.is_empty()).then(|| byte(rest));
    let bytes: Vec<u8> = whole.chain(rest).collect();
    RoaringBitmap::from_lsb0_bytes(first as u32, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of more than one container of 2^16 cells, some of its places dense, some sparse, some whole.
    const COUNT: usize = 200_003;

    fn is_some(cell: usize) -> bool {
        match cell {
            0..60_000 => cell.is_multiple_of(3) || cell.is_multiple_of(7),
            60_000..65_530 => false,
            65_530..140_000 => !cell.is_multiple_of(997),
            _ => cell.is_multiple_of(61) || cell == COUNT - 1,
        }
    }

    fn value(cell: usize) -> f32 {
        if is_some(cell) { 1.0 } else { f32::NAN }
    }

    fn values(cells: Range<usize>) -> Vec<f32> {
        cells.map(value).collect()
    }

    /// The same cells as they lie in memory after bands, and as after they were read.
    fn both() -> [Cells; 2] {
        let mut cells = Cells::none(COUNT);
        for first in [130_001, 0, 65_536] {
            cells.add_valued(first, &values(first..COUNT.min(first + 70_003)));
        }
        let mut read = cells.clone();
        read.set.optimize();
        [cells, read]
    }

    #[test]
    fn every_view_of_cells_is_that_of_their_flags() {
        let flags: Vec<bool> = (0..COUNT).map(is_some).collect();
        let ranges = [
            0..COUNT,
            0..0,
            63..65,
            1..130,
            65_529..65_531,
            65_535..65_537,
            65_536..131_072,
            70_000..70_001,
            59_990..139_999,
            COUNT - 1..COUNT,
            COUNT..COUNT,
        ];
        let steps = (0..COUNT - 400).step_by(977);
        let many = steps.flat_map(|first| [1, 64, 399].map(|length| first..first + length));
        let ranges: Vec<_> = ranges.into_iter().chain(many).collect();
        for cells in both() {
            assert_eq!(cells, Cells::of(&flags));
            assert!(cells.is_any() && !Cells::none(COUNT).is_any());
            let all: Vec<usize> = (0..COUNT).filter(|cell| is_some(*cell)).collect();
            assert_eq!(cells.iter().collect::<Vec<_>>(), all);
            for range in &ranges {
                let own: Vec<usize> = range.clone().filter(|cell| is_some(*cell)).collect();
                assert_eq!(cells.count_in(range.clone()), own.len(), "{range:?}");
                let mut back: Vec<usize> = cells.within(range.clone()).rev().collect();
                back.reverse();
                assert_eq!(back, own, "{range:?}");
                let runs = cells.runs(range.clone()).flatten();
                assert_eq!(runs.collect::<Vec<_>>(), own, "{range:?}");
                assert_eq!(cells.flags(range.clone()), flags[range.clone()]);
            }
            for cell in [0, 1, 65_535, 65_536, 139_999, COUNT - 1] {
                assert_eq!(cells.has(cell), is_some(cell), "{cell}");
            }
        }
    }

    #[test]
    fn what_holds_a_value_comes_and_goes_in_any_bands() {
        for cells in both() {
            let mut rest = cells.clone();
            rest.remove_valued(0, &values(0..70_001));
            assert_eq!(rest.iter().next(), Some(70_001));
            let mut gone = cells.clone();
            gone.remove(&rest);
            assert_eq!(gone.iter().next_back(), Some(70_000));
            gone.add(&rest);
            assert_eq!(gone, cells);
            // A row of a window, at a place that is no multiple of 8.
            rest.remove_valued(70_003, &[1.0, f32::NAN, 1.0]);
            let around = [70_002, 70_003, 70_004, 70_005, 70_006];
            assert_eq!(
                around.map(|cell| rest.has(cell)),
                [true, false, true, false, true]
            );
            rest.remove_valued(0, &vec![0.0; COUNT]);
            assert_eq!(rest, Cells::none(COUNT));
            rest.insert(COUNT - 1);
            assert_eq!(rest.iter().collect::<Vec<_>>(), [COUNT - 1]);
        }
    }

    #[test]
    fn a_cell_beyond_the_map_is_nobodys() {
        let beyond: [fn(&mut Cells); 4] = [
            |cells| cells.insert(10),
            |cells| cells.add_valued(8, &[f32::NAN; 3]),
            |cells| drop(cells.flags(0..11)),
            |cells| cells.add(&Cells::none(11)),
        ];
        for beyond in beyond {
            let tried = std::panic::catch_unwind(|| beyond(&mut Cells::none(10)));
            assert!(tried.is_err());
        }
    }
}
