//! What must be true whoever draws: closed forms and values worked out by hand.

use std::sync::Arc;

use contract::job::{Mode, RenderJob};
use glam::{UVec2, Vec2, Vec3, Vec4};
use render::plan::Plan;
use render::pyramid::coarser;
use render::scene::{Field, Interval, Scene};
use render::stages::eye::cpu::Hiding;
use render::stages::interpolate::cpu::interpolated;
use render::stages::layout::{
    Active, COVERED, Col, Entry, KERNEL_CLOUD, MISSING, Particle, Row, SCREEN_TILE_PX, SLOPE_ONE,
    SUBPIXELS, Splat, VIEW_GLOBE, is_missing,
};
use render::stages::light::params::LightParams;
use render::stages::params::{Params, ViewParams};
use render::stages::particles::cpu::{Inputs, envelope, generate};
use render::stages::sizes::{list_count, texel_count};
use render::stages::{bin, eye, light, project};

use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, GRAM_A_YEAR, ONE_DEGREE, job, ocean, tile};

#[test]
fn a_quarter_of_the_way_from_two_to_six_is_three() {
    assert!((interpolated(2.0, 6.0, 0.25) - 3.0).abs() < 1e-6);
    assert!((interpolated(2.0, MISSING, 0.0) - 2.0).abs() < 1e-6);
    assert!(is_missing(interpolated(2.0, MISSING, 0.25)));
}

#[test]
fn a_place_on_the_globe_is_seen_where_equation_4_puts_it() {
    // The camera stands two radii from the centre above 0 N 0 E and looks along -Y; 100 pixels of focal length.
    let mut params = Params {
        view: ViewParams {
            kind: VIEW_GLOBE,
            focal_px: 100.0,
            eye: Vec3::Y * 2.0,
            right: Vec3::X,
            up: Vec3::Z,
            forward: -Vec3::Y,
            slices: 64,
            hides: 1.0,
            ..ViewParams::default()
        },
        ..Params::default()
    };
    params.lighting.unit = 256;
    params.projection.max_radius_px = 1e4;
    params.projection.per_earth_radius_m = 1.0 / 6_371_000.0;
    let (lon, lat, height_m) = (20f64.to_radians(), -35f64.to_radians(), 500_000.0);
    let row = Row {
        sin_lat: lat.sin() as f32,
        cos_lat: lat.cos() as f32,
        radius: 0.01,
        depth_gain: 1.0,
        ..Row::default()
    };
    let col = Col {
        sin_lon: lon.sin() as f32,
        cos_lon: lon.cos() as f32,
        ..Col::default()
    };
    let particle = Particle {
        east: 0.5,
        south: 0.5,
        height_m: height_m as f32,
        depth: 1.0,
        ..Particle::default()
    };
    let mut splats = [Splat::default()];
    project::cpu::project(&params, &[row], &[col], &[particle], &mut splats);
    let r = 1.0 + height_m / 6_371_000.0;
    let (x, y, z) = (
        r * lat.cos() * lon.sin(),
        r * lat.cos() * lon.cos(),
        r * lat.sin(),
    );
    let expected =
        [100.0 * x / (2.0 - y), -100.0 * z / (2.0 - y)].map(|px| px * f64::from(SUBPIXELS));
    assert!(
        (f64::from(splats[0].x_sub) - expected[0]).abs() <= 1.0
            && (f64::from(splats[0].y_sub) - expected[1]).abs() <= 1.0
    );
    assert!(splats[0].tau > 0.0);
    // On the far side nothing is seen of the same particle.
    let far = Col {
        sin_lon: 0.0,
        cos_lon: -1.0,
        ..Col::default()
    };
    project::cpu::project(&params, &[row], &[far], &[particle], &mut splats);
    assert!(splats[0].tau.abs() < f32::EPSILON);
}

/// Particles of every cell of the domain.
fn all_particles(scene: &Scene, job: &RenderJob, carbon: &[f32]) -> (Plan, Vec<Particle>) {
    let mut plan = Plan::new(job, scene, u64::MAX).unwrap();
    let domain = scene.domain.content();
    let cells = 0..scene.grid.cell_count() as u32;
    plan.active = cells
        .filter(|&cell| domain[cell as usize] != 0)
        .map(|cell| Active { cell, slot: 0 })
        .collect();
    plan.params.cells.particles_per_cell = 7;
    plan.params.cells.particle_shares = 7.0;
    let mut particles = vec![Particle::default(); plan.active.len() * 7];
    let value: Vec<f32> = scene.value.before.cells.content().to_vec();
    let inputs = Inputs {
        active: &plan.active,
        rows: &plan.rows,
        value: &value,
        accumulated: carbon,
        palette: &plan.palette,
        uncertainty: &[],
        domain,
    };
    generate(&plan.params, &inputs, &mut particles);
    (plan, particles)
}

#[test]
fn the_mass_of_all_particles_is_the_accumulated_carbon() {
    let scene = ocean(ONE_DEGREE);
    let carbon = scene
        .accumulated
        .as_ref()
        .unwrap()
        .after
        .cells
        .content()
        .to_vec();
    let (_, particles) = all_particles(&scene, &job(Mode::Volume, tile(0, 0, 0, 256)), &carbon);
    let mass_kg: f64 = particles
        .iter()
        .map(|particle| f64::from(particle.mass_kg))
        .sum();
    let area = |cell: usize| {
        scene
            .grid
            .cell_area_m2(cell as u32 / scene.grid.cols, contract::earth::Earth::Wgs84)
    };
    let has_data = |(_, carbon): &(usize, &f32)| !is_missing(**carbon);
    let expected: f64 = carbon
        .iter()
        .enumerate()
        .filter(has_data)
        .map(|(cell, kg_m2)| f64::from(*kg_m2) * area(cell))
        .sum();
    println!("mass of the particles {mass_kg:.6e} kg, accumulated carbon {expected:.6e} kg");
    assert!((mass_kg / expected - 1.0).abs() < 1e-6 && expected.abs() > 1e9);
}

#[test]
fn particles_rise_where_carbon_leaves_the_sea_and_sink_where_it_enters_as_fast_as_the_flux() {
    let scene = ocean(FIVE_DEGREES);
    let job = job(Mode::Volume, tile(0, 0, 0, 256));
    let carbon = scene
        .accumulated
        .as_ref()
        .unwrap()
        .after
        .cells
        .content()
        .to_vec();
    let later = |factor: f32| {
        carbon
            .iter()
            .map(|kg| if is_missing(*kg) { *kg } else { kg * factor })
            .collect::<Vec<_>>()
    };
    let (plan, now) = all_particles(&scene, &job, &carbon);
    let (_, soon) = all_particles(&scene, &job, &later(1.0001));
    let (_, then) = all_particles(&scene, &job, &later(1.0002));
    let (mut up, mut down) = (0, 0);
    for (i, (now, soon)) in now.iter().zip(&soon).enumerate() {
        let moved = f64::from(soon.height_m - now.height_m);
        if moved.abs() > 1e5 {
            continue; // it left its column at one end and entered at the other
        }
        let kg = carbon[plan.active[i / 7].cell as usize];
        up += usize::from(kg > 0.02 && moved > 0.0);
        down += usize::from(kg < -0.02 && moved < 0.0);
        assert!(
            kg.abs() < 0.02 || moved * f64::from(kg) > 0.0,
            "{kg} kg moved {moved} m"
        );
        let again = f64::from(then[i].height_m - soon.height_m);
        assert!(
            again.abs() > 1e5 || (again - moved).abs() < 0.15 * moved.abs() + 2.0,
            "as far again in the same time"
        );
    }
    assert!(up > 500 && down > 500);
}

#[test]
fn the_envelope_of_a_column_has_mean_one() {
    let mean: f32 = (0..1000)
        .map(|i| envelope((i as f32 + 0.5) / 1000.0))
        .sum::<f32>()
        / 1000.0;
    assert!((mean - 1.0).abs() < 1e-3);
    assert_eq!((envelope(0.0), envelope(1.0)), (0.0, 0.0));
}

#[test]
fn a_uniform_slab_dims_light_as_exp_of_minus_its_depth() {
    let (slices, depth) = (16, 2.0f32);
    let mut params = Params::default();
    params.view.slices = slices;
    params.lighting = LightParams {
        size: UVec2::splat(6),
        layers: slices,
        part: 1.0,
        sunward_per_slice: 1.0,
        deeper: 1.0,
        unit: 16,
        ambient: 0.0,
        direct: 1.0,
        night: 1.0,
        depth_one: 4096.0,
        ..LightParams::default()
    };
    let per_slice = depth / slices as f32;
    let splat = |x: i32, y: i32, slice: f32| Splat {
        tau: 1.0,
        slice,
        light_u: x * 16,
        light_v: y * 16,
        light_depth: per_slice,
        day: 1.0,
        colour: 0xffff_ffff,
        ..Splat::default()
    };
    let cells = (0..6).flat_map(|y| (0..6).map(move |x| (x, y)));
    let mut splats: Vec<Splat> = cells
        .flat_map(|(x, y)| (0..slices).map(move |slice| splat(x, y, slice as f32 + 0.5)))
        .collect();
    let mut buffer = vec![0; texel_count(&params)];
    light::cpu::deposit(&params, &splats, &mut buffer);
    let given: f64 = buffer.iter().map(|&depth| f64::from(depth)).sum::<f64>()
        / f64::from(params.lighting.depth_one);
    let had = splats.len() as f64 * f64::from(per_slice);
    assert!(
        (given / had - 1.0).abs() < 1e-3,
        "nothing is lost or made: {given} of {had}"
    );
    light::cpu::prefix(&params, &mut buffer);
    light::cpu::shade(&params, &buffer, &mut splats);
    for splat in &splats {
        let expected = (-depth * splat.slice / slices as f32).exp();
        // Colours are coded by the square root of their light.
        let drawn = ((splat.colour & 255) as f32 / 255.0).powi(2);
        assert!(
            (drawn - expected).abs() <= 1.1 / 255.0 + 1e-3,
            "{drawn} against {expected}"
        );
        assert!(drawn <= 1.0);
    }
}

/// A picture of clouds, this many pixels a side, slices blended away from the eye.
fn clouds(side_px: u32) -> Params {
    let mut params = Params::default();
    params.view.size_px = UVec2::splat(side_px);
    params.view.slices = 4;
    params.view.front_to_back = 1;
    params.lists.kernel = KERNEL_CLOUD;
    params.lists.depth_one = 4096.0;
    params
}

/// Binned and seen by the eye.
fn seen(params: &mut Params, splats: &[Splat]) -> Vec<Vec4> {
    seen_over(params, splats, &[])
}

/// The same over a ground with this mask.
fn seen_over(params: &mut Params, splats: &[Splat], coast: &[u32]) -> Vec<Vec4> {
    params.view.tiles = (params.view.size_px + SCREEN_TILE_PX - 1) / SCREEN_TILE_PX;
    let mut ends = vec![0; list_count(params) as usize];
    bin::cpu::count(params, splats, &mut ends);
    let mut entries = vec![Entry::default(); bin::cpu::scan(&mut ends) as usize];
    bin::cpu::scatter(params, splats, &mut ends, &mut entries);
    let mut picture = vec![Vec4::ZERO; params.view.size_px.element_product() as usize];
    let hiding = Hiding { coast, trails: &[] };
    eye::cpu::eye(params, &ends, &entries, hiding, &mut picture);
    picture
}

#[test]
fn one_cloud_is_an_analytic_disc() {
    let mut params = clouds(40);
    let splat = Splat {
        x_sub: 19 * 16,
        y_sub: 21 * 16 + 8,
        radius_px: 12.5,
        tau: 1.75,
        slice: 2.5,
        colour: 0x0040_80ff,
        ..Splat::default()
    };
    let picture = seen(&mut params, &[splat]);
    for y in 0..40 {
        for x in 0..40 {
            let (dx, dy) = (f64::from(x) + 0.5 - 19.0, f64::from(y) + 0.5 - 21.5);
            let q = (dx * dx + dy * dy) / (12.5 * 12.5);
            let expected = 1.0 - (-1.75 * (1.0 - q).max(0.0).powi(2)).exp();
            let colour = picture[(y * 40 + x) as usize];
            assert!(
                (f64::from(colour.w) - expected).abs() < 3e-4,
                "{x} {y}: {} against {expected}",
                colour.w
            );
            assert!((f64::from(colour.x) - expected).abs() < 5e-4 && colour.z <= colour.w);
        }
    }
}

#[test]
fn a_cloud_is_as_much_brighter_away_from_the_middle_of_the_earth_as_its_slope_says() {
    let mut params = clouds(40);
    params.view.kind = VIEW_GLOBE;
    // Straight down: the middle of the earth is seen in the middle of the picture.
    params.view.eye = Vec3::new(0.0, 0.0, 2.0);
    params.view.right = Vec3::X;
    params.view.up = Vec3::Y;
    params.view.forward = -Vec3::Z;
    params.view.focal_px = 50.0;
    params.view.center_px = Vec2::splat(20.0);
    let cloud = |x: i32, y: i32, slope: i32| Splat {
        x_sub: x * 16,
        y_sub: y * 16,
        radius_px: 10.0,
        tau: 0.8,
        slice: 2.5,
        colour: 0x0080_8080,
        slope,
        ..Splat::default()
    };
    // To the right of it, and above it, half as bright again a radius farther out.
    for (x, y, out) in [(28, 20, Vec2::X), (20, 12, Vec2::NEG_Y)] {
        let level = seen(&mut params, &[cloud(x, y, 0)]);
        let sloping = seen(&mut params, &[cloud(x, y, (0.5 * SLOPE_ONE) as i32)]);
        for off in [
            Vec2::ZERO,
            Vec2::new(4.0, 0.0),
            Vec2::new(-4.0, 3.0),
            Vec2::new(0.0, -6.0),
        ] {
            let at = Vec2::new(x as f32, y as f32) + off;
            let pixel = at.y as usize * 40 + at.x as usize;
            let ratio = sloping[pixel].x / level[pixel].x;
            let expected = 1.0 + 0.5 * (off + 0.5).dot(out) / 10.0;
            assert!(
                (ratio - expected).abs() < 5e-3,
                "{off}: {ratio} against {expected}"
            );
            assert!((sloping[pixel].w - level[pixel].w).abs() < 1e-6);
        }
    }
}

#[test]
fn land_hides_what_is_beyond_behind_it_and_nothing_else() {
    let mut params = clouds(40);
    params.in_context = true;
    params.context.land_hides = 1;
    params.context.coast_row_words = 40;
    // Sea, half land, land.
    let share = |x: usize| [0u32, 128, 255][x / 14];
    let coast: Vec<u32> = (0..1600).map(|at| share(at % 40)).collect();
    let cloud = |is_beyond: u32| Splat {
        x_sub: 20 * 16,
        y_sub: 20 * 16,
        radius_px: 25.0,
        tau: 1.0,
        slice: 2.5,
        colour: 0x00ff_ffff,
        is_beyond,
        ..Splat::default()
    };
    let risen = seen_over(&mut params, &[cloud(0)], &coast);
    let sunk = seen_over(&mut params, &[cloud(1)], &coast);
    let depth = |picture: &[Vec4], x: usize| -(1.0 - picture[20 * 40 + x].w).ln();
    for (x, kept) in [(10, 1.0), (16, 127.0 / 255.0), (30, 0.0)] {
        let of_all = depth(&sunk, x) / depth(&risen, x);
        assert!((of_all - kept).abs() < 2e-3, "{x}: {of_all}");
    }
    params.context.land_hides = 0;
    assert_eq!(seen_over(&mut params, &[cloud(1)], &coast), risen);
}

#[test]
fn the_order_of_slices_matters_and_the_order_within_one_does_not() {
    let mut params = clouds(8);
    let splat = |slice: f32, colour: u32| Splat {
        x_sub: 64,
        y_sub: 64,
        radius_px: 20.0,
        tau: 2.0,
        slice,
        colour,
        ..Splat::default()
    };
    let (red, blue) = (0x0000_00ff, 0x00ff_0000);
    let center = |params: &mut Params, splats: &[Splat]| seen(params, splats)[4 * 8 + 4];
    let red_first = center(&mut params, &[splat(0.5, red), splat(2.5, blue)]);
    assert!(
        red_first.x > 3.0 * red_first.z,
        "the first slice hides the second: {red_first}"
    );
    params.view.front_to_back = 0;
    let red_last = center(&mut params, &[splat(0.5, red), splat(2.5, blue)]);
    assert!(red_last.z > 3.0 * red_last.x && (red_last.w - red_first.w).abs() < 1e-6);
    let mixed = center(&mut params, &[splat(1.2, red), splat(1.7, blue)]);
    assert_eq!(
        mixed,
        center(&mut params, &[splat(1.7, blue), splat(1.2, red)])
    );
    assert!((mixed.x - mixed.z).abs() < 1e-6);
}

#[test]
fn a_sea_of_full_flux_has_the_optical_depth_of_the_style() {
    let grid = ONE_DEGREE;
    let full = Arc::new(Field::new(vec![
        (60.0 * GRAM_A_YEAR) as f32;
        grid.cell_count()
    ]));
    let value = Interval {
        before: Arc::clone(&full),
        after: full,
        weight: 0.5,
    };
    let domain = Scene::domain_of((0..grid.cell_count()).map(|_| true));
    let scene = Scene {
        grid,
        domain,
        value,
        accumulated: None,
        terrain: None,
        northward: None,
        trails: None,
        whole: None,
    };
    for renderer in renderers("optical depth") {
        for (z, x, y) in [(3, 1, 3), (5, 7, 12), (6, 12, 28)] {
            let mut job = job(Mode::Volume, tile(z, x, y, 256));
            job.accumulated = None;
            job.style.optical_depth = 0.8;
            let image = renderer.render(&job, &scene).unwrap();
            let depth = |alpha: u8| -(1.0 - f64::from(alpha.min(254)) / 255.0).ln();
            let mean = image.alpha().map(depth).sum::<f64>() / (256.0 * 256.0);
            // Particles are random: a few in the hundred.
            assert!(
                (mean / 0.8 - 1.0).abs() < 0.05,
                "{} z{z}: {mean}",
                renderer.name()
            );
        }
    }
}

/// A sea of full flux in every fourth cell, and the same in blocks, each a quarter covered.
fn quarter_sea() -> [Scene; 2] {
    let grid = ONE_DEGREE;
    let is_sea = |cell: usize| {
        let (row, col) = (cell / grid.cols as usize, cell % grid.cols as usize);
        row % 2 == 0 && col % 2 == 1
    };
    let flux = |cell: usize| {
        if is_sea(cell) {
            60.0 * GRAM_A_YEAR
        } else {
            f64::NAN
        }
    };
    let cells = 0..grid.cell_count();
    let field = Arc::new(Field::new(cells.map(|cell| flux(cell) as f32).collect()));
    let scene = Scene {
        grid,
        domain: Scene::domain_of((0..grid.cell_count()).map(is_sea)),
        value: Interval {
            before: Arc::clone(&field),
            after: field,
            weight: 0.5,
        },
        accumulated: None,
        terrain: None,
        northward: None,
        trails: None,
        whole: None,
    };
    let blocks = coarser(&scene).unwrap();
    [scene, blocks]
}

#[test]
fn a_block_that_is_a_quarter_sea_is_drawn_with_a_quarter_of_the_depth_and_of_the_alpha() {
    let [fine, blocks] = quarter_sea();
    for renderer in renderers("quarters") {
        let drawn = |mode, scene: &Scene| {
            // Some 8 pixels a cell.
            let mut job = job(mode, tile(3, 1, 3, 256));
            job.accumulated = None;
            job.style.optical_depth = 0.8;
            renderer.render(&job, scene).unwrap()
        };
        let depth = |scene: &Scene| {
            let depth = |alpha: u8| -(1.0 - f64::from(alpha.min(254)) / 255.0).ln();
            let image = drawn(Mode::Volume, scene);
            image.alpha().map(depth).sum::<f64>() / (256.0 * 256.0)
        };
        let (of_cells, of_blocks) = (depth(&fine), depth(&blocks));
        let name = renderer.name();
        assert!((of_blocks / 0.2 - 1.0).abs() < 0.05, "{name}: {of_blocks}");
        assert!(
            (of_blocks / of_cells - 1.0).abs() < 0.05,
            "{name}: {of_cells}"
        );
        let full = drawn(Mode::Map, &quarterless(&blocks));
        let quarter = drawn(Mode::Map, &blocks);
        let most = full.alpha().max().unwrap();
        assert!(most > 200, "{name}: {most}");
        for (full, quarter) in full.alpha().zip(quarter.alpha()) {
            let expected = f64::from(full) / 4.0;
            assert!(
                (f64::from(quarter) - expected).abs() <= 0.75,
                "{name}: {quarter}"
            );
        }
    }
}

/// The same blocks as if they were all sea.
fn quarterless(blocks: &Scene) -> Scene {
    Scene {
        domain: Scene::domain_of(blocks.domain.content().iter().map(|_| true)),
        ..blocks.clone()
    }
}

#[test]
fn coarser_scenes_keep_the_mass_of_the_carbon_and_the_mean_of_the_flux() {
    let scene = ocean(ONE_DEGREE);
    let coarse = coarser(&coarser(&scene).unwrap()).unwrap();
    assert_eq!((coarse.grid.rows, coarse.grid.cols), (45, 90));
    let mass_kg = |scene: &Scene| -> f64 {
        let area = |cell: usize| {
            let row = cell as u32 / scene.grid.cols;
            let share = f64::from(scene.domain.content()[cell]) / f64::from(COVERED);
            share * scene.grid.cell_area_m2(row, contract::earth::Earth::Wgs84)
        };
        let carbon = scene
            .accumulated
            .as_ref()
            .unwrap()
            .before
            .cells
            .content()
            .iter()
            .enumerate();
        let with_data = carbon.filter(|(_, kg)| !is_missing(**kg));
        with_data
            .map(|(cell, kg)| f64::from(*kg) * area(cell))
            .sum()
    };
    assert!((mass_kg(&coarse) / mass_kg(&scene) - 1.0).abs() < 1e-6);
    // Open sea: 30 S to 26 S, 150 W to 146 W.
    let block = coarse.value.before.cells.content()[30 * 90 + 7];
    let cells = (120..124).flat_map(|row| (28..32).map(move |col| (row, row as usize * 360 + col)));
    let [sum, whole_m2] = cells.fold([0.0; 2], |[sum, whole_m2], (row, cell)| {
        let area_m2 = scene.grid.cell_area_m2(row, contract::earth::Earth::Wgs84);
        let value = f64::from(scene.value.before.cells.content()[cell]);
        [sum + value * area_m2, whole_m2 + area_m2]
    });
    let mean = sum / whole_m2;
    assert!(
        (f64::from(block) / mean - 1.0).abs() < 1e-6,
        "{block} against {mean}"
    );
    // 45 rows from pole to pole cannot be halved.
    assert!(coarser(&coarse).is_none());
}

#[test]
fn a_grid_much_finer_than_the_screen_is_drawn_from_a_coarser_version_without_seams() {
    let grid = contract::grid::Grid {
        rows: 1230,
        cols: 900,
        north_deg: 41.0,
        west_deg: 100.0,
        dlat_deg: 1.0 / 30.0,
        dlon_deg: 1.0 / 30.0,
    };
    let scene = ocean(grid);
    for renderer in renderers("coarse") {
        for mode in Mode::SCALAR {
            let image = renderer
                .render(&job(mode, tile(0, 0, 0, 256)), &scene)
                .unwrap();
            let drawn = image.alpha().filter(|alpha| *alpha > 40).count();
            // 30 by 41 degrees are 21 by 34 pixels of the whole world.
            assert!(
                (200..1100).contains(&drawn),
                "{} {mode}: {drawn} pixels",
                renderer.name()
            );
        }
    }
}
