//! Whole frames that stay on the device, the instant changing from each to the next, and the stages they are made of.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, ensure};
use contract::job::RenderJob;
use render::Scene;
use render::frame::Stages;
use render::gpu::{Gpu, Slot, Stamps};
use render::playback::Playback;
use render::stages::sizes::list_count;
use serde::Serialize;

use crate::bench::stats::Times;

/// Frames on their way at once.
const IN_FLIGHT: usize = 3;
/// How long frames are drawn before the clock runs: a device that has idled for a second takes a while to wake up.
const WARM_UP: Duration = Duration::from_millis(500);

/// What a series of frames took.
#[derive(Debug, Serialize)]
pub struct Measured {
    /// From the end of one frame to the end of the next by the device's clock, frames following one another.
    pub frame: Times,
    /// The same by the wall clock: all frames over their number.
    pub frame_wall_ms: f64,
    /// Each stage, in order: the device's clock, frames one at a time.
    pub stages: Vec<(String, Times)>,
    /// List entries of the last frame.
    pub entries: u32,
    /// Those of its fullest screen tile over those of a tile that has any.
    pub fullest_over_mean: f64,
    /// Entries of the longest list, one of a slice of a tile.
    pub longest_list: u32,
}

/// Weights that move on with every frame, so that no two frames are alike.
pub fn weights(frame: usize) -> (f32, f32) {
    let share = (frame as f32 * 0.618_034).fract();
    (share, share)
}

/// Frames following one another.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Series {
    /// From the end of one to the end of the next by the device's clock; no runs where it has none.
    pub frame: Times,
    /// All over their number, by the wall clock.
    pub frame_wall_ms: f64,
}

/// Times `frames` frames after a while of drawing, a few on their way at once. `draw` draws one without waiting; the pass
/// that ends it is stamped under the name `last_pass`.
pub fn timed(
    gpu: &Gpu,
    last_pass: &'static str,
    frames: usize,
    mut draw: impl FnMut(usize, Option<&Stamps>) -> Result<wgpu::SubmissionIndex>,
) -> Result<Series> {
    let ends = Stamps::new(gpu, Some(last_pass));
    let mut series = |count: usize, stamps: Option<&Stamps>| -> Result<f64> {
        let mut waiting = VecDeque::new();
        let start = Instant::now();
        for frame in 0..count {
            waiting.push_back(draw(frame, stamps)?);
            if waiting.len() > IN_FLIGHT {
                let oldest = waiting.pop_front();
                let wait = wgpu::PollType::Wait {
                    submission_index: oldest,
                    timeout: None,
                };
                gpu.device().poll(wait).context("the device stopped")?;
            }
        }
        gpu.wait()?;
        Ok(start.elapsed().as_secs_f64())
    };
    let start = Instant::now();
    while start.elapsed() < WARM_UP {
        series(IN_FLIGHT, None)?;
    }
    let wall_s = series(frames, ends.as_ref())?;
    let ended = ends
        .map(|ends| ends.take(gpu))
        .transpose()?
        .unwrap_or_default();
    let periods = ended.windows(2).map(|pair| pair[1].end_s - pair[0].end_s);
    Ok(Series {
        frame: Times::of(periods.collect()),
        frame_wall_ms: wall_s / frames.max(1) as f64 * 1e3,
    })
}

/// Draws `frames` frames.
pub fn measure(
    gpu: &Gpu,
    stages: &Stages,
    job: &RenderJob,
    scene: &Scene,
    frames: usize,
) -> Result<Measured> {
    let mut playback = Playback::new(gpu, stages, job, scene)?;
    let steps = Playback::upload(gpu, scene)?;
    let series = timed(gpu, "eye", frames, |frame, stamps| {
        let (value, carbon) = weights(frame);
        playback.seek(value, carbon);
        Ok(playback.draw(&steps, stamps)?)
    })?;
    let stage_times = staged(gpu, &mut playback, &steps, frames.min(60))?;
    let params = playback.plan().params_of(playback.plan().whole());
    let counts = playback.workspace().room(gpu, Slot::Counts, 4)?;
    let ends: Vec<u32> = gpu
        .recorder()
        .download(&counts, list_count(&params) as usize)?;
    let entries = ends.last().copied().unwrap_or_default();
    let room = playback.workspace().entry_room();
    ensure!(
        entries <= room,
        "{entries} entries in room for {room}: frames are not whole"
    );
    Ok(Measured {
        frame: series.frame,
        frame_wall_ms: series.frame_wall_ms,
        stages: stage_times,
        entries,
        fullest_over_mean: fullest_over_mean(&ends, params.view.slices as usize),
        longest_list: ends
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .max()
            .unwrap_or_default(),
    })
}

/// Where the lists of a picture end, those of a tile one after the other.
fn fullest_over_mean(ends: &[u32], slices: usize) -> f64 {
    let tile_ends = ends.iter().skip(slices - 1).step_by(slices);
    let mut begin = 0;
    let lengths: Vec<u32> = tile_ends
        .map(|end| end - std::mem::replace(&mut begin, *end))
        .filter(|length| *length > 0)
        .collect();
    let fullest = lengths.iter().max().copied().unwrap_or_default();
    let mean = f64::from(begin) / lengths.len().max(1) as f64;
    f64::from(fullest) / mean.max(1.0)
}

fn staged(
    gpu: &Gpu,
    playback: &mut Playback<'_>,
    steps: &render::playback::Steps,
    frames: usize,
) -> Result<Vec<(String, Times)>> {
    let Some(stamps) = Stamps::new(gpu, None) else {
        return Ok(vec![]);
    };
    let mut of_stage: Vec<(String, Vec<f64>)> = vec![];
    for frame in 0..frames {
        let (value, carbon) = weights(frame);
        playback.seek(value, carbon);
        playback.draw(steps, Some(&stamps))?;
        for stamped in stamps.take(gpu)? {
            let took = stamped.end_s - stamped.begin_s;
            match of_stage
                .iter_mut()
                .find(|(label, _)| label == stamped.label)
            {
                Some((_, times)) => times.push(took),
                None => of_stage.push((stamped.label.to_owned(), vec![took])),
            }
        }
    }
    Ok(of_stage
        .into_iter()
        .map(|(label, times)| (label, Times::of(times)))
        .collect())
}
