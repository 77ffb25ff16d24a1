//! Scenes with closed answers: an even sheet over the whole earth, seen from straight above (docs/method.md, "What light
//! does in a volume"). Renderer and reference are checked against the formula, not against each other.

use std::sync::Arc;

use contract::camera::CameraAngles;
use contract::job::{RenderJob, View};
use render::scene::{Field, Interval};
use render::{Backend, Renderer, Scene};
use render_proof::ocean::ONE_DEGREE;
use render_proof::{Fineness, Picture, reference};

/// Share of light that a sheet in full shadow scatters, and what the sun adds (render/src/plan/look.rs).
const AMBIENT: f64 = 0.62;
const DIRECT: f64 = 0.5;
/// Share of the eye's optical depth that dims the sun.
const LIGHT_DEPTH: f64 = 0.6;
/// Linear light of the sRGB grey that the sheet is painted with, 128 of 255.
const GREY: f64 = 0.215_86;
/// How far the two may be off: the depth of the clouds over a place differs from their mean by some hundredths, and the
/// renderer looks its light up twice a cloud.
const REFERENCE_TOLERANCE: f64 = 0.01;
const RENDERER_TOLERANCE: f64 = 0.04;

/// How much a white sheet of little depth may vary over black, levels: it has 3.7, and 5.4 if places were jittered over an
/// eighth of a cell instead of a thirty-second.
const MOST_SPECKLE_LEVELS: f64 = 4.5;

fn even_sea() -> Scene {
    let field = || Arc::new(Field::new(vec![1e-10; ONE_DEGREE.cell_count()]));
    let value = Interval {
        before: field(),
        after: field(),
        weight: 0.5,
    };
    Scene {
        grid: ONE_DEGREE,
        domain: Scene::domain_of(value.before.cells.content().iter().map(|_| true)),
        value,
        accumulated: None,
        terrain: None,
        northward: None,
        trails: None,
        whole: None,
    }
}

fn sheet(depth: f64, elevation_deg: f64, particles: u32) -> RenderJob {
    let mut job = render_proof::ocean::job(View::Globe {
        lon_deg: -150.0,
        lat_deg: 0.0,
        height_m: 4e6,
        width_px: 64,
        height_px: 64,
        angles: CameraAngles {
            field_of_view_deg: 8.0,
            ..CameraAngles::NADIR
        },
    });
    job.accumulated = None;
    let style = &mut job.style;
    style.optical_depth = depth;
    style.sun.elevation_deg = elevation_deg;
    style.particles_per_cell = particles;
    style.transfer.colours = "-1e-9:#808080,1e-9:#808080".parse().unwrap();
    style.transfer.opacity = "-1e-9:1,1e-9:1".parse().unwrap();
    job
}

/// Mean linear light and alpha of a picture.
fn mean(picture: &Picture) -> [f64; 2] {
    let pixels = picture.rgba.iter().map(|&[r, _, _, alpha]| {
        let srgb = r / alpha.max(1e-9);
        let linear = if srgb <= 0.04045 {
            srgb / 12.92
        } else {
            ((srgb + 0.055) / 1.055).powf(2.4)
        };
        [linear * alpha, alpha]
    });
    let count = picture.rgba.len() as f64;
    pixels.fold([0.0; 2], |sum, pixel| {
        [0, 1].map(|i| sum[i] + pixel[i] / count)
    })
}

/// Light and alpha of an even sheet: the integral of `exp(-t) (ambient + direct exp(-0.6 t / sin e))` over its depth.
fn closed(depth: f64, elevation_deg: f64) -> [f64; 2] {
    let path = 1.0 + LIGHT_DEPTH / elevation_deg.to_radians().sin();
    let alpha = 1.0 - (-depth).exp();
    let lit = (1.0 - (-depth * path).exp()) / path;
    [GREY * (AMBIENT * alpha + DIRECT * lit), alpha]
}

#[test]
fn an_even_sheet_has_the_light_and_the_alpha_of_its_closed_form() {
    let (scene, renderer) = (even_sea(), Renderer::new(Backend::Cpu).unwrap());
    for (depth, elevation_deg, particles) in [
        (0.4, 90.0, 12),
        (1.5, 90.0, 12),
        (1.5, 30.0, 12),
        (3.0, 45.0, 12),
        // Radius and number are how finely a cell is drawn, not how much of it there is.
        (1.5, 30.0, 6),
        (1.5, 30.0, 40),
    ] {
        let job = sheet(depth, elevation_deg, particles);
        let [light, alpha] = closed(depth, elevation_deg);
        let truth = reference(&job, &scene, Fineness::default()).unwrap();
        let drawn = Picture::from(&renderer.render(&job, &scene).unwrap());
        for (who, picture, tolerance) in [
            ("reference", truth, REFERENCE_TOLERANCE),
            ("renderer", drawn, RENDERER_TOLERANCE),
        ] {
            let [own_light, own_alpha] = mean(&picture);
            println!(
                "depth {depth}, sun {elevation_deg}, {particles} particles, {who}: light {own_light:.4} of {light:.4}, alpha {own_alpha:.4} of {alpha:.4}"
            );
            assert!((own_light / light - 1.0).abs() < tolerance, "{who}");
            assert!((own_alpha / alpha - 1.0).abs() < tolerance, "{who}");
        }
    }
}

/// Light of the pixels of a picture over black, sRGB levels: mean, and how far from it they are.
fn spread(picture: &Picture) -> [f64; 2] {
    let levels: Vec<f64> = picture.rgba.iter().map(|[r, ..]| r * 255.0).collect();
    let count = levels.len() as f64;
    let mean = levels.iter().sum::<f64>() / count;
    let square = levels.iter().map(|level| (level - mean).powi(2));
    [mean, (square.sum::<f64>() / count).sqrt()]
}

#[test]
fn an_even_sheet_without_flux_has_little_speckle() {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let mut job = sheet(0.75, 40.0, 16);
    job.style.transfer.colours = "-1e-9:#ffffff,1e-9:#ffffff".parse().unwrap();
    let drawn = Picture::from(&renderer.render(&job, &even_sea()).unwrap());
    let [mean, levels] = spread(&drawn);
    println!("a white sheet of {mean:.1}: {levels:.2} levels");
    assert!(levels < MOST_SPECKLE_LEVELS, "{levels} levels");
}
