//! The limits of jobs and what bad or empty grids draw: nothing, quietly, or an error that says what to do.

use std::sync::Arc;

use contract::grid::Grid;
use contract::job::{Mode, View};
use render::gpu::Gpu;
use render::plan::Plan;
use render::scene::{Field, Interval, Scene};
use render::{Backend, RenderError, Renderer};

use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, globe, job, ocean, tile};

fn constant(grid: Grid, value: f32) -> Scene {
    let field = Arc::new(Field::new(vec![value; grid.cell_count()]));
    let value = Interval {
        before: Arc::clone(&field),
        after: field,
        weight: 0.4,
    };
    let domain = Scene::domain_of((0..grid.cell_count()).map(|_| true));
    Scene {
        grid,
        domain,
        value: value.clone(),
        accumulated: Some(value),
        terrain: None,
        northward: None,
        trails: None,
        whole: None,
    }
}

#[test]
fn grids_without_a_finite_number_draw_nothing() {
    for renderer in renderers("empty grids") {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -f32::MAX] {
            for mode in Mode::SCALAR {
                for view in [tile(1, 0, 0, 256), globe(0.0, 0.0, 1e7, 64)] {
                    let image = renderer
                        .render(&job(mode, view), &constant(FIVE_DEGREES, value))
                        .unwrap();
                    assert!(image.alpha().all(|alpha| alpha == 0), "{value} {mode}");
                }
            }
        }
    }
}

#[test]
fn land_and_the_sky_are_transparent() {
    let scene = ocean(FIVE_DEGREES);
    for renderer in renderers("land") {
        for mode in Mode::SCALAR {
            // Inside the large made-up continent, and above a globe of half the picture's height.
            let land = renderer
                .render(&job(mode, tile(5, 24, 10, 256)), &scene)
                .unwrap();
            assert!(land.alpha().all(|alpha| alpha == 0), "{mode}");
            let view = renderer
                .render(&job(mode, globe(-120.0, 0.0, 3e7, 64)), &scene)
                .unwrap();
            assert_eq!((view.pixel(0, 0)[3], view.pixel(63, 63)[3]), (0, 0));
            assert!(view.pixel(32, 32)[3] > 0, "{mode}");
        }
    }
}

#[test]
fn the_smallest_and_the_largest_of_everything_is_drawn() {
    let scene = ocean(FIVE_DEGREES);
    let view = |width_px, height_px, height_m| View::Globe {
        lon_deg: 200.0,
        lat_deg: 90.0,
        height_m,
        width_px,
        height_px,
        angles: contract::camera::CameraAngles::NADIR,
    };
    for renderer in renderers("limits") {
        for (view, slices) in [
            (view(1, 1, 1e7), 1),
            (view(1, 1, 1e7), 256),
            (view(4096, 3, 1e3), 64),
            (view(30, 20, 1e9), 64),
            (tile(0, 0, 0, 256), 256),
            (tile(16, 65_535, 65_535, 512), 1),
            (tile(16, 20_000, 31_000, 256), 256),
        ] {
            for mode in Mode::SCALAR {
                let mut job = job(mode, view);
                job.style.slices = slices;
                job.style.sun.elevation_deg = 5.0;
                let image = renderer.render(&job, &scene).unwrap();
                assert_eq!([image.width, image.height], view.size_px());
            }
        }
    }
}

#[test]
fn a_tiny_grid_and_one_across_the_date_line_are_drawn() {
    let small = Grid {
        rows: 1,
        cols: 12,
        north_deg: 2.0,
        west_deg: -180.0,
        dlat_deg: 4.0,
        dlon_deg: 30.0,
    };
    let across = Grid {
        rows: 10,
        cols: 20,
        north_deg: 5.0,
        west_deg: 170.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };
    for renderer in renderers("grids") {
        // A handful of dots in cells of 30 degrees need not fall into a tile.
        for (grid, modes) in [
            (small, &[Mode::Map, Mode::Volume][..]),
            (across, &Mode::SCALAR),
        ] {
            let scene = constant(grid, 1e-9);
            for &mode in modes {
                for view in [
                    tile(4, 0, 7, 256),
                    tile(4, 15, 7, 256),
                    globe(-180.0, 0.0, 5e6, 64),
                ] {
                    let image = renderer.render(&job(mode, view), &scene).unwrap();
                    assert!(
                        image.alpha().any(|alpha| alpha > 0),
                        "{} {mode} {view:?} {grid:?}",
                        renderer.name()
                    );
                }
            }
        }
    }
}

#[test]
fn jobs_beyond_a_limit_are_refused_with_the_reason() {
    let scene = ocean(FIVE_DEGREES);
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let inside_the_earth = globe(0.0, 0.0, -2e6, 64);
    for view in [
        inside_the_earth,
        globe(0.0, 0.0, 1e7, 7681),
        // More pixels than 8K has.
        globe(0.0, 0.0, 1e7, 6000),
        tile(0, 0, 0, 300),
    ] {
        let refused = renderer
            .render(&job(Mode::Volume, view), &scene)
            .unwrap_err();
        assert!(
            refused.is_bad_request() && !refused.is_retryable(),
            "{refused}"
        );
    }
    let mut small_device =
        Plan::new(&job(Mode::Volume, tile(3, 1, 3, 256)), &scene, 1 << 10).unwrap_err();
    assert!(
        small_device.to_string().contains("fewer particles"),
        "{small_device}"
    );
    assert!(small_device.is_bad_request());
    let other = Field::new(vec![0.0; 7]);
    let mut broken = scene.clone();
    broken.value.after = Arc::new(other);
    small_device = renderer
        .render(&job(Mode::Map, tile(0, 0, 0, 256)), &broken)
        .unwrap_err();
    assert!(matches!(small_device, RenderError::GridMismatch { .. }));
}

const PROBE: &str = "RENDER_WORKER_PROBES_WITHOUT_DRIVERS";

#[test]
#[expect(
    clippy::disallowed_methods,
    reason = "how the other half of the test is told from a plain run"
)]
fn without_a_driver_probe() {
    if std::env::var(PROBE).is_ok() {
        match Gpu::open() {
            Ok(gpu) => println!("opened {}", gpu.adapter_name()),
            Err(error) => println!("refused: {error}"),
        }
    }
}

#[test]
fn without_a_driver_the_error_names_the_package_to_install() {
    let child = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "limits::without_a_driver_probe", "--nocapture"])
        .envs([
            (PROBE, "1"),
            ("VK_DRIVER_FILES", "/nonexistent.json"),
            ("VK_ICD_FILENAMES", "/nonexistent.json"),
        ])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&child.stdout);
    assert!(
        said.contains("refused") && said.contains("mesa-vulkan-drivers"),
        "{said}"
    );
}
