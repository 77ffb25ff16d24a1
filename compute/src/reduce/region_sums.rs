//! Exact sums of mass and area over a region and its sea: what budgets and means over regions are made of.
//!
//! Each cell's mass is rounded once to a step and summed as an integer, so that neither the order of cells nor how they are read
//! matters: the same bits from blocks along time and from chunks of single fields.

use std::collections::BTreeMap;

use super::bytes::Reader;
use super::values::Values;
use crate::budget::bands::{BAND_COUNT, BandSum};
use crate::budget::chunk::{AREA_STEPS_PER_M2, MASS_STEPS_PER_KG};
use crate::budget::fixed::{OutOfRange, to_steps};

/// What a cell has of a region.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct CellArea {
    /// Its share of the region, m².
    pub(super) whole_m2: f64,
    /// The sea in that, m².
    pub(super) sea_m2: f64,
    /// The band of latitude that it lies in.
    pub(super) band: u8,
}

/// Mass in steps of 10⁻⁹ kg and area in steps of 10⁻⁶ m².
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Sums {
    pub(super) mass: i128,
    pub(super) area: i128,
}

impl Sums {
    fn add(&mut self, other: Self) -> Option<()> {
        self.mass = self.mass.checked_add(other.mass)?;
        self.area = self.area.checked_add(other.area)?;
        Some(())
    }
}

/// Sums of one step over a region.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct RegionStepSums {
    pub(super) whole: Sums,
    /// The sea by bands that hold any.
    pub(super) sea: BTreeMap<u8, Sums>,
}

impl RegionStepSums {
    /// Mass, kg in steps of 10⁻⁹, and area with data, m² in steps of 10⁻⁶.
    pub(crate) fn whole(&self) -> [i128; 2] {
        [self.whole.mass, self.whole.area]
    }

    /// The same of the sea by bands that hold any, in their order.
    pub(crate) fn sea(&self) -> Vec<BandSum> {
        let of = |(band, sums): (&u8, &Sums)| BandSum {
            band: usize::from(*band),
            mass_steps: sums.mass,
            area_steps: sums.area,
        };
        self.sea.iter().map(of).collect()
    }

    /// Adds others. None if a sum leaves 128 bits.
    pub(super) fn merge(&mut self, other: &Self) -> Option<()> {
        self.whole.add(other.whole)?;
        for (band, sums) in &other.sea {
            self.sea.entry(*band).or_default().add(*sums)?;
        }
        Some(())
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        let put = |sums: &Sums, out: &mut Vec<u8>| {
            out.extend(sums.mass.to_le_bytes());
            out.extend(sums.area.to_le_bytes());
        };
        put(&self.whole, out);
        out.extend((self.sea.len() as u32).to_le_bytes());
        for (band, sums) in &self.sea {
            out.extend(u32::from(*band).to_le_bytes());
            put(sums, out);
        }
    }

    pub(super) fn read(reader: &mut Reader<'_>) -> Option<Self> {
        let sums = |reader: &mut Reader<'_>| {
            Some(Sums {
                mass: reader.i128()?,
                area: reader.i128()?,
            })
        };
        let mut own = Self {
            whole: sums(reader)?,
            sea: BTreeMap::new(),
        };
        for _ in 0..reader.u32()? {
            let band = u8::try_from(reader.u32()?).ok()?;
            if usize::from(band) >= BAND_COUNT {
                return None;
            }
            own.sea.insert(band, sums(reader)?);
        }
        Some(own)
    }
}

/// Sums of some steps while blocks are added: cells of one band first, which a block has one or two of.
#[derive(Debug)]
pub(super) struct RegionScratch {
    band: u8,
    /// Cells that are sea as far as they are the region's.
    both: Vec<Sums>,
    /// Other cells, all of them.
    whole: Vec<Sums>,
    /// The sea in those.
    sea: Vec<Sums>,
}

impl RegionScratch {
    pub(super) fn new(steps: usize) -> Self {
        let none = vec![Sums::default(); steps];
        Self {
            band: 0,
            both: none.clone(),
            whole: none.clone(),
            sea: none,
        }
    }

    /// Adds a block's cells to the sums of the steps that are summed, which last `seconds` each.
    ///
    /// # Errors
    /// A share of a cell that is beyond anything physical.
    pub(super) fn add(
        &mut self,
        block: Values<'_>,
        cells: &[CellArea],
        seconds: &[f64],
        out: &mut [RegionStepSums],
    ) -> Result<(), OutOfRange> {
        for (cell, own) in cells.iter().enumerate() {
            if own.whole_m2 == 0.0 && own.sea_m2 == 0.0 {
                continue;
            }
            if own.band != self.band {
                self.flush(out);
                self.band = own.band;
            }
            let values = block.steps(cell, seconds.len());
            // The same number where all of it is sea.
            if own.whole_m2.to_bits() == own.sea_m2.to_bits() {
                add_cell(values, own.whole_m2, seconds, &mut self.both)?;
            } else {
                add_cell(values, own.whole_m2, seconds, &mut self.whole)?;
                add_cell(values, own.sea_m2, seconds, &mut self.sea)?;
            }
        }
        self.flush(out);
        Ok(())
    }

    fn flush(&mut self, out: &mut [RegionStepSums]) {
        for (step, own) in out.iter_mut().enumerate() {
            let [both, whole, sea] = [&mut self.both, &mut self.whole, &mut self.sea]
                .map(|sums| std::mem::take(&mut sums[step]));
            // A block holds too little for a sum to leave 128 bits: each share is below 10^30.
            own.whole.mass += both.mass + whole.mass;
            own.whole.area += both.area + whole.area;
            if both.area + sea.area != 0 {
                let band = own.sea.entry(self.band).or_default();
                band.mass += both.mass + sea.mass;
                band.area += both.area + sea.area;
            }
        }
    }
}

fn add_cell(
    values: &[f32],
    area_m2: f64,
    seconds: &[f64],
    sums: &mut [Sums],
) -> Result<(), OutOfRange> {
    if area_m2 == 0.0 {
        return Ok(());
    }
    let area = to_steps(area_m2 * AREA_STEPS_PER_M2)?;
    for ((value, seconds), sums) in values.iter().zip(seconds).zip(sums) {
        if !value.is_nan() {
            sums.mass += to_steps(f64::from(*value) * area_m2 * seconds * MASS_STEPS_PER_KG)?;
            sums.area += area;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::chunk::chunk_sums;

    const STEPS: usize = 5;

    fn cells() -> Vec<CellArea> {
        let cell = |at: usize| CellArea {
            whole_m2: if at.is_multiple_of(5) {
                0.0
            } else {
                1e9 + at as f64
            },
            sea_m2: match at % 5 {
                0 => 0.0,
                1 => 3e8,
                _ => 1e9 + at as f64,
            },
            band: (7 + at / 9) as u8,
        };
        (0..20).map(cell).collect()
    }

    fn value(at: usize) -> f32 {
        match at % 7 {
            3 => f32::NAN,
            _ => ((at * 7919 % 1009) as f32 - 504.0) * 1.7e-11,
        }
    }

    fn sums(order: &[usize]) -> Vec<RegionStepSums> {
        let (cells, seconds) = (cells(), [86_400.0, 7e5, 1.0]);
        let runs = order
            .iter()
            .flat_map(|cell| (0..STEPS).map(move |step| value(cell * STEPS + step)));
        let values: Vec<f32> = runs.collect();
        let own: Vec<CellArea> = order.iter().map(|cell| cells[*cell]).collect();
        let block = Values {
            of: &values,
            step_count: STEPS,
            first: 1,
        };
        let mut out = vec![RegionStepSums::default(); 3];
        let mut scratch = RegionScratch::new(3);
        scratch.add(block, &own, &seconds, &mut out).unwrap();
        out
    }

    #[test]
    fn sums_of_blocks_are_those_of_chunks_band_by_band() {
        let order: Vec<usize> = (0..20).collect();
        let found = sums(&order);
        for (step, own) in found.iter().enumerate() {
            let seconds = [86_400.0, 7e5, 1.0][step];
            let of = |band: Option<u8>, area: &dyn Fn(&CellArea) -> f64| {
                let held: Vec<(f32, f64)> = cells()
                    .iter()
                    .enumerate()
                    .filter(|(_, cell)| band.is_none_or(|band| band == cell.band))
                    .map(|(at, cell)| (value(at * STEPS + 1 + step), area(cell)))
                    .collect();
                let (values, areas): (Vec<f32>, Vec<f64>) = held.into_iter().unzip();
                let sums = chunk_sums(&values, &areas, seconds).unwrap();
                [sums.mass_steps, sums.area_steps]
            };
            assert_eq!(own.whole(), of(None, &|cell| cell.whole_m2));
            for sum in own.sea() {
                let expected = of(Some(sum.band as u8), &|cell| cell.sea_m2);
                assert_eq!([sum.mass_steps, sum.area_steps], expected, "{}", sum.band);
            }
            let bands: Vec<usize> = own.sea().iter().map(|sum| sum.band).collect();
            assert_eq!(bands, [7, 8, 9]);
        }
        let turned: Vec<usize> = order.iter().map(|cell| (cell + 7) % 20).collect();
        assert_eq!(sums(&turned), found);
    }

    #[test]
    fn bytes_lead_back_and_a_band_that_is_none_is_refused() {
        let mut own = sums(&[1, 2, 3, 11]).pop().unwrap();
        let mut bytes = vec![];
        own.write(&mut bytes);
        let mut reader = Reader::new(&bytes);
        assert_eq!(RegionStepSums::read(&mut reader), Some(own.clone()));
        assert!(reader.is_empty());
        assert!(RegionStepSums::read(&mut Reader::new(&bytes[1..])).is_none());
        own.sea.insert(36, Sums::default());
        bytes.clear();
        own.write(&mut bytes);
        assert!(RegionStepSums::read(&mut Reader::new(&bytes)).is_none());
    }

    #[test]
    fn what_is_beyond_anything_physical_is_refused() {
        let cells = [CellArea {
            whole_m2: 1e9,
            sea_m2: 1e9,
            band: 0,
        }];
        for bad in [f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            let block = Values {
                of: &[bad],
                step_count: 1,
                first: 0,
            };
            let mut out = vec![RegionStepSums::default()];
            let mut scratch = RegionScratch::new(1);
            assert!(
                scratch.add(block, &cells, &[1e9], &mut out).is_err(),
                "{bad}"
            );
        }
    }
}
