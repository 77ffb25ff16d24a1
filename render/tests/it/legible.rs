//! Points and sprites can be told from the map below them, be it dark or light: contrast measured against the same map
//! without them.

use std::sync::Arc;

use contract::base_map::BaseMap;
use contract::job::{Mode, RenderJob};
use render::scene::{Field, Interval};
use render::stages::colour::linear_of;
use render::{Backend, Image, Renderer, Scene};

use crate::scenes::{FIVE_DEGREES, job, looking_at, ocean};

/// The same scene with data nowhere, where the map is the same.
fn bare(scene: &Scene) -> Scene {
    let nothing = Arc::new(Field::new(vec![f32::NAN; scene.grid.cell_count()]));
    let value = Interval {
        before: Arc::clone(&nothing),
        after: nothing,
        weight: 0.0,
    };
    Scene {
        value,
        ..scene.clone()
    }
}

/// Relative luminance of a pixel (WCAG 2.1).
fn luminance(image: &Image, x: u32, y: u32) -> f32 {
    let [r, g, b, _alpha] = image.pixel(x, y);
    let colour = glam::Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0;
    linear_of(colour).dot(glam::Vec3::new(0.2126, 0.7152, 0.0722))
}

/// A picture, and the same without its particles.
fn drawn(job: &RenderJob) -> [Image; 2] {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let scene = ocean(FIVE_DEGREES);
    [&scene, &bare(&scene)].map(|scene| renderer.render(job, scene).unwrap())
}

/// Contrast ratios of all pixels that particles are drawn in, least first.
fn contrasts(with: &Image, without: &Image) -> Vec<f32> {
    let pixels = (0..with.height).flat_map(|y| (0..with.width).map(move |x| (x, y)));
    let mut found: Vec<f32> = pixels
        .filter(|(x, y)| with.pixel(*x, *y) != without.pixel(*x, *y))
        .map(|(x, y)| {
            let [a, b] = [with, without].map(|image| luminance(image, x, y) + 0.05);
            a.max(b) / a.min(b)
        })
        .collect();
    found.sort_unstable_by(f32::total_cmp);
    found
}

fn on(mode: Mode, base_map: BaseMap) -> RenderJob {
    let mut job = job(mode, looking_at([-120.0, 10.0], 6e6, [20.0, 30.0], 400));
    job.style.globe_surface = true;
    job.style.context.base_map = base_map;
    job.style.context.coastlines = true;
    job.style.context.sea_floor = true;
    job
}

/// Why particles cannot be told from the map; none if they can. A quarter of what is drawn of them has the contrast that
/// things which carry meaning need (WCAG 2.1, 1.4.11); three quarters, the soft edges being the rest, are seen at all.
fn illegible(with: &Image, without: &Image) -> Option<String> {
    let found = contrasts(with, without);
    let at = |share: f64| found[((found.len() - 1) as f64 * share) as usize];
    let [quarter, half, most] = [0.25, 0.5, 0.75].map(at);
    println!(
        "{} pixels, contrast {quarter:.2}, {half:.2}, {most:.2}",
        found.len()
    );
    let is_legible = quarter >= 1.25 && half >= 1.6 && most >= 3.0;
    (!is_legible)
        .then(|| format!("contrast {quarter:.2}, {half:.2}, {most:.2}; 1.25, 1.6, 3 are wanted"))
}

#[test]
fn points_and_sprites_can_be_told_from_a_dark_and_from_a_light_map() {
    for mode in [Mode::Points, Mode::Sprites] {
        for base_map in [BaseMap::Dark, BaseMap::Light] {
            let [with, without] = drawn(&on(mode, base_map));
            assert_eq!(illegible(&with, &without), None, "{mode} {base_map}");
            // The same, of which a half is the map.
            let mut faint = with;
            for (byte, below) in faint.rgba8.iter_mut().zip(&without.rgba8) {
                *byte = byte.midpoint(*below);
            }
            assert!(illegible(&faint, &without).is_some(), "{mode} {base_map}");
        }
    }
}
