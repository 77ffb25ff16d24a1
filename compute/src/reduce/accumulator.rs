//! What tasks give back: sums of steps as integers, extremes, and weights by ranges of values. Merged in any order they are the
//! same.

use std::collections::BTreeMap;

use super::bytes::Reader;
use super::histogram::Histograms;
use super::region_sums::RegionStepSums;
use crate::ComputeError;

/// Sums of the values of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StepSums {
    /// Values that are there.
    pub(super) count: u64,
    /// Their weight.
    pub(super) weight: i128,
    /// The weight that coverage counts.
    pub(super) covered: i128,
    /// Weight x value, in steps of the scale.
    pub(super) sum: i128,
    /// Weight x its square.
    pub(super) squares: i128,
    /// Smallest value; infinite without any.
    pub(super) min: f32,
    /// Largest value; negative and infinite without any.
    pub(super) max: f32,
}

impl Default for StepSums {
    fn default() -> Self {
        Self {
            count: 0,
            weight: 0,
            covered: 0,
            sum: 0,
            squares: 0,
            min: f32::INFINITY,
            max: f32::NEG_INFINITY,
        }
    }
}

/// Bytes of a step's sums as they pass from process to process, its index included.
const STEP_BYTES: usize = 4 + 8 + 4 * 16 + 2 * 4;

impl StepSums {
    /// Adds others. None if a sum leaves 128 bits.
    pub(super) fn merge(&mut self, other: &Self) -> Option<()> {
        self.count = self.count.checked_add(other.count)?;
        for (own, more) in [
            (&mut self.weight, other.weight),
            (&mut self.covered, other.covered),
            (&mut self.sum, other.sum),
            (&mut self.squares, other.squares),
        ] {
            *own = own.checked_add(more)?;
        }
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        Some(())
    }
}

/// What a task, or several, have accumulated.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Accumulated {
    /// Sums by the index of the step, of steps with data.
    pub(super) steps: BTreeMap<u32, StepSums>,
    /// Weights by ranges of values.
    pub(super) histograms: Histograms,
    /// Sums over a region by the index of the step.
    pub(super) regions: BTreeMap<u32, RegionStepSums>,
}

impl Accumulated {
    /// Adds what others have accumulated.
    ///
    /// # Errors
    /// A sum leaves 128 bits.
    pub(crate) fn merge(&mut self, other: Self) -> Result<(), ComputeError> {
        for (step, sums) in other.steps {
            let own = self.steps.entry(step).or_default();
            own.merge(&sums).ok_or_else(too_large)?;
        }
        for (step, sums) in other.regions {
            let own = self.regions.entry(step).or_default();
            own.merge(&sums).ok_or_else(too_large)?;
        }
        self.histograms
            .merge(other.histograms)
            .ok_or_else(too_large)
    }

    /// As it passes from process to process.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(4 + self.steps.len() * STEP_BYTES);
        out.extend((self.steps.len() as u32).to_le_bytes());
        for (step, sums) in &self.steps {
            out.extend(step.to_le_bytes());
            out.extend(sums.count.to_le_bytes());
            for sum in [sums.weight, sums.covered, sums.sum, sums.squares] {
                out.extend(sum.to_le_bytes());
            }
            out.extend(sums.min.to_le_bytes());
            out.extend(sums.max.to_le_bytes());
        }
        self.histograms.write(&mut out);
        out.extend((self.regions.len() as u32).to_le_bytes());
        for (step, sums) in &self.regions {
            out.extend(step.to_le_bytes());
            sums.write(&mut out);
        }
        out
    }

    /// The same back.
    ///
    /// # Errors
    /// These are no such bytes.
    pub(crate) fn of_bytes(bytes: &[u8]) -> Result<Self, ComputeError> {
        let mut all = Self::default();
        all.merge_bytes(bytes)?;
        Ok(all)
    }

    /// Adds what others have accumulated, as it passes from process to process.
    ///
    /// # Errors
    /// These are no such bytes, or a sum leaves 128 bits; what was there is lost.
    pub(crate) fn merge_bytes(&mut self, bytes: &[u8]) -> Result<(), ComputeError> {
        self.merge_from(&mut Reader::new(bytes)).ok_or_else(|| {
            ComputeError::inconsistent(
                "accumulated sums",
                "they are cut off, or a sum exceeds 128 bits: ask for a shorter period",
            )
        })
    }

    fn merge_from(&mut self, reader: &mut Reader<'_>) -> Option<()> {
        for _ in 0..reader.u32()? {
            let step = reader.u32()?;
            let sums = StepSums {
                count: reader.u64()?,
                weight: reader.i128()?,
                covered: reader.i128()?,
                sum: reader.i128()?,
                squares: reader.i128()?,
                min: f32::from_bits(reader.u32()?),
                max: f32::from_bits(reader.u32()?),
            };
            self.steps.entry(step).or_default().merge(&sums)?;
        }
        self.histograms.merge_written(reader)?;
        for _ in 0..reader.u32()? {
            let step = reader.u32()?;
            let sums = RegionStepSums::read(reader)?;
            self.regions.entry(step).or_default().merge(&sums)?;
        }
        reader.is_empty().then_some(())
    }
}

pub(super) fn too_large() -> ComputeError {
    ComputeError::inconsistent(
        "statistics",
        "a sum exceeds 128 bits: ask for a shorter period",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some(step: u32, sum: i128) -> Accumulated {
        let sums = StepSums {
            count: 3,
            weight: 1 << 70,
            covered: 7,
            sum,
            squares: sum * sum,
            min: -1.5,
            max: sum as f32,
        };
        Accumulated {
            steps: BTreeMap::from([(step, sums)]),
            histograms: Histograms::default(),
            regions: BTreeMap::new(),
        }
    }

    #[test]
    fn what_is_merged_in_any_order_is_the_same() {
        let parts = [some(1, 5), some(2, -9), some(1, 11), some(1, -2)];
        let merged = |order: [usize; 4]| {
            let mut all = Accumulated::default();
            for at in order {
                all.merge(parts[at].clone()).unwrap();
            }
            all
        };
        let all = merged([0, 1, 2, 3]);
        assert_eq!(all.steps[&1].sum, 14);
        assert_eq!(all.steps[&1].max.to_bits(), 11f32.to_bits());
        assert_eq!(merged([3, 1, 0, 2]), all);
        let mut planted = all.clone();
        planted.steps.get_mut(&2).unwrap().sum += 1;
        assert_ne!(planted, all);
    }

    #[test]
    fn bytes_lead_back_and_shorter_ones_are_refused() {
        let mut all = some(4, -77);
        all.merge(some(9, 1 << 60)).unwrap();
        let bytes = all.to_bytes();
        assert_eq!(Accumulated::of_bytes(&bytes).unwrap(), all);
        let mut other = some(4, 3);
        other.merge_bytes(&bytes).unwrap();
        let mut merged = some(4, 3);
        merged.merge(all.clone()).unwrap();
        assert_eq!(other, merged);
        assert!(Accumulated::of_bytes(&bytes[..bytes.len() - 1]).is_err());
        assert!(Accumulated::of_bytes(&[&bytes[..], &[0]].concat()).is_err());
    }

    #[test]
    fn a_sum_that_leaves_its_bits_is_an_error() {
        let mut all = some(1, 1);
        all.steps.get_mut(&1).unwrap().sum = i128::MAX;
        assert!(all.merge(some(1, 1)).is_err());
    }
}
