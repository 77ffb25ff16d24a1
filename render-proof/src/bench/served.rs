//! A scene as the product draws it: cells joined where they are under half a pixel, over the globe with coasts, lakes,
//! borders, sea floor, a translucent sea, air and sky. Engine benches leave all of that out and draw every cell.

use std::time::Instant;

use anyhow::Result;
use contract::base_map::Background;
use contract::job::{RenderJob, Style};
use contract::picture::PictureOptions;
use contract::quantity::Quantity;
use contract::time::TimeMs;
use render::frame::Stages;
use render::gpu::Gpu;
use render::plan::Plan;
use render::playback::Playback;
use render::{Image, Scene, pyramid};
use serde::Serialize;

use crate::{Difference, Picture};

/// Share of what lies 100 km below the sea surface that the sea hides, as in the pictures of the gallery.
const SEA_OPACITY: f64 = 0.4;

/// What a picture of a scene is drawn from in the product.
pub struct Served {
    pub job: RenderJob,
    pub scene: Scene,
    pub joined: Joined,
}

/// How cells were joined.
#[derive(Debug, Serialize)]
pub struct Joined {
    /// Cells of sea before.
    pub cells: u64,
    /// Particles that are drawn in their place.
    pub particles: u64,
    /// What joining them took on the host, once for two steps of a product, ms.
    pub once_ms: f64,
    /// The particles alone from the picture of all cells; none where none were joined.
    pub from_all_cells: Option<Difference>,
    /// Red, green, blue and alpha of the sea in the picture of all cells and in the one that is drawn: means over the pixels
    /// that are more than half covered in both, levels.
    pub mean_levels: [[f64; 4]; 2],
}

impl Served {
    /// From a job and the scene of all its cells.
    ///
    /// # Errors
    /// Those of drawing.
    pub fn of(gpu: &Gpu, stages: &Stages, job: &RenderJob, all_cells: &Scene) -> Result<Self> {
        let start = Instant::now();
        let coarser = pyramid::suited(job, all_cells);
        let once_ms = start.elapsed().as_secs_f64() * 1e3;
        let mut particles_alone = job.clone();
        particles_alone.style.particles_per_cell = Style::GLOBE_PARTICLES_PER_CELL;
        let all = picture(gpu, stages, &particles_alone, all_cells)?;
        let (from_all_cells, mean_levels) = match &coarser {
            None => (None, mean_levels([&all, &all])),
            Some(scene) => {
                let joined = picture(gpu, stages, &particles_alone, scene)?;
                (Difference::of(&joined, &all), mean_levels([&all, &joined]))
            }
        };
        let scene = coarser.unwrap_or_else(|| all_cells.clone());
        let plan = Plan::for_device(&particles_alone, &scene, u64::MAX)?;
        let each = u64::from(plan.params.cells.particles_per_cell);
        let mut job = particles_alone;
        let options = PictureOptions {
            globe_surface: true,
            sea_opacity: Some(SEA_OPACITY),
            background: Some(Background::Sky),
            ..PictureOptions::default()
        };
        let date: TimeMs = "2000-01-15".parse()?;
        let composed = options.style(Quantity::CarbonFlux, job.mode, date)?;
        (job.style.globe_surface, job.style.context) = (true, composed.context);
        Ok(Self {
            joined: Joined {
                cells: super::scenery::particles(all_cells),
                particles: super::scenery::particles(&scene) * each,
                once_ms,
                from_all_cells,
                mean_levels,
            },
            job,
            scene,
        })
    }
}

/// Means over the pixels that are more than half covered in both, levels.
fn mean_levels(pictures: [&Picture; 2]) -> [[f64; 4]; 2] {
    let is_sea = |at: &usize| pictures.iter().all(|picture| picture.rgba[*at][3] > 0.5);
    let sea: Vec<usize> = (0..pictures[0].rgba.len()).filter(is_sea).collect();
    pictures.map(|picture| {
        [0, 1, 2, 3].map(|channel| {
            let sum: f64 = sea.iter().map(|at| picture.rgba[*at][channel]).sum();
            255.0 * sum / sea.len().max(1) as f64
        })
    })
}

/// The particles alone, at the instant of the scene.
fn picture(gpu: &Gpu, stages: &Stages, job: &RenderJob, scene: &Scene) -> Result<Picture> {
    let mut playback = Playback::new(gpu, stages, job, scene)?;
    let steps = Playback::upload(gpu, scene)?;
    let [width, height] = job.view.size_px();
    let rgba8 = playback.image(&steps)?;
    Ok(Picture::from(&Image {
        width,
        height,
        rgba8,
    }))
}
