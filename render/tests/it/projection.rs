//! What is drawn over pictures is where the pictures have it: a lone cell is where the projection says.

use std::sync::Arc;

use contract::camera::CameraAngles;
use contract::grid::LonLatDeg;
use contract::job::{Mode, View};
use render::plan::Projection;
use render::{Backend, Field, Image, Renderer};

use crate::scenes::{FIVE_DEGREES, job, ocean};

/// Largest distance of the middle of the cell from where it should be, pixels: ground in a cell is not all as far away.
const MOST_OFF_PX: f64 = 1.5;

/// The middle of what is red in a picture whose other ground is blue.
fn middle_of_red(image: &Image) -> [f64; 2] {
    let mut sums = [0.0; 3];
    for y in 0..image.height {
        for x in 0..image.width {
            let [red, _green, blue, alpha] = image.pixel(x, y).map(f64::from);
            let weight = (red - blue).max(0.0) * alpha;
            sums[0] += weight * (f64::from(x) + 0.5);
            sums[1] += weight * (f64::from(y) + 0.5);
            sums[2] += weight;
        }
    }
    assert!(sums[2] > 0.0, "nothing is red");
    [sums[0] / sums[2], sums[1] / sums[2]]
}

#[test]
fn a_lone_cell_is_drawn_where_the_projection_has_it() {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    for (lon_deg, lat_deg, height_m, angles, place) in [
        (0.0, 0.0, 1.5e7, CameraAngles::NADIR, [32.5, 22.5]),
        (120.0, 40.0, 4e6, angles(75.0, 25.0, 0.0), [142.5, 42.5]),
        (
            -150.0,
            -30.0,
            2e6,
            angles(-160.0, 40.0, 25.0),
            [-157.5, -42.5],
        ),
        // From below the sea surface.
        (-27.0, 46.0, -1e6, angles(20.0, 176.0, 10.0), [-27.5, 47.5]),
    ] {
        let [lon, lat]: [f64; 2] = place;
        let view = View::Globe {
            lon_deg,
            lat_deg,
            height_m,
            width_px: 400,
            height_px: 300,
            angles,
        };
        let mut scene = ocean(FIVE_DEGREES);
        let cell = ((90.0 - lat) / 5.0).floor() * 72.0 + ((lon + 180.0) / 5.0).floor();
        let mut values = vec![-1e-9f32; FIVE_DEGREES.cell_count()];
        values[cell as usize] = 1e-9;
        let field = Arc::new(Field::new(values));
        (scene.value.before, scene.value.after) = (Arc::clone(&field), field);
        let image = renderer.render(&job(Mode::Map, view), &scene).unwrap();
        let [x, y] = middle_of_red(&image);
        let projection = Projection::of(&view).unwrap();
        let seen = projection.seen(LonLatDeg { lon, lat }, 0.0).unwrap();
        assert!(seen.is_visible, "{view:?}");
        let off = (seen.x_px - x).hypot(seen.y_px - y);
        assert!(off < MOST_OFF_PX, "{view:?}: {x} {y} for {seen:?}");
    }
}

fn angles(heading_deg: f64, tilt_deg: f64, roll_deg: f64) -> CameraAngles {
    CameraAngles {
        heading_deg,
        tilt_deg,
        roll_deg,
        ..CameraAngles::NADIR
    }
}
