//! Map tiles as a tile server asks for them: drawn, read back and encoded, one after the other.

use std::time::Instant;

use anyhow::Result;
use contract::job::{RenderJob, View};
use contract::tile::Tile;
use render::{Renderer, Scene};

use crate::bench::stats::Times;

/// Times of `runs` tiles of 256 pixels with PNG, the same few tiles in turn at changing instants.
pub fn measure(
    renderer: &Renderer,
    job: &RenderJob,
    scene: &Scene,
    tiles: &[Tile],
    runs: usize,
) -> Result<Times> {
    let mut times = vec![];
    for run in 0..runs + tiles.len() {
        let mut job = job.clone();
        job.view = View::Tile {
            tile: tiles[run % tiles.len()],
            size_px: 256,
        };
        let mut scene = scene.clone();
        scene.value.weight = (run as f64 * 0.618_034).fract();
        let start = Instant::now();
        let png = renderer.render(&job, &scene)?.encode_png()?;
        // The first round warms up.
        if run >= tiles.len() {
            times.push(start.elapsed().as_secs_f64());
        }
        std::hint::black_box(png);
    }
    Ok(Times::of(times))
}
