//! Made-up currents for proofs: any vector field on any grid, and the job that draws it.

use std::sync::Arc;

use contract::colour::TransferFunction;
use contract::flow::Flow;
use contract::grid::Grid;
use contract::job::{Mode, RenderJob, Style, View};
use contract::quantity::Quantity;
use contract::trails::Trails;
use render::scene::{Field, Interval, Scene};

use super::ocean;

/// Eastward and northward velocity at a longitude and latitude in degrees, m/s; none on land.
pub type Vector = [f64; 2];

/// A scene of a vector field that changes from `before` to `after`, half of the way at its instant.
pub fn scene(
    grid: Grid,
    before: impl Fn(f64, f64) -> Option<Vector>,
    after: impl Fn(f64, f64) -> Option<Vector>,
) -> Scene {
    let field = |vector: &dyn Fn(f64, f64) -> Option<Vector>, part: usize| {
        let cells = (0..grid.rows).flat_map(|row| (0..grid.cols).map(move |col| (row, col)));
        let values = cells.map(|(row, col)| {
            let place = grid.cell_center(row, col);
            vector(place.lon, place.lat).map_or(f32::NAN, |vector| vector[part] as f32)
        });
        Arc::new(Field::new(values.collect()))
    };
    let part = |part| Interval {
        before: field(&before, part),
        after: field(&after, part),
        weight: 0.5,
    };
    let value = part(0);
    let domain = Scene::domain_of(value.before.cells.content().iter().map(|v| *v > -1e3));
    Scene {
        grid,
        domain,
        value,
        accumulated: None,
        terrain: None,
        northward: Some(part(1)),
        trails: None,
        whole: None,
    }
}

/// Gyres between the continents of the made-up ocean.
pub fn gyres(grid: Grid) -> Scene {
    let at = |phase: f64| {
        move |lon: f64, lat: f64| {
            let (x, y) = (lon.to_radians(), lat.to_radians());
            let east = 0.9 * (3.0 * y + phase).cos() * (1.0 + 0.4 * (2.0 * x).sin());
            let north = 0.6 * (4.0 * x - phase).cos() * (2.0 * y).cos();
            (!ocean::is_land(lon, lat)).then_some([east, north])
        }
    };
    scene(grid, at(0.0), at(0.5))
}

/// A job with trails of currents that lie on a grid, after a time of drifting.
pub fn under_trails(job: RenderJob, grid: Grid, clock_s: f64) -> RenderJob {
    let sample = || job.value.clone();
    let flow = Flow {
        northward: sample(),
        clock_s,
        look: None,
    };
    let trails = Trails::of(grid, sample(), flow, Quantity::Current);
    RenderJob {
        trails: trails.map(Box::new).ok(),
        ..job
    }
}

/// A job that draws currents in their default style after a time of drifting.
pub fn job(view: View, clock_s: f64) -> RenderJob {
    let plain = ocean::job(view);
    let northward = plain.value.clone();
    RenderJob {
        accumulated: None,
        flow: Some(Flow {
            northward,
            clock_s,
            look: None,
        }),
        mode: Mode::Flow,
        style: Style::of_flow(TransferFunction::of_speed(Quantity::Current)),
        ..plain
    }
}
