//! Error against the number of slices: a job and a scene in, a row a number of slices out.

use contract::job::RenderJob;
use render::{Renderer, Scene};
use serde::Serialize;

use super::difference::Difference;
use super::error::ProofError;
use super::reference::{Fineness, Picture, reference};

/// How far a picture of so many slices is from the reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct QualityRow {
    /// Half-angle slices.
    pub slices: u32,
    /// From the reference.
    #[serde(flatten)]
    pub difference: Difference,
}

/// Draws a job with every number of slices and compares it with its reference. Blocks.
///
/// # Errors
/// What drawing or the reference refuses.
pub fn against_slices(
    renderer: &Renderer,
    job: &RenderJob,
    scene: &Scene,
    slices: &[u32],
) -> Result<Vec<QualityRow>, ProofError> {
    let truth = reference(job, scene, Fineness::default())?;
    let row = |&slices: &u32| {
        let mut job = job.clone();
        job.style.slices = slices;
        let picture = Picture::from(&renderer.render(&job, scene)?);
        let difference =
            Difference::of(&picture, &truth).expect("both have the size that the job asks for");
        Ok(QualityRow { slices, difference })
    };
    slices.iter().map(row).collect()
}
