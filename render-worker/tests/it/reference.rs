//! The half-angle volume against an independent picture: rays marched in double precision through the particles'
//! round clouds, light marched from every sample towards the sun. It shares with the renderer what a particle is (its
//! place in its cell, height, radius, depth and colour) and the constants of the shading, nothing of how it is drawn:
//! no slices, no light buffer, no screen tiles, no projection of splats.

use std::collections::HashMap;

use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use glam::{DVec3, IVec3};
use render_worker::plan::Plan;
use render_worker::stages::layout::Particle;
use render_worker::stages::particles::cpu::{Inputs, generate};
use render_worker::{Backend, Image, Renderer, Scene};

use crate::scenes::{ONE_DEGREE, globe, job, ocean};

/// Shading: ambient, direct, share of the depth that dims light (`plan/look.rs`).
const AMBIENT: f64 = 0.5;
const DIRECT: f64 = 0.65;
const LIGHT_DEPTH: f64 = 0.6;
/// Radius of the sphere that positions are on, m.
const EARTH_M: f64 = 6_371_000.0;

/// A round cloud: density `8 / (3 pi radius) depth (1 - r²)^1.5`, whose projection is `depth (1 - r²)²`.
struct Cloud {
    place: DVec3,
    radius: f64,
    depth: f64,
    color: DVec3,
}

struct Clouds {
    all: Vec<Cloud>,
    /// Clouds that reach into a cube of space.
    cubes: HashMap<IVec3, Vec<usize>>,
    cube: f64,
}

/// Axes of eq. 4 at a place: east, north, up.
fn axes(lon: f64, lat: f64) -> [DVec3; 3] {
    let up = DVec3::new(lat.cos() * lon.sin(), lat.cos() * lon.cos(), lat.sin());
    let east = DVec3::new(lon.cos(), -lon.sin(), 0.0);
    [
        east,
        DVec3::new(-lat.sin() * lon.sin(), -lat.sin() * lon.cos(), lat.cos()),
        up,
    ]
}

fn lerp_at(interval: &render_worker::Interval) -> Vec<f32> {
    let (before, after) = (
        interval.before.cells.content(),
        interval.after.cells.content(),
    );
    let weight = interval.weight as f32;
    before
        .iter()
        .zip(after)
        .map(|(a, b)| {
            if *a < -1.0 || *b < -1.0 {
                -1e30
            } else {
                a + (b - a) * weight
            }
        })
        .collect()
}

impl Clouds {
    fn of(job: &RenderJob, scene: &Scene) -> Self {
        let plan = Plan::new(job, scene, u64::MAX).unwrap();
        let (value, accumulated) = (
            lerp_at(&scene.value),
            lerp_at(scene.accumulated.as_ref().unwrap()),
        );
        let count = plan.active.len() * plan.params.particles_per_cell as usize;
        let mut particles = vec![Particle::default(); count];
        let inputs = Inputs {
            active: &plan.active,
            rows: &plan.rows,
            value: &value,
            accumulated: &accumulated,
            palette: &plan.palette,
        };
        generate(&plan.params, &inputs, &mut particles);
        let all: Vec<_> = particles
            .iter()
            .filter(|p| p.depth > 0.0)
            .map(|p| Self::cloud(&plan, &scene.grid, p))
            .collect();
        let cube = all.iter().map(|cloud| cloud.radius).fold(0.0, f64::max);
        let mut cubes: HashMap<IVec3, Vec<usize>> = HashMap::new();
        for (i, cloud) in all.iter().enumerate() {
            let [low, high] = [-1.0, 1.0].map(|side| {
                ((cloud.place + side * cloud.radius) / cube)
                    .floor()
                    .as_ivec3()
            });
            for x in low.x..=high.x {
                for y in low.y..=high.y {
                    for z in low.z..=high.z {
                        cubes.entry(IVec3::new(x, y, z)).or_default().push(i);
                    }
                }
            }
        }
        Self { all, cubes, cube }
    }

    fn cloud(plan: &Plan, grid: &Grid, particle: &Particle) -> Cloud {
        let row = &plan.rows[particle.row as usize];
        let lat =
            grid.north_deg - (f64::from(particle.row) + f64::from(particle.south)) * grid.dlat_deg;
        let lon =
            grid.west_deg + (f64::from(particle.slot) + f64::from(particle.east)) * grid.dlon_deg;
        let [_, _, up] = axes(lon.to_radians(), lat.to_radians());
        let strength = f64::from(particle.color >> 24) / 255.0;
        let full_radius = f64::from(row.radius);
        let radius = full_radius * (1.0 + f64::from(plan.params.size_spread) * (strength - 1.0));
        let depth = f64::from(particle.depth * row.depth_gain) * (full_radius / radius).powi(2);
        let color = DVec3::from_array(
            [0, 8, 16].map(|shift| f64::from((particle.color >> shift) & 255) / 255.0),
        );
        Cloud {
            place: up * (1.0 + f64::from(particle.height_m) / EARTH_M),
            radius,
            depth,
            color,
        }
    }

    /// Density at a place, and colour times density.
    fn at(&self, place: DVec3) -> (f64, DVec3) {
        let (mut density, mut color) = (0.0, DVec3::ZERO);
        for &i in self
            .cubes
            .get(&(place / self.cube).floor().as_ivec3())
            .map_or(&[][..], Vec::as_slice)
        {
            let cloud = &self.all[i];
            let q = (place - cloud.place).length_squared() / (cloud.radius * cloud.radius);
            if q < 1.0 {
                let own = cloud.depth * 8.0 / (3.0 * std::f64::consts::PI * cloud.radius)
                    * (1.0 - q).powf(1.5);
                density += own;
                color += own * cloud.color;
            }
        }
        (density, color)
    }
}

/// A square picture of premultiplied RGBA, and the shell that clouds lie in.
struct March<'a> {
    clouds: &'a Clouds,
    sun: DVec3,
    shell: [f64; 2],
    step: f64,
}

impl March<'_> {
    /// Part of the sun's light that reaches a place.
    fn light(&self, place: DVec3) -> f64 {
        let (mut depth, mut along) = (0.0, 0.5 * self.step);
        loop {
            let sample = place + self.sun * along;
            if sample.length() > self.shell[1] {
                return (-LIGHT_DEPTH * depth).exp();
            }
            depth += self.clouds.at(sample).0 * self.step;
            along += self.step;
        }
    }

    /// Colour and alpha seen along a ray that starts above the shell and goes down through it.
    fn ray(&self, eye: DVec3, sight: DVec3) -> [f64; 4] {
        let (mut color, mut transmittance) = (DVec3::ZERO, 1.0);
        let half = eye.dot(sight);
        let reach = |radius: f64| {
            -half
                - (half * half - eye.length_squared() + radius * radius)
                    .max(0.0)
                    .sqrt()
        };
        let (mut along, end) = (reach(self.shell[1]), reach(self.shell[0]));
        along += 0.5 * self.step;
        while along < end {
            let place = eye + sight * along;
            let (density, tint) = self.clouds.at(place);
            if density > 0.0 {
                let t = ((place.normalize_or_zero().dot(self.sun) + 0.15) / 0.5).clamp(0.0, 1.0);
                let day = t * t * (3.0 - 2.0 * t);
                let alpha = 1.0 - (-density * self.step).exp();
                let shade = AMBIENT + DIRECT * self.light(place) * day;
                color += transmittance * alpha * (tint / density * shade).min(DVec3::ONE);
                transmittance *= 1.0 - alpha;
            }
            along += self.step;
        }
        [color.x, color.y, color.z, 1.0 - transmittance]
    }
}

fn reference(job: &RenderJob, scene: &Scene) -> Vec<[f64; 4]> {
    let View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        width_px,
        height_px,
    } = job.view
    else {
        panic!("a globe view")
    };
    let clouds = Clouds::of(job, scene);
    let [east, north, up] = axes(lon_deg.to_radians(), lat_deg.to_radians());
    let (azimuth, elevation) = (
        job.style.sun.azimuth_deg.to_radians(),
        job.style.sun.elevation_deg.to_radians(),
    );
    let sun =
        (east * azimuth.sin() + north * azimuth.cos()) * elevation.cos() + up * elevation.sin();
    let heights = clouds.all.iter().map(|cloud| cloud.place.length());
    let (low, high) = heights.fold((2.0, 0.0), |(low, high), h| {
        (f64::min(low, h), f64::max(high, h))
    });
    let march = March {
        clouds: &clouds,
        sun,
        shell: [low - clouds.cube, high + clouds.cube],
        step: clouds.cube / 8.0,
    };
    let eye = up * (1.0 + height_m / EARTH_M);
    let focal_px = f64::from(width_px) / 2.0 / 22.5_f64.to_radians().tan();
    let mut picture = vec![];
    for y in 0..height_px {
        for x in 0..width_px {
            let right = (f64::from(x) + 0.5 - f64::from(width_px) / 2.0) / focal_px;
            let above = (f64::from(height_px) / 2.0 - f64::from(y) - 0.5) / focal_px;
            picture.push(march.ray(eye, (east * right + north * above - up).normalize_or_zero()));
        }
    }
    picture
}

/// Peak signal-to-noise ratio of premultiplied colours and alpha, decibels.
fn psnr_db(image: &Image, reference: &[[f64; 4]]) -> f64 {
    let mut squares = 0.0;
    for (pixel, truth) in image.rgba8.chunks_exact(4).zip(reference) {
        let alpha = f64::from(pixel[3]) / 255.0;
        for channel in 0..4 {
            let drawn = if channel == 3 {
                alpha
            } else {
                f64::from(pixel[channel]) / 255.0 * alpha
            };
            squares += (drawn - truth[channel]).powi(2);
        }
    }
    -10.0 * (squares / (reference.len() * 4) as f64).log10()
}

#[test]
fn the_volume_is_near_a_ray_marched_reference() {
    let scene = ocean(ONE_DEGREE);
    // A coast, sinks and sources.
    let job = job(Mode::Volume, globe(-122.0, 27.0, 2.2e6, 80));
    let truth = reference(&job, &scene);
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let measured = |change: fn(&mut RenderJob)| {
        let mut job = job.clone();
        change(&mut job);
        psnr_db(&renderer.render(&job, &scene).unwrap(), &truth)
    };
    let full = measured(|_| {});
    let few = measured(|job| job.style.slices = 2);
    let other_light = measured(|job| job.style.sun.azimuth_deg += 180.0);
    let sprites = measured(|job| job.mode = Mode::Sprites);
    let fine = measured(|job| job.style.slices = 256);
    println!(
        "PSNR against the float64 reference: {full:.2} dB at 64 slices, {fine:.2} dB at 256, {few:.2} dB at 2, {other_light:.2} dB lit from the other side, {sprites:.2} dB for unlit sprites"
    );
    assert!(full >= 38.0, "{full} dB at 64 slices");
    assert!(fine > full, "more slices come nearer: {fine} dB at 256");
    // The number sees what it should see.
    for (worse, what) in [
        (few, "2 slices"),
        (other_light, "light from the other side"),
        (sprites, "sprites"),
    ] {
        assert!(
            worse < full - 4.0,
            "{worse} dB with {what}, {full} dB without"
        );
    }
}
