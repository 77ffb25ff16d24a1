//! Error against the number of slices: a job and a scene in, a row a number of slices out, and the pictures.

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

/// A scene in several numbers of slices.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// One a number of slices.
    pub rows: Vec<QualityRow>,
    /// The pictures of these rows.
    pub drawn: Vec<Picture>,
    /// What they are held against.
    pub reference: Picture,
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
) -> Result<Quality, ProofError> {
    let mut quality = Quality {
        rows: vec![],
        drawn: vec![],
        reference: reference(job, scene, Fineness::default())?,
    };
    for &slices in slices {
        let mut job = job.clone();
        job.style.slices = slices;
        let picture = Picture::from(&renderer.render(&job, scene)?);
        let difference = Difference::of(&picture, &quality.reference)
            .expect("both have the size that the job asks for");
        quality.rows.push(QualityRow { slices, difference });
        quality.drawn.push(picture);
    }
    Ok(quality)
}
