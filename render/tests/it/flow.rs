//! What must be true of particles that drift, whoever draws them: closed forms, coasts, seams, and no popping.

use std::f64::consts::TAU;

use contract::earth::SPHERE_RADIUS_M;
use contract::grid::Grid;
use contract::job::{RenderJob, View};
use glam::{DVec3, Vec2};
use render::plan::Plan;
use render::stages::flow::cpu::{self, Inputs, Trail, VectorField};
use render::stages::interpolate::cpu::interpolate;
use render::stages::layout::{Particle, Splat, Velocity};
use render::stages::params::Params;
use render::stages::project;
use render::{Image, RenderError, Renderer, Scene};
use render_proof::currents::{self, Vector, gyres};

use crate::compare::assert_images_differ;
use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE, globe, ocean, tile};

/// The dots of a picture as the twins make them.
struct Dots {
    plan: Plan,
    params: Params,
    velocity: Vec<Velocity>,
    grid: Grid,
    particles: Vec<Particle>,
}

impl Dots {
    fn of(scene: &Scene, job: &RenderJob) -> Self {
        let plan = Plan::new(job, scene, u64::MAX).unwrap();
        let params = plan.params_of(plan.parts()[0]);
        let between = |interval: &render::Interval, weight| {
            let (before, after) = (&interval.before.cells, &interval.after.cells);
            let mut between = vec![0.0; scene.grid.cell_count()];
            interpolate(
                &params,
                weight,
                before.content(),
                after.content(),
                &mut between,
            );
            between
        };
        let east = between(&scene.value, params.values.weight);
        let northward = scene.northward.as_ref().unwrap();
        let north = between(northward, params.values.northward_weight);
        let mut dots = Self {
            velocity: cpu::velocities(&east, &north),
            particles: vec![
                Particle::default();
                plan.active.len() * params.cells.particles_per_cell as usize
            ],
            grid: scene.grid,
            plan,
            params,
        };
        let mut particles = std::mem::take(&mut dots.particles);
        let inputs = Inputs {
            active: &dots.plan.active,
            field: dots.field(),
            palette: &dots.plan.palette,
        };
        cpu::trails(&dots.params, &inputs, &mut particles);
        dots.particles = particles;
        dots
    }

    fn field(&self) -> VectorField<'_> {
        VectorField {
            params: &self.params,
            rows: &self.plan.rows,
            velocity: &self.velocity,
        }
    }

    /// Longitude and latitude of a dot, degrees.
    fn place(&self, dot: &Particle) -> [f64; 2] {
        let grid = &self.grid;
        let col = f64::from(self.plan.cols[dot.slot as usize].index) + f64::from(dot.east);
        let row = f64::from(dot.row) + f64::from(dot.south);
        [
            grid.west_deg + col * grid.dlon_deg,
            grid.north_deg - row * grid.dlat_deg,
        ]
    }

    /// The foremost dot of every trail.
    fn heads(&self) -> impl Iterator<Item = &Particle> {
        let each = self.params.cells.particles_each as usize;
        self.particles.iter().skip(each - 1).step_by(each)
    }

    fn splats(&self) -> Vec<Splat> {
        let mut splats = vec![Splat::default(); self.particles.len()];
        let (rows, cols) = (&self.plan.rows, &self.plan.cols);
        project::cpu::project(&self.params, rows, cols, &self.particles, &mut splats);
        splats
    }
}

/// East of 0 E, 0 N towards y, the north pole towards z.
fn on_sphere([lon_deg, lat_deg]: [f64; 2]) -> DVec3 {
    let (lon, lat) = (lon_deg.to_radians(), lat_deg.to_radians());
    DVec3::new(lat.cos() * lon.cos(), lat.cos() * lon.sin(), lat.sin())
}

/// The velocity of a globe that turns once in `period_s` about an axis tilted towards 0 E.
fn solid_body(tilt_deg: f64, period_s: f64) -> impl Fn(f64, f64) -> Option<Vector> + Copy {
    let axis = on_sphere([0.0, 90.0 - tilt_deg]);
    move |lon_deg, lat_deg| {
        let place = on_sphere([lon_deg, lat_deg]);
        let velocity = axis.cross(place) * (SPHERE_RADIUS_M * TAU / period_s);
        let east = DVec3::new(-lon_deg.to_radians().sin(), lon_deg.to_radians().cos(), 0.0);
        let north = place.cross(east);
        Some([velocity.dot(east), velocity.dot(north)])
    }
}

/// Turned about an axis (Rodrigues).
fn turned_about(axis: DVec3, angle: f64, place: DVec3) -> DVec3 {
    place * angle.cos()
        + axis.cross(place) * angle.sin()
        + axis * axis.dot(place) * (1.0 - angle.cos())
}

fn kilometres(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b)) * SPHERE_RADIUS_M / 1000.0
}

/// Of a tile that shows most of an ocean.
const VIEW: fn() -> View = || tile(3, 1, 3, 256);
/// Heads paler than this are young or about to fade, and may be born anew in the days that are compared.
const LEAST_DEPTH: f32 = 0.25;

#[test]
fn a_uniform_eastward_current_moves_particles_by_its_way_over_the_circle_of_latitude() {
    let eastward = |_lon, _lat| Some([0.8, 0.0]);
    let scene = currents::scene(ONE_DEGREE, eastward, eastward);
    let day_s = 86_400.0;
    let [before, after] =
        [1e8, 1e8 + day_s].map(|clock_s| Dots::of(&scene, &currents::job(VIEW(), clock_s)));
    let (mut compared, mut worst) = (0, 0.0f64);
    for (a, b) in before.heads().zip(after.heads()) {
        if a.depth.min(b.depth) < LEAST_DEPTH {
            continue;
        }
        let ([lon, lat], [later_lon, later_lat]) = (before.place(a), after.place(b));
        let expected_rad = 0.8 * day_s / (SPHERE_RADIUS_M * lat.to_radians().cos());
        worst = worst.max(((later_lon - lon) / expected_rad.to_degrees() - 1.0).abs());
        assert!((later_lat - lat).abs() < 1e-6, "{lat} to {later_lat}");
        compared += 1;
    }
    println!("{compared} particles, farthest off by {worst:.1e} of their way");
    assert!(compared > 500 && worst < 1e-3, "{compared}, {worst}");
}

#[test]
fn a_turning_globe_takes_particles_where_the_rotation_does() {
    // 0.9 m/s on the axis' equator, which runs through both hemispheres and over the date line.
    let period_s = TAU * SPHERE_RADIUS_M / 0.9;
    let field = solid_body(40.0, period_s);
    let scene = currents::scene(ONE_DEGREE, field, field);
    let axis = on_sphere([0.0, 50.0]);
    let days_s = 2.0 * 86_400.0;
    for view in [tile(3, 0, 3, 256), tile(3, 4, 4, 256)] {
        let [before, after] =
            [3e8, 3e8 + days_s].map(|clock_s| Dots::of(&scene, &currents::job(view, clock_s)));
        let (mut compared, mut worst_km, mut moved_km) = (0, 0.0f64, 0.0f64);
        for (a, b) in before.heads().zip(after.heads()) {
            if a.depth.min(b.depth) < LEAST_DEPTH {
                continue;
            }
            let (start, end) = (on_sphere(before.place(a)), on_sphere(after.place(b)));
            let expected = turned_about(axis, TAU * days_s / period_s, start);
            worst_km = worst_km.max(kilometres(end, expected));
            moved_km = moved_km.max(kilometres(end, start));
            compared += 1;
        }
        println!("{compared} particles moved up to {moved_km:.1} km, off by {worst_km:.3} km");
        assert!(compared > 300 && moved_km > 100.0 && worst_km < 0.3);
    }
}

#[test]
fn a_whole_turn_brings_a_particle_back_to_where_it_was() {
    let period_s = TAU * SPHERE_RADIUS_M / 0.9;
    let field = solid_body(30.0, period_s);
    let scene = currents::scene(ONE_DEGREE, field, field);
    let dots = Dots::of(&scene, &currents::job(VIEW(), 0.0));
    // The other way round: m/s and columns a life.
    let life_s = f64::from(dots.params.flow.rows_per_m_s)
        * SPHERE_RADIUS_M
        * ONE_DEGREE.dlat_deg.to_radians();
    let start = Trail {
        row: 80,
        col: 175,
        place: Vec2::splat(0.5),
        age: 0.0,
        open: 1.0,
    };
    let off_km = |share: f64, steps| {
        let end = dots.field().carried(start, share as f32, steps);
        let place = |at: Vec2| {
            let [col, row] = [175.0 + f64::from(at.x), 80.0 + f64::from(at.y)];
            on_sphere([-180.0 + col, 90.0 - row])
        };
        kilometres(place(start.place), place(end.place))
    };
    let turn = period_s / life_s;
    let (fine, coarse) = (off_km(turn, 1440), off_km(turn, 60));
    println!(
        "a whole turn of 40 030 km ends {fine:.1} km away in steps of 28 km, {coarse:.0} km in 667 km"
    );
    assert!(fine < 60.0 && fine < coarse, "{fine} {coarse}");
    assert!(off_km(0.5 * turn, 1440) > 5000.0, "half a turn is seen");
}

#[test]
fn no_particle_is_drawn_on_land() {
    let scene = gyres(ONE_DEGREE);
    let dots = Dots::of(&scene, &currents::job(tile(1, 0, 0, 512), 2e8));
    let domain = scene.domain.content();
    let is_land = |row: i32, col: i32| {
        let col = col.rem_euclid(360);
        (0..180).contains(&row) && domain[(row * 360 + col) as usize] == 0
    };
    let (mut at_sea, mut near, mut inland) = (0, 0, 0);
    for dot in dots.particles.iter().filter(|dot| dot.depth > 0.0) {
        let [lon, lat] = dots.place(dot);
        let (row, col) = ((90.0 - lat).floor() as i32, (lon + 180.0).floor() as i32);
        let all_round = || {
            let mut cells = (-1..=1).flat_map(|y| (-1..=1).map(move |x| (y, x)));
            cells.all(|(y, x)| is_land(row + y, col + x))
        };
        match (is_land(row, col), all_round()) {
            (false, _) => at_sea += 1,
            (true, false) => near += 1,
            (true, true) => inland += 1,
        }
    }
    assert!(at_sea > 30_000, "{at_sea}");
    // In the corner of a cell of land with sea on three sides.
    assert!(near < at_sea / 50, "{near} of {at_sea}");
    assert_eq!(inland, 0);
    for renderer in renderers("land") {
        let job = currents::job(tile(5, 24, 10, 256), 2e8);
        let image = renderer.render(&job, &scene).unwrap();
        assert!(image.alpha().all(|alpha| alpha == 0));
    }
}

/// The four 256 tiles below a tile as one picture.
fn children(renderer: &Renderer, scene: &Scene, [z, x, y]: [u32; 3]) -> Image {
    let mut rgba8 = vec![0; 512 * 512 * 4];
    for (east, south) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let view = tile(z as u8 + 1, 2 * x + east, 2 * y + south, 256);
        let child = renderer.render(&currents::job(view, 5e7), scene).unwrap();
        for (row, pixels) in (0..).zip(child.rgba8.chunks_exact(256 * 4)) {
            let at = ((south as usize * 256 + row) * 512 + east as usize * 256) * 4;
            rgba8[at..at + 1024].copy_from_slice(pixels);
        }
    }
    Image {
        width: 512,
        height: 512,
        rgba8,
    }
}

#[test]
fn a_large_tile_of_trails_is_its_four_children_to_the_byte() {
    let scene = gyres(ONE_DEGREE);
    for renderer in renderers("seams of trails") {
        // The whole world, the date line, the northern edge of the map, and far in.
        for [z, x, y] in [[0, 0, 0], [3, 0, 3], [2, 1, 0], [6, 12, 30]] {
            let job = currents::job(tile(z as u8, x, y, 512), 5e7);
            let large = renderer.render(&job, &scene).unwrap();
            let small = children(renderer, &scene, [z, x, y]);
            let bytes = large.rgba8.iter().zip(&small.rgba8);
            let differing = bytes.filter(|(a, b)| a != b).count();
            assert_eq!(differing, 0, "{} {z}/{x}/{y}", renderer.name());
            let seen = large.alpha().filter(|alpha| *alpha > 60).count();
            assert!(seen > 2000, "{z}/{x}/{y} shows trails: {seen}");
        }
    }
}

/// Farthest that a dot goes between two clocks, pixels, and its largest change of depth, palest dots left out.
fn popping(scene: &Scene, view: View, clocks_s: [f64; 2]) -> (f64, f32) {
    let [a, b] = clocks_s.map(|clock_s| Dots::of(scene, &currents::job(view, clock_s)).splats());
    let (mut farthest_px, mut most_depth) = (0.0f64, 0.0f32);
    for (a, b) in a.iter().zip(&b) {
        if a.tau.max(b.tau) < 0.02 {
            continue;
        }
        let [x, y] = [a.x_sub - b.x_sub, a.y_sub - b.y_sub].map(f64::from);
        farthest_px = farthest_px.max(x.hypot(y) / 16.0);
        most_depth = most_depth.max((a.tau - b.tau).abs());
    }
    (farthest_px, most_depth)
}

#[test]
fn a_little_later_every_dot_is_a_little_farther_or_too_pale_to_be_seen() {
    let scene = gyres(ONE_DEGREE);
    let view = VIEW();
    // A life is some eighteen days in this view: over a thousandth of it, all the way through one life.
    for start_s in [0.0, 4e5, 8e5, 1.2e6] {
        let (farthest_px, most_depth) = popping(&scene, view, [start_s, start_s + 300.0]);
        println!("in 300 s at {start_s} s: {farthest_px:.2} px, depth {most_depth:.3}");
        assert!(farthest_px < 0.3 && most_depth < 0.06);
    }
    let (farthest_px, most_depth) = popping(&scene, view, [0.0, 3e5]);
    assert!(farthest_px > 10.0 && most_depth > 0.1, "a jump is seen");
}

#[test]
fn the_clock_and_the_field_change_the_picture_and_nothing_else_does() {
    let scene = gyres(FIVE_DEGREES);
    for renderer in renderers("clock") {
        for view in [tile(2, 0, 1, 256), globe(-120.0, 10.0, 1.5e7, 200)] {
            let draw = |clock_s| {
                renderer
                    .render(&currents::job(view, clock_s), &scene)
                    .unwrap()
            };
            let first = draw(1e7);
            assert_images_differ(&first, &draw(4e7));
            assert!(first == draw(1e7), "equal instants are equal bytes");
        }
    }
}

#[test]
fn speeds_beyond_all_reason_and_fields_of_nothing_are_drawn_quietly() {
    let far = |_lon, _lat| Some([9e9, -9e9]);
    let none = |_lon, _lat| None;
    let grids = [
        FIVE_DEGREES,
        Grid {
            rows: 1,
            cols: 12,
            north_deg: 2.0,
            west_deg: -180.0,
            dlat_deg: 4.0,
            dlon_deg: 30.0,
        },
        Grid {
            rows: 10,
            cols: 20,
            north_deg: 90.0,
            west_deg: 170.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        },
    ];
    for renderer in renderers("hostile flows") {
        for grid in grids {
            for view in [
                tile(0, 0, 0, 256),
                tile(16, 65_535, 30_000, 256),
                globe(175.0, 88.0, 2e6, 64),
            ] {
                let draw = |field: &dyn Fn(f64, f64) -> Option<Vector>, top: f64, clock_s: f64| {
                    let mut job = currents::job(view, clock_s);
                    job.style.transfer.high = top;
                    let scene = currents::scene(grid, field, field);
                    renderer.render(&job, &scene).unwrap()
                };
                assert!(draw(&none, 1.5, 0.0).alpha().all(|alpha| alpha == 0));
                for (top, clock_s) in [(1.5, 1e12), (1e-29, -1e12), (1e20, 1e12)] {
                    let image = draw(&far, top, clock_s);
                    assert_eq!([image.width, image.height], view.size_px());
                }
            }
        }
    }
}

#[test]
fn a_globe_from_near_has_room_for_the_cells_in_sight_alone_and_shows_them_all() {
    let scene = gyres(ONE_DEGREE);
    for (lon, lat) in [(-120.0, 10.0), (179.0, -60.0), (20.0, 84.0)] {
        let plan = |height_m| {
            let job = currents::job(globe(lon, lat, height_m, 512), 0.0);
            Plan::new(&job, &scene, u64::MAX).unwrap()
        };
        let near = plan(2.5e6);
        // Every cell whose middle lies in the cap has its column.
        let in_cap = |row: u32, col: u32| {
            let place = ONE_DEGREE.cell_center(row, col);
            let [x, y, z] = on_sphere([place.lon, place.lat]).to_array();
            let eye = [
                near.params.view.eye.y,
                near.params.view.eye.x,
                near.params.view.eye.z,
            ]
            .map(f64::from);
            x * eye[0] + y * eye[1] + z * eye[2] > f64::from(near.params.view.cap_least) + 1e-6
        };
        let listed = |col: u32| near.cols.iter().any(|own| own.index == col);
        let mut seen = 0;
        for (row, col) in (0..180).flat_map(|row| (0..360).map(move |col| (row, col))) {
            if in_cap(row, col) {
                assert!(listed(col), "{row} {col} from {lon} {lat}");
                seen += 1;
            }
        }
        assert!(seen > 500);
        let is_polar = lat > 80.0;
        assert_eq!(near.cols.len() < 200, !is_polar, "{}", near.cols.len());
    }
    for renderer in renderers("near globes") {
        let job = currents::job(globe(-120.0, 10.0, 2.5e6, 512), 1e7);
        let image = renderer.render(&job, &scene).unwrap();
        assert!(image.alpha().filter(|alpha| *alpha > 60).count() > 50_000);
    }
}

#[test]
fn a_flow_without_its_northward_part_is_refused() {
    let renderer = renderers("parts")[0];
    let job = currents::job(VIEW(), 0.0);
    let refused = renderer.render(&job, &ocean(FIVE_DEGREES)).unwrap_err();
    assert!(matches!(refused, RenderError::NoNorthward), "{refused}");
    assert!(refused.is_bad_request() && refused.is_final() && !refused.is_retryable());
}
