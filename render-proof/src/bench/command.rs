//! The command: options in, one table out. Pictures are compared before speed is.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use clap::Args;
use contract::job::RenderJob;
use contract::tile::Tile;
use render::frame::Stages;
use render::gpu::Gpu;
use render::playback::Playback;
use render::stages::fill::{Fill, Form, Sources};
use render::{Backend, Image, Renderer, Scene};

use crate::bench::classic::{self, Classic};
use crate::bench::report::{Against, Row, report, report_frames, say, talk, times_faster};
use crate::bench::served::Served;
use crate::bench::{encode, frames, samples, scenery, tiles, twins};
use crate::fill::timing;
use crate::{Difference, Fineness, Picture, reference_of_cells};

/// Longest time for one form on one grid.
const MOST_FILLING: Duration = Duration::from_secs(4);

/// Measure the renderer on this machine.
#[derive(Debug, Args)]
pub struct RenderBench {
    /// Particles of each scene, in millions.
    #[arg(long, value_delimiter = ',', default_value = "0.1,1,4.43")]
    millions: Vec<f64>,
    /// Pictures, `WIDTHxHEIGHT`.
    #[arg(long, value_delimiter = ',', default_value = "1920x1080")]
    sizes: Vec<String>,
    /// Half-angle slices.
    #[arg(long, value_delimiter = ',', default_value = "64")]
    slices: Vec<u32>,
    /// Tilts of the camera, degrees from the vertical, 0 to 80.
    #[arg(long, value_delimiter = ',', default_value = "0", value_parser = tilt_deg)]
    tilts: Vec<f64>,
    /// Frames of each series.
    #[arg(long, default_value_t = 200)]
    frames: usize,
    /// Frames of the classic renderer; 0 leaves it out.
    #[arg(long, default_value_t = 10)]
    classic: usize,
    /// Runs of the CPU twins; 0 leaves them out.
    #[arg(long, default_value_t = 5)]
    twins: usize,
    /// Frames read back and encoded; 0 leaves them out.
    #[arg(long, default_value_t = 0)]
    encode: usize,
    /// Compare each picture with the same one in double precision, which takes minutes.
    #[arg(long)]
    reference: bool,
    /// Draw what the product draws: cells joined where they are under half a pixel, over the globe with coasts, sea, sea floor
    /// and air; the particles are compared with those of all cells before anything is timed.
    #[arg(long)]
    as_served: bool,
    /// Volume tiles; 0 leaves them out.
    #[arg(long, default_value_t = 0)]
    tiles: usize,
    /// Cells of a whole earth of sea, in millions, whose north pole is looked at: particles crowd there; 0 leaves it out.
    #[arg(long, default_value_t = 0.0)]
    pole: f64,
    /// Largest grid whose gaps are filled, `ROWSxCOLUMNS`: every form, small grids first; nothing else is timed.
    #[arg(long)]
    fill: Option<String>,
    /// Folder for the pictures.
    #[arg(long)]
    pictures: Option<PathBuf>,
    /// Folder for the same few pictures on every machine, to be compared with those of another adapter; nothing is timed.
    #[arg(long)]
    samples: Option<PathBuf>,
    /// Compare two folders of sample pictures; nothing is timed.
    #[arg(long, num_args = 2, value_names = ["A", "B"])]
    compare: Option<Vec<PathBuf>>,
    /// One JSON line a scene instead of the table.
    #[arg(long)]
    json: bool,
}

/// A tilt that shows the region.
fn tilt_deg(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(tilt) if (0.0..=80.0).contains(&tilt) => Ok(tilt),
        _ => Err("degrees from the vertical, 0 to 80".into()),
    }
}

/// Measures what the options ask for, and prints it.
///
/// # Errors
/// No device, a size that is none, a scene that is too large, a file that cannot be written.
pub fn run(args: &RenderBench) -> Result<()> {
    if let Some(folders) = &args.compare {
        return samples::compare(&folders[0], &folders[1]);
    }
    if let Some(folder) = &args.samples {
        return samples::draw(folder);
    }
    let gpu = Gpu::open()?;
    if let Some(size) = &args.fill {
        return fills(&gpu, size);
    }
    let start = Instant::now();
    let stages = Stages::new(&gpu);
    gpu.keep_pipelines();
    talk(&format!(
        "{}; shaders compiled in {:.2} s",
        gpu.adapter_name(),
        start.elapsed().as_secs_f64()
    ));
    if args.pole > 0.0 {
        let (scene, job) = scenery::pole((args.pole * 1e6) as u64, [1920, 1080])?;
        let measured = frames::measure(&gpu, &stages, &job, &scene, args.frames)?;
        report_frames(&job, scenery::particles(&scene), &measured);
    }
    for millions in &args.millions {
        let start = Instant::now();
        let grid = scenery::grid((millions * 1e6) as u64);
        let scene = scenery::scene(&grid);
        let particles = scenery::particles(&scene);
        talk(&format!(
            "{particles} particles on {} x {} cells, made in {:.1} s",
            grid.rows,
            grid.cols,
            start.elapsed().as_secs_f64()
        ));
        series(
            args,
            (&gpu, &stages),
            &scene,
            &|size_px, slices, tilt_deg| scenery::job(size_px, slices, tilt_deg),
        )?;
        if args.tiles > 0 {
            let renderer = Renderer::new(Backend::Gpu)?;
            let job = scenery::job([256, 256], 64, 0.0)?;
            for z in [3, 4, 5, 6] {
                // Round 115 E, 20 N.
                let tile = Tile::new(
                    z,
                    (0.819 * f64::from(1 << z)) as u32,
                    (0.443 * f64::from(1 << z)) as u32,
                )?;
                let times = tiles::measure(&renderer, &job, &scene, &[tile], args.tiles)?;
                say(&format!(
                    "  volume tile {tile} with PNG: median {:.2} ms, p99 {:.2} ms",
                    times.median_ms, times.p99_ms
                ));
            }
        }
    }
    Ok(())
}

/// What is drawn in a size, in slices and at a tilt, degrees.
pub type Jobs<'a> = dyn Fn([u32; 2], u32, f64) -> Result<RenderJob> + 'a;

/// Measures a scene of data in place of made-up ones: every size, number of slices and tilt.
///
/// # Errors
/// Those of [`run`].
pub fn run_on(args: &RenderBench, scene: &Scene, jobs: &Jobs<'_>) -> Result<()> {
    let gpu = Gpu::open()?;
    let stages = Stages::new(&gpu);
    talk(gpu.adapter_name());
    series(args, (&gpu, &stages), scene, jobs)
}

fn series(
    args: &RenderBench,
    (gpu, stages): (&Gpu, &Stages),
    scene: &Scene,
    jobs: &Jobs<'_>,
) -> Result<()> {
    for size in &args.sizes {
        let (width, height) = size.split_once('x').context("a size is WIDTHxHEIGHT")?;
        let size_px = [width.parse()?, height.parse()?];
        for &slices in &args.slices {
            for &tilt_deg in &args.tilts {
                let job = jobs(size_px, slices, tilt_deg)?;
                if !args.as_served {
                    let row = row(args, gpu, stages, (&job, tilt_deg), scene)?;
                    report(args.json, &job, &row);
                    continue;
                }
                let served = Served::of(gpu, stages, &job, scene)?;
                let (job, scene) = (served.job, served.scene);
                let mut row = row(args, gpu, stages, (&job, tilt_deg), &scene)?;
                row.particles = served.joined.particles;
                row.joined = Some(served.joined);
                report(args.json, &job, &row);
            }
        }
    }
    Ok(())
}

fn row(
    args: &RenderBench,
    gpu: &Gpu,
    stages: &Stages,
    (job, tilt_deg): (&RenderJob, f64),
    scene: &Scene,
) -> Result<Row> {
    let [width, height] = job.view.size_px();
    let measured = frames::measure(gpu, stages, job, scene, args.frames)?;
    let classic = (args.classic > 0)
        .then(|| against(args, (job, tilt_deg), scene, &measured))
        .transpose()?;
    let twins = (args.twins > 0)
        .then(|| twins::measure(job, scene, args.twins))
        .transpose()?;
    let encoded = (args.encode > 0)
        .then(|| encode::measure(gpu, stages, job, scene, args.encode))
        .transpose()?;
    let reference = args
        .reference
        .then(|| from_reference(gpu, stages, job, scene))
        .transpose()?
        .flatten();
    Ok(Row {
        adapter: gpu.adapter_name().to_owned(),
        particles: scenery::particles(scene) * u64::from(job.style.particles_per_cell),
        width,
        height,
        slices: job.style.slices,
        tilt_deg,
        joined: None,
        measured,
        classic,
        twins,
        encoded,
        reference,
    })
}

/// How far a frame is from the picture in double precision of the same instant, which takes the processor minutes.
fn from_reference(
    gpu: &Gpu,
    stages: &Stages,
    job: &RenderJob,
    scene: &Scene,
) -> Result<Option<Difference>> {
    let mut playback = Playback::new(gpu, stages, job, scene)?;
    let steps = Playback::upload(gpu, scene)?;
    let [width, height] = job.view.size_px();
    let rgba8 = playback.image(&steps)?;
    let image = Image {
        width,
        height,
        rgba8,
    };
    let truth = reference_of_cells(job, scene, Fineness::default())?;
    Ok(Difference::of(&Picture::from(&image), &truth))
}

/// The classic renderer on the same frame: first the pictures, then the times. On a device of its own, of
/// which nothing remains when ours are timed.
fn against(
    args: &RenderBench,
    (job, tilt_deg): (&RenderJob, f64),
    scene: &Scene,
    measured: &frames::Measured,
) -> Result<Against> {
    let gpu = &Gpu::open()?;
    let stages = &Stages::new(gpu);
    let [width, height] = job.view.size_px();
    let name = format!(
        "{}-{width}x{height}-{}-tilt-{tilt_deg}",
        scenery::particles(scene),
        job.style.slices
    );
    let steps = classic::steps(gpu, scene)?;
    let mut playback = Playback::new(gpu, stages, job, scene)?;
    let mut classic = Classic::new(gpu, job, scene)?;
    let weights = frames::weights(7);
    playback.seek(weights.0, weights.1);
    let ours = Image {
        width,
        height,
        rgba8: playback.image(&steps)?,
    };
    classic.draw(&steps, weights, None)?;
    let theirs = classic.image()?;
    if let Some(folder) = &args.pictures {
        std::fs::create_dir_all(folder)?;
        std::fs::write(folder.join(format!("{name}.png")), ours.encode_png()?)?;
        std::fs::write(
            folder.join(format!("{name}-classic.png")),
            theirs.encode_png()?,
        )?;
    }
    let series = frames::timed(gpu, classic::LAST_PASS, args.classic, |frame, stamps| {
        classic.draw(&steps, frames::weights(frame), stamps)
    })?;
    let (clock, times_faster) = times_faster(measured, &series);
    Ok(Against {
        series,
        clock,
        times_faster,
        light: format!("{:?}", classic.light_format()),
        difference: Difference::of(&Picture::from(&ours), &Picture::from(&theirs)),
        note: classic::NOTE,
    })
}

/// Fills the gaps of made-up fields, a fifth of them missing, with every form.
fn fills(gpu: &Gpu, size: &str) -> Result<()> {
    let (rows, cols) = size.split_once('x').context("a size is ROWSxCOLUMNS")?;
    let fill = Fill::new(gpu, Sources::default());
    for case in timing::cases([rows.parse()?, cols.parse()?], 0.2) {
        for form in Form::ALL {
            let timing = match timing::bench_fill(gpu, &fill, case, form, 50, MOST_FILLING) {
                Ok(timing) => timing,
                Err(error) => {
                    say(&format!(
                        "{} of {} x {}: {error}",
                        form.name(),
                        case.rows,
                        case.cols
                    ));
                    continue;
                }
            };
            say(&format!(
                "{:<11} {:>4} x {:<4} gaps of {:>2}: median {:>10.3} ms; from all pairs {:?}, RMSE over spread {:?}, digest {}",
                form.name(),
                case.rows,
                case.cols,
                case.missing.side_cells,
                timing.median_s() * 1e3,
                timing.from_all_pairs,
                timing.rmse_of_hidden,
                timing
                    .values_digest
                    .map_or_else(|| "-".to_owned(), |digest| digest.short())
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tilts_beyond_the_horizon_are_refused() {
        assert_eq!(tilt_deg("60"), Ok(60.0));
        for text in ["-1", "81", "NaN", "steep"] {
            assert!(tilt_deg(text).is_err(), "{text}");
        }
    }
}
