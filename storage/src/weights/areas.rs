//! Areas of the cells of a chunk in, the same in little memory out: equal neighbours are one run, and chunks that are the same are held
//! once. The sea of a chunk is a run a row, and a coast a few.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

/// Areas of the cells of a chunk, row-major, m²: those that went in, bit for bit. Clones share them, and so do chunks side by side in the sea.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedAreas(Arc<Runs>);

/// Runs of neighbours of the same area.
#[derive(Debug, PartialEq)]
struct Runs {
    /// The area of a cell of each run.
    areas_m2: Box<[f64]>,
    /// Number of the cell behind each run; nothing where every cell is a run, which takes less where neighbours differ.
    ends: Box<[u32]>,
}

/// Bytes of a run.
const RUN_BYTES: usize = size_of::<f64>() + size_of::<u32>();

impl Runs {
    fn of(areas_m2: &[f64]) -> Self {
        let runs = || areas_m2.chunk_by(|a, b| a.to_bits() == b.to_bits());
        if runs().count() * RUN_BYTES >= size_of_val(areas_m2) {
            return Self {
                areas_m2: areas_m2.into(),
                ends: Box::default(),
            };
        }
        let ends = runs().scan(0, |end, run| {
            *end += run.len() as u32;
            Some(*end)
        });
        Self {
            areas_m2: runs().map(|run| run[0]).collect(),
            ends: ends.collect(),
        }
    }

    /// Number of the cell behind a run.
    fn end(&self, run: usize) -> usize {
        self.ends.get(run).map_or(run + 1, |end| *end as usize)
    }

    /// The run that a cell is in.
    fn run_of(&self, cell: usize) -> usize {
        if self.ends.is_empty() {
            cell
        } else {
            self.ends.partition_point(|end| *end as usize <= cell)
        }
    }

    fn is_bit_for_bit(&self, other: &Self) -> bool {
        let are_same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        self.areas_m2.len() == other.areas_m2.len()
            && self.ends == other.ends
            && self.areas_m2.iter().zip(&other.areas_m2).all(are_same)
    }
}

impl SharedAreas {
    /// Cells of the chunk.
    pub fn cell_count(&self) -> usize {
        match self.0.areas_m2.len() {
            0 => 0,
            runs => self.0.end(runs - 1),
        }
    }

    /// Runs of equal neighbours among some cells, in their order, and the area of each cell of them. Cells that the chunk has not are left out.
    pub fn runs(&self, cells: Range<usize>) -> impl Iterator<Item = (Range<usize>, f64)> + '_ {
        let own = &*self.0;
        let mut start = cells.start;
        let runs = own.run_of(start)..own.areas_m2.len();
        runs.map_while(move |run| {
            let end = own.end(run).min(cells.end);
            let inside = start..end;
            start = end;
            (!inside.is_empty()).then(|| (inside, own.areas_m2[run]))
        })
    }

    /// The area of every cell.
    pub fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        let runs = self.runs(0..self.cell_count());
        runs.flat_map(|(cells, area_m2)| std::iter::repeat_n(area_m2, cells.len()))
    }

    /// The same, laid out.
    pub fn to_vec(&self) -> Vec<f64> {
        let mut all = Vec::with_capacity(self.cell_count());
        for (cells, area_m2) in self.runs(0..self.cell_count()) {
            all.resize(cells.end, area_m2);
        }
        all
    }

    /// Memory that they take, however many share them, bytes.
    pub fn size_bytes(&self) -> u64 {
        (size_of_val(&*self.0.areas_m2) + size_of_val(&*self.0.ends)) as u64
    }

    /// Where they are held: the same of all that share them, and of no others.
    pub fn address(&self) -> usize {
        Arc::as_ptr(&self.0).addr()
    }
}

impl From<&[f64]> for SharedAreas {
    fn from(areas_m2: &[f64]) -> Self {
        Self(Arc::new(Runs::of(areas_m2)))
    }
}

impl From<Vec<f64>> for SharedAreas {
    fn from(areas_m2: Vec<f64>) -> Self {
        areas_m2.as_slice().into()
    }
}

impl<'a> From<&'a SharedAreas> for Cow<'a, [f64]> {
    fn from(areas: &'a SharedAreas) -> Self {
        Self::Owned(areas.to_vec())
    }
}

/// Areas that are held once, however many chunks have them.
#[derive(Debug, Default)]
pub struct Sharing {
    /// The last ones that differ from each other.
    last: VecDeque<SharedAreas>,
    distinct_bytes: u64,
}

impl Sharing {
    /// Areas that are compared with: along a row of chunks the sea's, and those of a few coasts.
    const COMPARED: usize = 8;

    /// The same areas, of which others have a part if they were there just before.
    pub fn of(&mut self, areas_m2: &[f64]) -> SharedAreas {
        let own = SharedAreas::from(areas_m2);
        let mut last = self.last.iter().rev();
        if let Some(known) = last.find(|known| known.0.is_bit_for_bit(&own.0)) {
            return known.clone();
        }
        self.distinct_bytes += own.size_bytes();
        if self.last.len() == Self::COMPARED {
            self.last.pop_front();
        }
        self.last.push_back(own.clone());
        own
    }

    /// What the areas take that are held, bytes.
    pub fn distinct_bytes(&self) -> u64 {
        self.distinct_bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chunk of the sea: each row has an area of its own.
    fn sea() -> Vec<f64> {
        (0..7200).map(|cell| f64::from(cell / 120)).collect()
    }

    /// A chunk of a coast: land, five cells that it cuts, and the sea.
    fn coast() -> Vec<f64> {
        let cell = |cell: u32| {
            let (row, col) = (cell / 120, cell % 120);
            let shore = 30 + row % 7;
            match col {
                _ if col < shore => 0.0,
                _ if col < shore + 5 => 0.01 * f64::from(cell),
                _ => 1e6 + f64::from(row),
            }
        };
        (0..7200).map(cell).collect()
    }

    fn bits(areas_m2: impl Iterator<Item = f64>) -> Vec<u64> {
        areas_m2.map(f64::to_bits).collect()
    }

    #[test]
    fn areas_come_back_bit_for_bit_whole_and_in_parts() {
        let all_differ: Vec<f64> = (0..500).map(|cell| f64::from(cell) * 0.1).collect();
        let odd = vec![0.0, 0.0, -0.0, f64::NAN, f64::NAN, 5.0, 5.0, 5.0, 5.0];
        for own in [vec![], vec![1.5], odd, all_differ, sea(), coast()] {
            let shared = SharedAreas::from(&own[..]);
            let wanted = bits(own.iter().copied());
            assert_eq!(shared.cell_count(), own.len());
            assert_eq!(bits(shared.iter()), wanted);
            assert_eq!(bits(shared.to_vec().into_iter()), wanted);
            for part in [0..0, 0..1, 1..3, 2..9, 119..241, 7190..9000, 8000..8001] {
                let held = part.start.min(own.len())..part.end.min(own.len());
                let found: Vec<u64> = shared
                    .runs(part.clone())
                    .flat_map(|(cells, area_m2)| cells.map(move |_cell| area_m2.to_bits()))
                    .collect();
                assert_eq!(found, wanted[held.clone()], "{part:?}");
                let cells = shared.runs(part.clone()).flat_map(|(cells, _)| cells);
                assert!(cells.eq(held), "{part:?}");
            }
        }
    }

    #[test]
    fn the_sea_and_its_coasts_take_a_small_part_of_a_number_a_cell_and_nothing_takes_more() {
        let cells = 7200 * 8;
        assert!(SharedAreas::from(sea()).size_bytes() * 75 < cells);
        assert!(SharedAreas::from(coast()).size_bytes() * 10 < cells);
        let all_differ: Vec<f64> = (0..7200).map(f64::from).collect();
        assert_eq!(SharedAreas::from(all_differ).size_bytes(), cells);
    }

    #[test]
    fn equal_areas_are_held_once() {
        let mut sharing = Sharing::default();
        let all: Vec<SharedAreas> = (0..200)
            .map(|n| sharing.of(&if n % 5 == 3 { coast() } else { sea() }))
            .collect();
        assert_eq!(all[0].address(), all[199].address());
        assert_eq!(all[3].address(), all[8].address());
        assert_ne!(all[0].address(), all[3].address());
        let distinct = all[0].size_bytes() + all[3].size_bytes();
        assert_eq!(sharing.distinct_bytes(), distinct);
        // No zero is held for another one.
        let zeros = [sharing.of(&[0.0]), sharing.of(&[-0.0])];
        assert_ne!(
            zeros[0].to_vec()[0].to_bits(),
            zeros[1].to_vec()[0].to_bits()
        );
    }
}
