//! CPU twin of `particles.wgsl`.

use glam::Vec3;

use crate::stages::colour::{codes_of, with_codes};
use crate::stages::layout::{
    Active, COVERED, Particle, Row, WATER_BLUE, WATER_GREEN, WATER_RED, is_missing, nearest,
};
use crate::stages::params::Params;
use crate::stages::place::place_in_range;
use crate::stages::uncertainty::uncertain;

/// 0.5 in 32 bits.
pub const HALF_TURN: u32 = 0x8000_0000;

/// What the stage reads.
pub struct Inputs<'a> {
    pub active: &'a [Active],
    pub rows: &'a [Row],
    pub value: &'a [f32],
    pub accumulated: &'a [f32],
    pub palette: &'a [u32],
    /// Uncertainty of every cell; empty where it is not drawn.
    pub uncertainty: &'a [f32],
    /// How much of every cell holds data, [`COVERED`] where all of it does; not read where no cell is covered in part.
    pub domain: &'a [u32],
}

/// Output permutation of a 32-bit linear congruential generator (PCG-RXS-M-XS, O'Neill 2014).
pub fn hash(x: u32) -> u32 {
    let state = x.wrapping_mul(747796405).wrapping_add(2891336453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277803737);
    (word >> 22) ^ word
}

/// 32 random bits as a number in [0, 1).
pub fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * 5.9604645e-8
}

/// Random bits spread evenly round 0 over the mode's share of a cell.
pub fn jittered(params: &Params, bits: u32) -> u32 {
    (bits >> params.particles.jitter_shift).wrapping_sub(HALF_TURN >> params.particles.jitter_shift)
}

/// Thin at both ends of a column, so that particles appear and vanish unseen; mean 1.
pub fn envelope(phase: f32) -> f32 {
    (phase.min(1.0 - phase) * 24.0).clamp(0.0, 1.0) * (24.0 / 23.0)
}

fn strength_of(params: &Params, value: f32, position: f32) -> f32 {
    if params.particles.diverging == 0 {
        position
    } else {
        (value.abs() * params.particles.strength_per_unit).clamp(0.0, 1.0)
    }
}

/// A colour seen through so much of the sea: what is lost of it is the water's own (Beer-Lambert).
pub fn through_water(params: &Params, colour: u32, depth_m: f32) -> u32 {
    let kept = (-params.particles.sea_per_m * depth_m).exp();
    let water = Vec3::new(WATER_RED, WATER_GREEN, WATER_BLUE) * 65025.0;
    let codes = codes_of(colour);
    let light = water + (codes * codes - water) * kept;
    with_codes(colour, light.map(f32::sqrt))
}

/// Share of particle `k` of a cell: the last one may be there in part.
fn particle_share(params: &Params, k: u32) -> f32 {
    (params.cells.particle_shares - k as f32).clamp(0.0, 1.0)
}

/// One particle for every active cell and `k` below `particles_per_cell`, cell by cell.
pub fn generate(params: &Params, inputs: &Inputs<'_>, particles: &mut [Particle]) {
    for (i, particle) in particles.iter_mut().enumerate() {
        let cell = inputs.active[i / params.cells.particles_per_cell as usize];
        let k = i as u32 % params.cells.particles_per_cell;
        *particle = one(params, inputs, cell, k);
    }
}

fn one(params: &Params, inputs: &Inputs<'_>, cell: Active, k: u32) -> Particle {
    let (own, values) = (&params.particles, &params.values);
    let (row, col) = (cell.cell / params.grid.cols, cell.cell % params.grid.cols);
    let [whole_row, whole_col] = params.grid.in_whole(row, col);
    let value = inputs.value[cell.cell as usize];
    let whole_cell = whole_row
        .wrapping_mul(params.grid.whole_cols)
        .wrapping_add(whole_col);
    let bits = hash(hash(whole_cell) ^ k.wrapping_mul(0x9e3779b9));
    let along = |step: u32, bits: u32| {
        HALF_TURN
            .wrapping_add(k.wrapping_mul(step))
            .wrapping_add(jittered(params, bits))
    };
    let (east, south) = (along(3242174889, bits), along(2447445414, hash(bits)));
    let across = whole_col.wrapping_mul(2447445414);
    let start = whole_row
        .wrapping_mul(3242174889)
        .wrapping_add(k.wrapping_mul(2654435769))
        .wrapping_add(across);
    let mut particle = Particle {
        row,
        slot: cell.slot,
        east: unit(east),
        south: unit(south),
        ..Particle::default()
    };
    if is_missing(value) {
        return particle;
    }
    let mut carbon = 0.0;
    if values.has_accumulated == 1 {
        carbon = inputs.accumulated[cell.cell as usize];
        if is_missing(carbon) {
            carbon = 0.0;
        }
    }
    let turned =
        unit(start.wrapping_add(hash(bits ^ 0x85ebca6b) >> 3)) + own.turns_per_kg_m2 * carbon.abs();
    let phase = turned - turned.floor();
    let column_m = (carbon * own.height_m_per_kg_m2).clamp(-own.height_limit_m, own.height_limit_m);
    let position = place_in_range(params, value);
    let strength = strength_of(params, value, position);
    particle.height_m = column_m * phase + own.sheet_m * (phase - 0.5);
    particle.mass_kg = carbon * inputs.rows[row as usize].area_m2 / params.cells.particle_shares;
    let at = nearest(position * 255.0) as usize;
    let mut opacity = own.depth_floor + (1.0 - own.depth_floor) * strength.sqrt();
    let mut size = nearest(strength * 255.0) as u32;
    if values.has_shape == 1 {
        let shape = inputs.palette[256 + at];
        opacity = (shape & 0xffff) as f32 / 65535.0;
        size = shape >> 16;
    }
    particle.depth = own.optical_depth * opacity * envelope(phase);
    particle.colour = inputs.palette[at] | (size << 24);
    if own.sea_per_m > 0.0 && particle.height_m < 0.0 {
        particle.colour = through_water(params, particle.colour, -particle.height_m);
    }
    let share = share_of(params, inputs.domain, cell.cell as usize);
    let particle = covering(particle, share * particle_share(params, k));
    match inputs.uncertainty.get(cell.cell as usize) {
        Some(&uncertainty) if uncertainty > 0.0 => uncertain(particle, uncertainty),
        Some(_) | None => particle,
    }
}

/// Share of a cell that holds data.
pub fn share_of(params: &Params, domain: &[u32], cell: usize) -> f32 {
    if params.values.has_coverage == 0 {
        return 1.0;
    }
    domain[cell] as f32 / COVERED as f32
}

/// What a cell sends out that holds data in a part of its area: as many particles, each with that share of depth and mass.
fn covering(particle: Particle, share: f32) -> Particle {
    Particle {
        depth: particle.depth * share,
        mass_kg: particle.mass_kg * share,
        ..particle
    }
}
