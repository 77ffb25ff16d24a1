//! How particles drift in a view: how long they live, where in their lives they are at an instant, and how far they get.
//!
//! A life is as long as it takes to cross a share of the screen, so that trails are as easy to see from near as from
//! afar; how fast a particle moves between two instants is the water's own speed.

use std::f64::consts::TAU;

use contract::earth::SPHERE_RADIUS_M;
use contract::job::RenderJob;

use super::look::Look;
use super::{Plan, cell_px};
use crate::scene::Scene;
use crate::stages::flow::params::FlowParams;

/// Dots of a trail.
pub(super) const TRAIL_DOTS: u32 = 32;
/// Way of a particle in its life at the top of the transfer function, pixels.
const LIFE_PX: f64 = 110.0;
/// The same in cells at most: a step along it is then one or two.
const MOST_LIFE_CELLS: f64 = 48.0;
/// Cells at the top of the transfer function in one step from a birthplace to a trail's end.
const STEP_CELLS: f64 = 1.5;
/// Fewest of those steps.
const LEAST_LEAD_STEPS: f64 = 2.0;
/// Speed above which particles are drawn no faster, over the top of the transfer function.
const MOST_OVER_TOP: f64 = 1.5;
/// Tops of transfer functions, m/s: beyond, clocks and ways would not be numbers.
const TOPS_M_S: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// Sets what the stages need of the particles of a flow; how far they get from their birthplaces comes back, radians.
pub(super) fn plan(plan: &mut Plan, job: &RenderJob, scene: &Scene) -> f64 {
    let Some(flow) = &job.flow else {
        return 0.0;
    };
    let grid = &scene.grid;
    let [dlon_rad, dlat_rad] = [grid.dlon_deg, grid.dlat_deg].map(f64::to_radians);
    let cell_px = cell_px(&job.view, grid);
    let life_cells = (LIFE_PX / cell_px).min(MOST_LIFE_CELLS);
    let life_rad = life_cells * (dlon_rad * dlat_rad).sqrt();
    let transfer = &job.style.transfer;
    let top_m_s = transfer.low.abs().max(transfer.high.abs());
    let top_m_s = top_m_s.clamp(*TOPS_M_S.start(), *TOPS_M_S.end());
    let life_s = life_rad * SPHERE_RADIUS_M / top_m_s;
    let lives = flow.clock_s / life_s;
    let look = Look::of_job(job);
    let wanted = look.particles_per_cell(cell_px, job.style.particles_per_cell);
    let trails = wanted.ceil();
    let share = (cell_px * cell_px / look.area_px_per_particle / trails).min(1.0);
    let params = &mut plan.params;
    params.cells.set_particles(trails * f64::from(TRAIL_DOTS));
    // Nothing times what is too large for a number is still nothing.
    params.values.transfer_per_unit = params.values.transfer_per_unit.min(f32::MAX);
    let lead_steps = (0.5 * life_cells / STEP_CELLS).ceil();
    params.flow = FlowParams {
        turn: (lives - lives.floor()) as f32,
        cycle: lives.floor().rem_euclid(4_294_967_296.0) as u32,
        share: (share * f64::from(u32::MAX)) as u32,
        lead_steps: lead_steps.max(LEAST_LEAD_STEPS) as u32,
        cols_per_m_s: (life_s / SPHERE_RADIUS_M / dlon_rad) as f32,
        rows_per_m_s: (life_s / SPHERE_RADIUS_M / dlat_rad) as f32,
        most_cols: (TAU / dlon_rad) as f32,
        most_m_s: (MOST_OVER_TOP * top_m_s) as f32,
        px_per_m_s: (life_cells * cell_px / top_m_s) as f32,
        transfer_low: params.values.transfer_low,
        transfer_per_unit: params.values.transfer_per_unit,
        has_shape: params.values.has_shape,
        is_log: params.values.is_log,
    };
    // Born in the middle of their lives.
    0.5 * MOST_OVER_TOP * life_rad
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_life_has_at_most_as_many_steps_as_its_way_needs() {
        let lead_cells = 0.5 * MOST_LIFE_CELLS / (0.5 * MOST_LIFE_CELLS / STEP_CELLS).ceil();
        assert!(lead_cells <= STEP_CELLS);
        let trail_cells = 0.5 * MOST_LIFE_CELLS / f64::from(TRAIL_DOTS - 1);
        assert!(trail_cells <= STEP_CELLS, "{trail_cells}");
    }
}
