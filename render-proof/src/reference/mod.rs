//! A half-angle volume drawn another way, in double precision: a job and a scene in, premultiplied colours out.
//!
//! Every particle is a round cloud in space. The optical depth of a cloud along any piece of a straight line has a
//! closed form, so the depth in front of a place and the depth between a place and the sun are exact sums over clouds;
//! only the light scattered along a sight line is summed over short steps. There are no slices, no light buffer, no
//! splats, no integers and no order of particles. Globe views and map tiles differ in their space (`space`) alone.

mod cloud;
mod rays;
mod sky;
mod space;
mod srgb;

use contract::job::{Mode, RenderJob};
use render::plan::Plan;
use render::{Image, Scene, pyramid};

use cloud::clouds;
use rays::{Rays, Shade};
use sky::Sky;
use space::Space;

use crate::error::ProofError;

/// How finely sight lines are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fineness {
    /// Steps in the radius of the smallest cloud.
    pub steps_per_radius: u32,
}

impl Default for Fineness {
    /// Twice and four times as many steps move no channel by 1/1000 (`tests/it/reference.rs`).
    fn default() -> Self {
        Self {
            steps_per_radius: 8,
        }
    }
}

/// A picture of premultiplied sRGB red, green, blue and alpha, 0 to 1, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Colours.
    pub rgba: Vec<[f64; 4]>,
}

impl From<&Image> for Picture {
    fn from(image: &Image) -> Self {
        let premultiplied = |pixel: &[u8]| {
            let alpha = f64::from(pixel[3]) / 255.0;
            let [r, g, b] = [0, 1, 2].map(|i| f64::from(pixel[i]) / 255.0 * alpha);
            [r, g, b, alpha]
        };
        Self {
            width: image.width,
            height: image.height,
            rgba: image.rgba8.chunks_exact(4).map(premultiplied).collect(),
        }
    }
}

/// Draws a volume without a globe behind it, as exactly as can be, from the cells that the renderer draws it from.
///
/// # Errors
/// What the plan of the job refuses; [`ProofError::NoReference`] for other modes than the volume.
pub fn reference(
    job: &RenderJob,
    scene: &Scene,
    fineness: Fineness,
) -> Result<Picture, ProofError> {
    let coarser = pyramid::suited(job, scene);
    reference_of_cells(job, coarser.as_ref().unwrap_or(scene), fineness)
}

/// The same from every cell, however small they are.
///
/// # Errors
/// Those of [`reference`].
pub fn reference_of_cells(
    job: &RenderJob,
    scene: &Scene,
    fineness: Fineness,
) -> Result<Picture, ProofError> {
    let style = &job.style;
    let is_bare = style.context.is_empty() && style.sun.subsolar.is_none() && !style.uncertainty;
    if job.mode != Mode::Volume || job.style.globe_surface || !is_bare {
        return Err(ProofError::NoReference);
    }
    let plan = Plan::new(job, scene, u64::MAX)?;
    let space = Space::of(job);
    let clouds = clouds(&plan, job, scene, &space);
    let sky = Sky::new(&clouds, &space);
    let [width, height] = plan.size_px();
    let rays = Rays::new(&sky, Shade::of(&plan), [width, height], fineness);
    Ok(Picture {
        width,
        height,
        rgba: rays.picture().into_iter().map(srgb::encoded).collect(),
    })
}
