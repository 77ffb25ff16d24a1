//! Edges and points: how strongly a change of lightness stands out at every pixel, and how much that differs between
//! two pictures.

use super::PIXELS_PER_DEGREE;
use super::window::{Plane, weights};

/// Width of the features that the eye sees best, degrees.
const WIDTH_DEG: f64 = 0.082;

/// Strength of edges and of points.
struct Features {
    edge: Vec<f64>,
    point: Vec<f64>,
}

/// How much features differ, 0 to 1 a pixel; planes of lightness from 0 to 1.
pub(super) fn difference(a: &Plane, b: &Plane) -> Vec<f64> {
    let (a, b) = (Features::of(a), Features::of(b));
    let edges = a.edge.iter().zip(&b.edge).map(|(a, b)| (a - b).abs());
    let points = a.point.iter().zip(&b.point).map(|(a, b)| (a - b).abs());
    edges
        .zip(points)
        .map(|(edge, point)| (edge.max(point) / std::f64::consts::SQRT_2).min(1.0))
        .collect()
}

impl Features {
    fn of(lightness: &Plane) -> Self {
        let sigma = 0.5 * WIDTH_DEG * PIXELS_PER_DEGREE;
        let radius = (3.0 * sigma).ceil() as usize;
        let bell = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
        let smooth = weights(radius, bell);
        let sum: f64 = smooth.iter().sum();
        let smooth: Vec<f64> = smooth.into_iter().map(|weight| weight / sum).collect();
        // First and second derivative of the bell.
        let slope = balanced(weights(radius, |x| -x * bell(x)));
        let bend = balanced(weights(radius, |x| {
            (x * x / (sigma * sigma) - 1.0) * bell(x)
        }));
        let strength = |kernel: &[f64]| -> Vec<f64> {
            let across = lightness.weighed(kernel, &smooth).values;
            let down = lightness.weighed(&smooth, kernel).values;
            across.iter().zip(down).map(|(x, y)| x.hypot(y)).collect()
        };
        Self {
            edge: strength(&slope),
            point: strength(&bend),
        }
    }
}

/// Weights whose positive ones add up to 1 and whose negative ones to -1.
fn balanced(weights: Vec<f64>) -> Vec<f64> {
    let sum = |sign: f64| -> f64 { weights.iter().map(|weight| (weight * sign).max(0.0)).sum() };
    let (above, below) = (sum(1.0), sum(-1.0));
    let scale = |weight: f64| {
        if weight > 0.0 {
            weight / above
        } else {
            weight / below
        }
    };
    weights.into_iter().map(scale).collect()
}
