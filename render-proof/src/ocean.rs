//! A made-up ocean for proofs and measurements: a smooth flux field with land, and what it has accumulated.

use std::f64::consts::TAU;
use std::sync::Arc;

use contract::colour::TransferFunction;
use contract::grid::Grid;
use contract::job::{Mode, RENDERER_VERSION, RenderJob, Style, View};
use contract::quantity::Quantity;
use contract::time_sample::TimeSample;
use render::scene::{Field, Interval, Scene};

/// The grid of the 1-degree climatology.
pub const ONE_DEGREE: Grid = Grid {
    rows: 180,
    cols: 360,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// A coarser one for quick pictures.
pub const FIVE_DEGREES: Grid = Grid {
    rows: 36,
    cols: 72,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 5.0,
    dlon_deg: 5.0,
};

/// Seas off a western coast in cells of an eighth of a degree.
pub const REGION: Grid = Grid {
    rows: 328,
    cols: 240,
    north_deg: 41.0,
    west_deg: -150.0,
    dlat_deg: 0.125,
    dlon_deg: 0.125,
};

/// Flux of 1 g C m⁻² a year, kg m⁻² s⁻¹.
pub const GRAM_A_YEAR: f64 = 1e-3 / (365.25 * 86_400.0);

pub(crate) fn is_land(lon: f64, lat: f64) -> bool {
    let blob = |x: f64, y: f64, rx: f64, ry: f64| {
        let dx = (lon - x + 540.0).rem_euclid(360.0) - 180.0;
        (dx / rx).powi(2) + ((lat - y) / ry).powi(2) < 1.0
    };
    blob(20.0, 5.0, 22.0, 32.0)
        || blob(90.0, 50.0, 65.0, 24.0)
        || blob(-60.0, -15.0, 18.0, 35.0)
        || blob(-100.0, 50.0, 32.0, 22.0)
        || blob(134.0, -25.0, 18.0, 12.0)
        || !(-72.0..=80.0).contains(&lat)
}

/// Sources near the equator, sinks in middle latitudes, waves on top.
fn flux(lon: f64, lat: f64, phase: f64) -> f64 {
    let (x, y) = (lon.to_radians(), lat.to_radians());
    let belts =
        45.0 * (-(lat / 14.0).powi(2)).exp() - 40.0 * (-((lat.abs() - 42.0) / 14.0).powi(2)).exp();
    (belts * (1.0 + 0.4 * (3.0 * x + phase).sin())
        + 10.0 * (5.0 * x).cos() * (4.0 * y + phase).sin())
        * GRAM_A_YEAR
}

fn field(grid: &Grid, value: impl Fn(f64, f64) -> f64) -> Arc<Field> {
    let cells = (0..grid.rows).flat_map(|row| (0..grid.cols).map(move |col| (row, col)));
    let values = cells.map(|(row, col)| {
        let place = grid.cell_center(row, col);
        if is_land(place.lon, place.lat) {
            f32::NAN
        } else {
            value(place.lon, place.lat) as f32
        }
    });
    Arc::new(Field::new(values.collect()))
}

/// Two months of flux with ten months of carbon accumulated.
pub fn scene(grid: Grid) -> Scene {
    let year_s = 365.25 * 86_400.0;
    let value = Interval {
        before: field(&grid, |lon, lat| flux(lon, lat, 0.0)),
        after: field(&grid, |lon, lat| flux(lon, lat, TAU / 12.0)),
        weight: 0.3,
    };
    let accumulated = Interval {
        before: field(&grid, |lon, lat| flux(lon, lat, 0.0) * 0.8 * year_s),
        after: field(&grid, |lon, lat| flux(lon, lat, TAU / 24.0) * 0.9 * year_s),
        weight: 0.6,
    };
    let domain = Scene::domain_of(value.before.cells.content().iter().map(|v| *v > -1.0));
    Scene {
        grid,
        domain,
        value,
        accumulated: Some(accumulated),
        terrain: None,
        northward: None,
        trails: None,
        whole: None,
    }
}

/// A job for a volume of the scene in the default style of fluxes.
///
/// # Panics
/// Never: its fixed words are valid.
pub fn job(view: View) -> RenderJob {
    let key = |text: &str| text.parse().expect("the name is constant");
    let sample = |domain: &str, field: &str| TimeSample {
        domain: key(domain),
        before: Some(key(field)),
        after: None,
        contributed: None,
    };
    RenderJob {
        renderer_version: RENDERER_VERSION,
        grid: ONE_DEGREE,
        value: sample("domain/made-up/0", "frames/made-up/0"),
        accumulated: Some(sample("domain/made-up-carbon/0", "frames/made-up-carbon/0")),
        relief: None,
        flow: None,
        trails: None,
        mode: Mode::Volume,
        view,
        style: Style::with_transfer(TransferFunction::default_for(Quantity::CarbonFlux)),
        annotations: None,
    }
}
