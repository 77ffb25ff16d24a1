//! Map tiles as a tile server asks for them: drawn, read back and encoded, one after the other.

use std::time::Instant;

use anyhow::{Result, ensure};
use contract::job::{RenderJob, View};
use contract::tile::Tile;
use render::{Backend, Renderer, Scene};

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

/// All tiles of a block at one instant, one after the other with PNG.
pub struct Block {
    /// How many.
    pub tiles: usize,
    /// Together, with the light of the block made once.
    pub shared_ms: f64,
    /// Together, every one with light of its own.
    pub own_ms: f64,
}

/// Times of the four by four tiles round one, in shared light and in light of their own; no times are
/// returned if the bytes differ.
pub fn of_block(job: &RenderJob, scene: &Scene, tile: Tile) -> Result<Block> {
    let renderer = Renderer::new(Backend::Gpu)?;
    let corner = [tile.x, tile.y].map(|place| place / 4 * 4);
    let side = 4.min(1 << tile.z);
    let tiles: Vec<Tile> = (0..side * side)
        .map(|i| Tile::new(tile.z, corner[0] + i % side, corner[1] + i / side))
        .collect::<Result<_, _>>()?;
    let picture = |tile: Tile, weight: f64| -> Result<Vec<u8>> {
        let (mut job, mut scene) = (job.clone(), scene.clone());
        job.view = View::Tile { tile, size_px: 256 };
        scene.value.weight = weight;
        Ok(renderer.render(&job, &scene)?.encode_png()?.to_vec())
    };
    let all = |weight: &dyn Fn(usize) -> f64| -> Result<(f64, Vec<Vec<u8>>)> {
        let start = Instant::now();
        let tiles = tiles.iter().enumerate();
        let pictures = tiles.map(|(i, tile)| picture(*tile, weight(i)));
        let pictures = pictures.collect::<Result<_>>()?;
        Ok((start.elapsed().as_secs_f64() * 1e3, pictures))
    };
    // An instant of its own gives each tile light of its own: what is as good as the same instant looks the same.
    let apart = |i: usize| 0.3 + (i + 1) as f64 * 1e-12;
    all(&|_| 0.7)?;
    let (own_ms, own) = all(&apart)?;
    let (shared_ms, shared) = all(&|_| 0.3)?;
    ensure!(own == shared, "tiles in shared light differ");
    Ok(Block {
        tiles: tiles.len(),
        shared_ms,
        own_ms,
    })
}
