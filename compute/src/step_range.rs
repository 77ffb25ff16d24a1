//! Steps of a version that follow each other in, their places in it out.

use std::ops::Range;

use contract::manifest::{Manifest, Step};

use crate::ComputeError;

/// Where steps lie in their version.
///
/// # Errors
/// They are not of it, or do not follow each other.
pub(crate) fn step_range(
    manifest: &Manifest,
    steps: &[&Step],
) -> Result<Range<usize>, ComputeError> {
    let Some(first) = steps.first() else {
        return Ok(0..0);
    };
    let start = manifest.step_of(first.period).unwrap_or_default();
    let range = start..start + steps.len();
    let there = manifest.steps.get(range.clone()).unwrap_or_default();
    if there.len() == steps.len() && there.iter().zip(steps).all(|(a, b)| a.period == b.period) {
        Ok(range)
    } else {
        let what = manifest.product.to_string();
        Err(ComputeError::inconsistent(
            what,
            "steps that are asked for do not follow each other",
        ))
    }
}
