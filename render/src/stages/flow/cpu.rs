//! CPU twin of `velocity.wgsl` and `flow.wgsl`.

use glam::{Vec2, Vec3};

use crate::stages::layout::{Active, MISSING, Particle, Row, Velocity, is_missing, nearest};
use crate::stages::params::Params;
use crate::stages::particles::cpu::{HALF_TURN, hash, jittered, unit};
use crate::stages::place::place_in_range;
use crate::stages::project::cpu::turned;

/// Longest trail, lives.
const TRAIL: f32 = 0.5;
/// The last of its life in which a particle fades: 1 over this.
const FADING: f32 = 8.0;
/// Dots that lie closer together are paler, down to a least share: slow water is seen as faint dots.
const FULL_SPACING_PX: f32 = 0.6;
const LEAST_SHARE: f32 = 0.12;

/// Squares of larger ones would not be numbers.
const MOST_SPEED: f32 = 1.0e6;

/// What the stage reads.
pub struct Inputs<'a> {
    pub active: &'a [Active],
    pub field: VectorField<'a>,
    pub palette: &'a [u32],
}

/// A vector field on a grid.
#[derive(Clone, Copy)]
pub struct VectorField<'a> {
    pub params: &'a Params,
    pub rows: &'a [Row],
    pub velocity: &'a [Velocity],
}

/// What carries a particle at a place.
#[derive(Debug, Clone, Copy)]
pub struct Drift {
    /// Columns east and rows south a life.
    pub rate: Vec2,
    /// In m/s.
    pub speed: f32,
    /// 0 where half of the nearest cells have no data, 1 in the open sea.
    pub open: f32,
}

/// A particle on its way.
#[derive(Debug, Clone, Copy)]
pub struct Trail {
    /// Cell of birth.
    pub row: u32,
    pub col: u32,
    /// Columns east and rows south of the north-western corner of that cell.
    pub place: Vec2,
    /// Share of its life that has passed.
    pub age: f32,
    /// The least that the sea was open on its way; 0 where it is not drawn.
    pub open: f32,
}

/// The vector of every cell from both parts at an instant.
pub fn velocities(east: &[f32], north: &[f32]) -> Vec<Velocity> {
    let one = |(&east, &north): (&f32, &f32)| {
        if is_missing(east) || is_missing(north) {
            Velocity {
                east: MISSING,
                north: MISSING,
            }
        } else {
            Velocity {
                east: east.clamp(-MOST_SPEED, MOST_SPEED),
                north: north.clamp(-MOST_SPEED, MOST_SPEED),
            }
        }
    };
    east.iter().zip(north).map(one).collect()
}

/// The dots of every trail of every active cell, from the trail's end on.
pub fn trails(params: &Params, inputs: &Inputs<'_>, particles: &mut [Particle]) {
    let each = params.cells.particles_each;
    let of_cell = (params.cells.particles_per_cell / each) as usize;
    for (i, dots) in particles.chunks_exact_mut(each as usize).enumerate() {
        let cell = inputs.active[i / of_cell];
        let mut trail = inputs.field.trail_of(cell.cell, (i % of_cell) as u32);
        let share = dot_share(params, trail.age);
        for (number, dot) in (0..).zip(dots) {
            if trail.open <= 0.0 {
                *dot = Particle {
                    row: trail.row,
                    slot: cell.slot,
                    ..Particle::default()
                };
                continue;
            }
            let here = inputs.field.drift_at(&trail, trail.place);
            trail.open = trail.open.min(here.open);
            *dot = dot_of(params, inputs.palette, &trail, number, here.speed);
            dot.slot = cell.slot;
            trail = inputs.field.stepped(trail, here, share);
        }
    }
}

/// The share of a life between two dots of a trail.
fn dot_share(params: &Params, age: f32) -> f32 {
    age.min(TRAIL) / (params.cells.particles_each - 1) as f32
}

fn dot_of(params: &Params, palette: &[u32], trail: &Trail, number: u32, speed: f32) -> Particle {
    let row = trail.row as i32 + trail.place.y.floor() as i32;
    let row = row.clamp(0, params.grid.rows as i32 - 1);
    let taper = (number + 1) as f32 / params.cells.particles_each as f32;
    let position = place_in_range(params, speed);
    let alive = (trail.age / TRAIL).min(1.0) * ((1.0 - trail.age) * FADING).clamp(0.0, 1.0);
    let spacing_px =
        speed.min(params.flow.most_m_s) * params.flow.px_per_m_s * dot_share(params, trail.age);
    let at_colour = nearest(position * 255.0) as usize;
    let mut opacity =
        params.particles.depth_floor + (1.0 - params.particles.depth_floor) * position.sqrt();
    if params.values.has_shape == 1 {
        opacity = (palette[256 + at_colour] & 0xffff) as f32 / 65535.0;
    }
    opacity *= (spacing_px / FULL_SPACING_PX).clamp(LEAST_SHARE, 1.0);
    Particle {
        row: row as u32,
        east: trail.place.x,
        south: trail.place.y - (row - trail.row as i32) as f32,
        depth: params.particles.optical_depth * opacity * taper * taper * alive * trail.open,
        colour: palette[at_colour] | ((nearest(taper * 255.0) as u32) << 24),
        ..Particle::default()
    }
}

impl VectorField<'_> {
    fn cell(&self, row: i32, col: i32) -> Vec3 {
        let (rows, cols) = (self.params.grid.rows as i32, self.params.grid.cols as i32);
        let col = if self.params.grid.periodic == 1 {
            col.rem_euclid(cols)
        } else {
            col
        };
        if col < 0 || col >= cols || row < 0 || row >= rows {
            return Vec3::ZERO;
        }
        let own = self.velocity[row as usize * cols as usize + col as usize];
        if is_missing(own.east) {
            Vec3::ZERO
        } else {
            Vec3::new(own.east, own.north, 1.0)
        }
    }

    /// What carries a particle at a place, bilinear between cells with data.
    pub fn drift_at(&self, trail: &Trail, place: Vec2) -> Drift {
        let params = self.params;
        let corner = (place - 0.5).floor();
        let part = place - 0.5 - corner;
        let west = trail.col as i32 + corner.x as i32;
        let north = trail.row as i32 + corner.y as i32;
        let cell = |row, col| self.cell(row, col);
        let upper = mix(cell(north, west), cell(north, west + 1), part.x);
        let lower = mix(cell(north + 1, west), cell(north + 1, west + 1), part.x);
        let sum = mix(upper, lower, part.y);
        let found = sum.truncate() / sum.z.max(1.0e-6);
        let speed = found.length();
        let drawn = found * (params.flow.most_m_s / speed.max(1.0e-6)).min(1.0);
        let row = &self.rows[trail.row as usize];
        let north_of_middle = (0.5 - place.y) * row.lat_span_rad;
        let cos_lat = turned(row.sin_lat, row.cos_lat, north_of_middle).y;
        let most = params.flow.most_cols;
        let east = (drawn.x * params.flow.cols_per_m_s / cos_lat.max(1.0e-3)).clamp(-most, most);
        Drift {
            rate: Vec2::new(east, -drawn.y * params.flow.rows_per_m_s),
            speed,
            open: (4.0 * sum.z - 2.0).clamp(0.0, 1.0),
        }
    }

    /// A step of some share of a life from where the drift is `here` (the midpoint method).
    pub fn stepped(&self, trail: Trail, here: Drift, share: f32) -> Trail {
        let middle = self.drift_at(&trail, trail.place + here.rate * (0.5 * share));
        Trail {
            place: trail.place + middle.rate * share,
            open: trail.open.min(here.open).min(middle.open),
            ..trail
        }
    }

    /// A way of some share of a life in so many steps.
    pub fn carried(&self, mut trail: Trail, share: f32, steps: u32) -> Trail {
        for _ in 0..steps {
            let here = self.drift_at(&trail, trail.place);
            trail = self.stepped(trail, here, share / steps as f32);
        }
        trail
    }

    /// Where the trail ends of particle `number` of a cell.
    pub fn trail_of(&self, cell: u32, number: u32) -> Trail {
        let params = self.params;
        let mut trail = Trail {
            row: cell / params.grid.cols,
            col: cell % params.grid.cols,
            place: Vec2::ZERO,
            age: 0.0,
            open: 0.0,
        };
        if is_missing(self.velocity[cell as usize].east) {
            return trail;
        }
        let [row, col] = params.grid.in_whole(trail.row, trail.col);
        let whole_cell = row.wrapping_mul(params.grid.whole_cols).wrapping_add(col);
        let bits = hash(hash(whole_cell) ^ number.wrapping_mul(0x9e3779b9));
        let turn = unit(bits) + params.flow.turn;
        trail.age = turn - turn.floor();
        let cycle = params.flow.cycle.wrapping_add(turn as u32);
        let life = hash(bits ^ cycle.wrapping_mul(0x85ebca6b));
        if hash(life ^ 0x68bc21eb) > params.flow.share {
            return trail;
        }
        let along = |step: u32, bits: u32| {
            let start = HALF_TURN.wrapping_add(number.wrapping_mul(step));
            unit(start.wrapping_add(jittered(params, bits)))
        };
        trail.place = Vec2::new(along(3242174889, life), along(2447445414, hash(life)));
        trail.open = 1.0;
        let share = (trail.age - TRAIL).max(0.0) - 0.5;
        self.carried(trail, share, params.flow.lead_steps)
    }
}

fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a * (1.0 - t) + b * t
}
