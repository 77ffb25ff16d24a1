//! Frames read back and encoded as PNG on all cores, as many a second as go.

use std::sync::Mutex;
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::Instant;

use anyhow::{Context as _, Result};
use contract::job::RenderJob;
use render::frame::Stages;
use render::gpu::Gpu;
use render::playback::Playback;
use render::{Image, Scene};
use serde::Serialize;

use crate::bench::frames::weights;

/// Frames a second, and how large one is.
#[derive(Debug, Serialize)]
pub struct Encoded {
    pub frames_per_s: f64,
    pub png_bytes: usize,
    pub cores: usize,
}

/// Draws, reads back and encodes `frames` frames; several are drawn while others are encoded.
pub fn measure(
    gpu: &Gpu,
    stages: &Stages,
    job: &RenderJob,
    scene: &Scene,
    frames: usize,
) -> Result<Encoded> {
    let [width, height] = job.view.size_px();
    let steps = Playback::upload(gpu, scene)?;
    let mut playback = Playback::new(gpu, stages, job, scene)?;
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let (drawn_tx, drawn_rx) = sync_channel::<Vec<u8>>(2 * cores);
    let drawn_rx = Mutex::new(drawn_rx);
    let start = Instant::now();
    let png_bytes = thread::scope(|scope| -> Result<usize> {
        let encoders: Vec<_> = (0..cores)
            .map(|_| {
                scope.spawn(|| -> Result<usize> {
                    let mut last = 0;
                    loop {
                        // Held while waiting: whoever gets the next picture lets go of the lock.
                        let next = drawn_rx.lock().map_or(None, |rx| rx.recv().ok());
                        let Some(rgba8) = next else { return Ok(last) };
                        last = Image {
                            width,
                            height,
                            rgba8,
                        }
                        .encode_png()?
                        .len();
                    }
                })
            })
            .collect();
        for frame in 0..frames {
            let (value, carbon) = weights(frame);
            playback.seek(value, carbon);
            drawn_tx
                .send(playback.image(&steps)?)
                .context("an encoder ended early")?;
        }
        drop(drawn_tx);
        let mut most = 0;
        for encoder in encoders {
            let bytes = encoder
                .join()
                .map_err(|_panic| anyhow::anyhow!("an encoder panicked"))??;
            most = most.max(bytes);
        }
        Ok(most)
    })?;
    Ok(Encoded {
        frames_per_s: frames as f64 / start.elapsed().as_secs_f64(),
        png_bytes,
        cores,
    })
}
