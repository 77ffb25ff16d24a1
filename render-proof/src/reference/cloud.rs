//! Particles as round clouds, each from its cell and number alone, in double precision.
//!
//! Which particle stands where is agreed with the renderer to the bit (a hash of cell and number); what follows from
//! it is worked out here anew.

use std::f64::consts::PI;

use contract::job::RenderJob;
use glam::DVec3;
use render::plan::Plan;
use render::scene::{Interval, Scene};
use render::stages::layout::{Active, COVERED, SUBPIXELS};

use super::space::Space;
use super::srgb::linear_of;

/// A smaller one of the 256 sizes is none.
const LEAST_SIZE: f64 = 1.0 / 255.0;

/// A cloud of density `8 / (3 pi radius) depth (1 - r²)^1.5`, r in radii: seen from anywhere its depth is
/// `depth (1 - r²)²`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cloud {
    pub(super) center: DVec3,
    pub(super) radius: f64,
    /// Optical depth straight through the middle.
    pub(super) depth: f64,
    /// Linear light.
    pub(super) colour: DVec3,
    /// The eye sees it; if not it still throws shadows.
    pub(super) is_seen: bool,
}

impl Cloud {
    /// Optical depth between two places of a line, given by their distances from the place where the line passes
    /// the middle, and that distance squared.
    pub(super) fn depth_between(&self, from: f64, to: f64, miss_sq: f64) -> f64 {
        let chord_sq = 1.0 - miss_sq / (self.radius * self.radius);
        if chord_sq <= 0.0 {
            return 0.0;
        }
        // The integral of (c² - t²)^1.5 is t (5 c² - 2 t²) sqrt(c² - t²) / 8 + 3/8 c⁴ arcsin(t / c).
        let chord = chord_sq.sqrt();
        let whole = |at: f64| {
            let t = (at / self.radius).clamp(-chord, chord);
            let rest = (chord_sq - t * t).max(0.0).sqrt();
            t * (5.0 * chord_sq - 2.0 * t * t) * rest / 8.0
                + 0.375 * chord_sq * chord_sq * (t / chord).clamp(-1.0, 1.0).asin()
        };
        self.depth * 8.0 / (3.0 * PI) * (whole(to) - whole(from))
    }
}

/// PCG-RXS-M-XS on 32 bits (O'Neill 2014, PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms
/// for Random Number Generation).
fn scrambled(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = (state ^ (state >> (4 + (state >> 28)))).wrapping_mul(277_803_737);
    word ^ (word >> 22)
}

/// Of 32 bits the upper 24 as a share of one.
fn share(bits: u32) -> f64 {
    f64::from(bits >> 8) / f64::from(1u32 << 24)
}

/// What a cell holds at the instant; none without data.
fn between(interval: &Interval, cell: usize) -> Option<f64> {
    let of = |field: &render::scene::Field| {
        let value = f64::from(field.cells.content()[cell]);
        // Stored values stand for "no data" far below any real one.
        (value > -1e20).then_some(value)
    };
    match (of(&interval.before), of(&interval.after)) {
        (Some(before), Some(after)) => Some(before + (after - before) * interval.weight),
        (before, _) if interval.weight <= 0.0 => before,
        (_, after) if interval.weight >= 1.0 => after,
        _ => None,
    }
}

/// All clouds of a plan.
pub(super) fn clouds(plan: &Plan, job: &RenderJob, scene: &Scene, space: &Space) -> Vec<Cloud> {
    let numbers = 0..plan.params.cells.particles_per_cell;
    let cells = plan.active.iter();
    cells
        .flat_map(|cell| numbers.clone().map(move |k| (cell, k)))
        .filter_map(|(cell, k)| cloud(plan, job, scene, space, *cell, k))
        .collect()
}

fn cloud(
    plan: &Plan,
    job: &RenderJob,
    scene: &Scene,
    space: &Space,
    active: Active,
    k: u32,
) -> Option<Cloud> {
    let (params, grid) = (&plan.params, &scene.grid);
    let index = active.cell as usize;
    let value = between(&scene.value, index)?;
    let carbon = scene
        .accumulated
        .as_ref()
        .and_then(|interval| between(interval, index))
        .unwrap_or(0.0);
    let (row, col) = (active.cell / grid.cols, active.cell % grid.cols);
    let bits = scrambled(scrambled(active.cell) ^ k.wrapping_mul(0x9e37_79b9));
    // Places of one cell are spread evenly by two irrational steps and then jittered.
    let place = |step: u32, bits: u32| {
        let jittered = (bits >> params.particles.jitter_shift)
            .wrapping_sub(0x8000_0000 >> params.particles.jitter_shift);
        share(
            0x8000_0000u32
                .wrapping_add(k.wrapping_mul(step))
                .wrapping_add(jittered),
        )
    };
    let east = place(3_242_174_889, bits);
    let south = place(2_447_445_414, scrambled(bits));
    let first = row
        .wrapping_mul(3_242_174_889)
        .wrapping_add(col.wrapping_mul(2_447_445_414))
        .wrapping_add(k.wrapping_mul(2_654_435_769))
        .wrapping_add(scrambled(bits ^ 0x85eb_ca6b) >> 3);
    let phase = (share(first) + f64::from(params.particles.turns_per_kg_m2) * carbon.abs()).fract();

    let limit_m = f64::from(params.particles.height_limit_m);
    let column_m =
        (carbon * f64::from(params.particles.height_m_per_kg_m2)).clamp(-limit_m, limit_m);
    let height_m = column_m * phase + f64::from(params.particles.sheet_m) * (phase - 0.5);
    let transfer = &job.style.transfer;
    let strength = if transfer.low < 0.0 && transfer.high > 0.0 {
        value.abs() / transfer.low.abs().max(transfer.high.abs())
    } else {
        transfer.position(value)
    }
    .clamp(0.0, 1.0);
    let floor = f64::from(params.particles.depth_floor);
    let thin = (phase.min(1.0 - phase) * 24.0).min(1.0) * 24.0 / 23.0;
    let table = &plan.rows[row as usize];
    let full_radius = f64::from(table.radius);
    let size = transfer
        .size(value)
        .unwrap_or_else(|| 1.0 - f64::from(params.projection.size_spread) * (1.0 - strength));
    let radius = full_radius * size.max(LEAST_SIZE);
    let opacity = transfer
        .opacity(value)
        .unwrap_or_else(|| floor + (1.0 - floor) * strength.sqrt());
    let covered = f64::from(scene.domain.content()[index]) / f64::from(COVERED);
    let column_depth = job.style.optical_depth * opacity * thin * covered;
    let share = (f64::from(params.cells.particle_shares) - f64::from(k)).clamp(0.0, 1.0);
    let depth = share * column_depth * f64::from(table.depth_gain) * (full_radius / radius).powi(2);
    if depth <= 0.0 {
        return None;
    }
    let lat_deg = grid.row_north_deg(row) - south * grid.dlat_deg;
    let lon_deg = grid.col_west_deg(col) + east * grid.dlon_deg;
    let west_px = f64::from(plan.cols[active.slot as usize].x_sub) / f64::from(SUBPIXELS);
    let turn = space.turn(grid.col_west_deg(col), west_px);
    let center = space.place(lon_deg, lat_deg, turn, height_m);
    Some(Cloud {
        center,
        radius,
        depth,
        colour: linear_of(DVec3::from_array(transfer.colour(value))),
        is_seen: !space.is_hidden(center),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_depth_of_a_piece_is_the_integral_of_the_density() {
        let cloud = Cloud {
            center: DVec3::ZERO,
            radius: 2.5,
            depth: 0.7,
            colour: DVec3::ONE,
            is_seen: true,
        };
        let density = |along: f64, miss_sq: f64| {
            let q = (along * along + miss_sq) / (cloud.radius * cloud.radius);
            8.0 * cloud.depth / (3.0 * PI * cloud.radius) * (1.0 - q).max(0.0).powf(1.5)
        };
        for (from, to, miss) in [
            (-9.0, 9.0, 0.0),
            (-1.0, 0.5, 1.2),
            (0.3, 8.0, 2.4),
            (1.0, 2.0, 2.6),
        ] {
            let miss_sq = miss * miss;
            let steps = 200_000;
            let step = (to - from) / f64::from(steps);
            let summed: f64 = (0..steps)
                .map(|i| density(from + (f64::from(i) + 0.5) * step, miss_sq) * step)
                .sum();
            let exact = cloud.depth_between(from, to, miss_sq);
            assert!((exact - summed).abs() < 1e-8, "{exact} against {summed}");
        }
        // Right through, the closed form of the projection.
        let seen = 0.7 * (1.0 - 1.2 * 1.2 / 6.25f64).powi(2);
        assert!((cloud.depth_between(-9.0, 9.0, 1.44) - seen).abs() < 1e-12);
    }
}
