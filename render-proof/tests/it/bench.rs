//! What speed is measured with: scenes that look alike at any number of cells, and a baseline that draws the same picture.

use contract::job::RenderJob;
use render::frame::Stages;
use render::gpu::Gpu;
use render::plan::Plan;
use render::playback::Playback;
use render::{Image, Scene, frame_cpu};
use render_proof::bench::classic::{self, Classic};
use render_proof::bench::scenery;
use render_proof::{Difference, Picture};

/// From all cells, as benches draw.
fn drawn(job: &RenderJob, scene: &Scene) -> Picture {
    let plan = Plan::new(job, scene, u64::MAX).unwrap();
    let [width, height] = plan.size_px();
    let rgba8 = frame_cpu::draw(&plan, plan.whole(), scene).unwrap();
    Picture::from(&Image {
        width,
        height,
        rgba8,
    })
}

/// Mean level of red, green, blue and alpha over the pixels that are sea in each of the pictures.
fn mean_levels(pictures: &[Picture]) -> Vec<[f64; 4]> {
    let is_sea = |pixel: &usize| pictures.iter().all(|p| p.rgba[*pixel][3] > 0.5);
    let sea: Vec<usize> = (0..pictures[0].rgba.len()).filter(is_sea).collect();
    assert!(
        sea.len() * 8 > pictures[0].rgba.len(),
        "{} pixels of sea",
        sea.len()
    );
    let mean = |picture: &Picture| {
        [0, 1, 2, 3].map(|channel| {
            let sum: f64 = sea.iter().map(|pixel| picture.rgba[*pixel][channel]).sum();
            255.0 * sum / sea.len() as f64
        })
    };
    pictures.iter().map(mean).collect()
}

#[test]
fn a_scene_of_the_sea_is_as_bright_in_a_tenth_of_a_million_cells_as_in_four_and_a_half() {
    for tilt_deg in [0.0, 60.0] {
        let pictures = [100_000, 1_000_000, 4_430_000].map(|particles| {
            let scene = scenery::scene(&scenery::grid(particles));
            let job = scenery::job([240, 180], 64, tilt_deg).unwrap();
            drawn(&job, &scene)
        });
        let levels = mean_levels(&pictures);
        println!("tilt {tilt_deg}: {levels:.1?}");
        for (few, many) in levels.iter().zip(&levels[1..]) {
            for (a, b) in few.iter().zip(many) {
                assert!((a - b).abs() < 2.0, "tilt {tilt_deg}: {levels:?}");
            }
        }
    }
}

#[test]
fn the_classic_renderer_draws_the_picture_that_ours_does() {
    let gpu = &Gpu::open().unwrap();
    let stages = &Stages::new(gpu);
    let scene = scenery::scene(&scenery::grid(20_000));
    let job = scenery::job([160, 120], 32, 0.0).unwrap();
    let steps = classic::steps(gpu, &scene).unwrap();
    let mut playback = Playback::new(gpu, stages, &job, &scene).unwrap();
    playback.seek(0.3, 0.3);
    let ours = Image {
        width: 160,
        height: 120,
        rgba8: playback.image(&steps).unwrap(),
    };
    let mut classic = Classic::new(gpu, &job, &scene).unwrap();
    // Twice: nothing of a frame is left in the next.
    for _ in 0..2 {
        classic.draw(&steps, (0.3, 0.3), None).unwrap();
    }
    let theirs = classic.image().unwrap();
    let apart = Difference::of(&Picture::from(&ours), &Picture::from(&theirs)).unwrap();
    println!("{:?}: {apart:?}", classic.light_format());
    // They blend one by one and look the light up once; a wrong order or wrong quads are below 15 dB.
    let covered = apart.covered.unwrap();
    assert!(
        covered.percent > 10.0 && covered.psnr_db.unwrap() > 27.0,
        "{apart:?}"
    );
    let has_32_bits = gpu
        .device()
        .features()
        .contains(wgpu::Features::FLOAT32_BLENDABLE);
    let is_32_bits = classic.light_format() == wgpu::TextureFormat::R32Float;
    assert_eq!(has_32_bits, is_32_bits);
}
