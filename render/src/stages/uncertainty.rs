//! CPU twin of `uncertainty.wgsl`: how much a cell whose gap was filled is to be uncertain, and what that does to its colours.

use glam::Vec3;

use crate::scene::Interval;
use crate::stages::layout::{Particle, nearest};
use crate::stages::params::Params;

/// The functions of the shader; the passes over particles and the map run them.
pub const FUNCTIONS: &str = include_str!("uncertainty.wgsl");

/// Pixels from one line of a hatching to the next along a row or a column: a divisor of the side of every tile.
const HATCH_PX: u32 = 8;

const PALENESS: f32 = 0.65;
const DEPTH_LEFT: f32 = 0.3;
const PALE: f32 = 200.0;
const HATCH_INK: f32 = 0.75;

/// Uncertainty of every cell at the instant, 0 where it was measured; empty where uncertainty is not drawn.
pub fn between(params: &Params, interval: &Interval) -> Vec<f32> {
    if params.values.has_uncertainty == 0 {
        return vec![];
    }
    let (before, after) = (
        interval.before.uncertainties(),
        interval.after.uncertainties(),
    );
    let pairs = before.content().iter().zip(after.content());
    pairs
        .map(|(before, after)| before + (after - before) * params.values.weight)
        .collect()
}

fn paler(channel: u32, uncertainty: f32) -> u32 {
    let plain = (channel & 255) as f32;
    nearest(plain + (PALE - plain) * (PALENESS * uncertainty)) as u32
}

/// Paler and more transparent.
pub fn uncertain(particle: Particle, uncertainty: f32) -> Particle {
    let colour = particle.colour;
    let [r, g, b] = [0, 8, 16].map(|shift| paler(colour >> shift, uncertainty) << shift);
    Particle {
        depth: particle.depth * (1.0 - (1.0 - DEPTH_LEFT) * uncertainty),
        colour: r | g | b | (colour & 0xff00_0000),
        ..particle
    }
}

fn line_at(params: &Params, pixel: [u32; 2]) -> f32 {
    let origin = (params.view.origin_px.x + params.view.origin_px.y) as u32;
    let along = pixel[0] + pixel[1] + origin;
    (1.0 - 0.5 * ((along % HATCH_PX) as f32 - 2.0).abs()).max(0.0)
}

/// A colour under the hatching: dark lines on light colours, light ones on dark.
pub fn hatched(params: &Params, rgb: Vec3, uncertainty: f32, pixel: [u32; 2]) -> Vec3 {
    let luma = 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z;
    let ink = if luma > 0.5 { 0.1 } else { 1.0 };
    rgb + (Vec3::splat(ink) - rgb) * (HATCH_INK * uncertainty * line_at(params, pixel))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_particle_without_uncertainty_is_as_it_was_and_full_uncertainty_leaves_something() {
        let particle = Particle {
            depth: 2.0,
            colour: 0x80ff_0a00,
            ..Particle::default()
        };
        assert_eq!(uncertain(particle, 0.0), particle);
        let faded = uncertain(particle, 1.0);
        assert!((faded.depth - 2.0 * DEPTH_LEFT).abs() < 1e-6);
        let [r, g, b, strength] = faded.colour.to_le_bytes();
        assert_eq!(strength, 0x80, "its size stays");
        assert!(r > 100 && g > 100 && b < 255 && b > 200);
    }

    #[test]
    fn lines_of_the_hatching_come_back_after_its_width_and_are_as_strong_as_the_uncertainty() {
        const {
            assert!(256 % HATCH_PX == 0, "lines go on in the next tile");
        }
        let params = Params::default();
        let gray =
            |uncertainty: f32, x: u32| hatched(&params, Vec3::splat(0.6), uncertainty, [x, 3]).x;
        for x in 0..40 {
            assert!((gray(1.0, x) - gray(1.0, x + HATCH_PX)).abs() < 1e-6);
            assert!((gray(0.0, x) - 0.6).abs() < 1e-6);
            let (some, full) = (0.6 - gray(0.5, x), 0.6 - gray(1.0, x));
            assert!(full >= some - 1e-6 && some >= -1e-6);
        }
        let darkest = (0..HATCH_PX).map(|x| gray(1.0, x)).fold(1.0, f32::min);
        let lightest = (0..HATCH_PX).map(|x| gray(1.0, x)).fold(0.0, f32::max);
        assert!(darkest < 0.3 && (lightest - 0.6).abs() < 1e-6);
        // A line leans: a row farther down, it is a column farther west.
        let down = |x: u32, y: u32| hatched(&params, Vec3::ONE, 1.0, [x, y]).x;
        assert!((down(5, 3) - down(4, 4)).abs() < 1e-6);
    }
}
