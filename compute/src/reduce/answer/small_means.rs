//! Bins of carbon that accumulates, summed in the scale of the quantity, in; those whose sums are so small that this scale does not tell their
//! means out, with scales that do.

use std::collections::BTreeSet;

use super::{Reduction, extremes_of};
use crate::ComputeError;
use crate::reduce::bins::BinSums;
use crate::reduce::question::Wanted;
use crate::reduce::scales::{Extremes, SmallBins, bins_below};

/// Up to so many steps are read by themselves, and beyond that along time with all others.
const FEW_STEPS: usize = 64;

impl Reduction<'_> {
    /// What accumulates begins with nothing: within the range of what it may come to, first sums are of some thousand steps. `steps_of` are the
    /// steps of each bin.
    pub(super) async fn small_means(
        &self,
        sums: &[BinSums],
        steps_of: &[Vec<u32>],
    ) -> Result<Vec<SmallBins>, ComputeError> {
        let is_told = |bin: &BinSums| {
            bin.sums.weight == 0 || self.scale.tells_mean(bin.sums.sum, bin.sums.weight)
        };
        let small =
            sums.iter().zip(steps_of).map(
                |(bin, steps)| {
                    if is_told(bin) { vec![] } else { steps.clone() }
                },
            );
        let small: Vec<Vec<u32>> = small.collect();
        let steps: BTreeSet<u32> = small.iter().flatten().copied().collect();
        let extremes = match steps.len() {
            0 => return Ok(vec![]),
            1..=FEW_STEPS => self.extremes_in(&steps).await?,
            _ => self.found_extremes().await?,
        };
        Ok(bins_below(self.scale.largest(), &extremes, &small))
    }

    /// Where the values of some steps lie.
    async fn extremes_in(&self, steps: &BTreeSet<u32>) -> Result<Extremes, ComputeError> {
        let wanted = Wanted::Sums {
            with_squares: false,
            with_extremes: true,
        };
        let fields = self.fields_alone(steps.iter().copied());
        let found = self.of_fields(self.question(self.scale, wanted), fields);
        Ok(extremes_of(&found.await?))
    }
}
