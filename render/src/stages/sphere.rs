//! CPU twin of `sphere.wgsl`: where the sight line of a pixel meets the sea surface of the globe.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3;

use crate::stages::params::Params;

const GRAZING: f32 = 0.1;
const CLEAR: f32 = 0.3;

/// What a pixel's sight line meets.
#[derive(Debug, Clone, Copy, Default)]
pub struct Ground {
    pub on_ground: bool,
    pub lon_rad: f32,
    pub lat_rad: f32,
    pub normal: Vec3,
    /// How far inside the globe's outline it runs, pixels; from below the sea surface outside that of the core.
    pub rim_px: f32,
    /// Its place nearest to the globe's centre, earth radii.
    pub foot: Vec3,
    /// The way from the eye there, earth radii; negative behind the eye.
    pub nearest_at: f32,
    /// Its direction, length 1.
    pub sight: Vec3,
    /// The way from the eye to the sea surface, earth radii.
    pub way: f32,
}

/// What the centre of a pixel of a globe view shows.
pub fn ground_below(params: &Params, pixel: [u32; 2]) -> Ground {
    let view = &params.view;
    let x = ((pixel[0] as i32 + view.origin_px.x) as f32 + 0.5 - view.center_px.x) / view.focal_px;
    let y = (view.center_px.y - (pixel[1] as i32 + view.origin_px.y) as f32 - 0.5) / view.focal_px;
    let camera = view.eye;
    let toward = view.forward + view.right * x + view.up * y;
    let sight = toward / toward.length();
    let nearest_at = -camera.dot(sight);
    let foot = camera + sight * nearest_at;
    let miss_sq = foot.dot(foot);
    let half_chord = (1.0 - miss_sq).max(0.0).sqrt();
    let (rim_px, on_ground, way) = if view.hides < 1.0 {
        let rim_px = if nearest_at > 0.0 {
            (miss_sq.sqrt() - view.hides) * view.focal_px / nearest_at.max(1.0e-6)
        } else {
            1.0e6
        };
        (rim_px, rim_px > -0.5, nearest_at + half_chord)
    } else {
        let rim_px = (1.0 - miss_sq.sqrt()) * view.focal_px / nearest_at.max(1.0e-6);
        let is_met = miss_sq < 1.0 && nearest_at > 0.0;
        (rim_px, is_met, nearest_at - half_chord)
    };
    let met = Ground {
        on_ground,
        rim_px,
        foot,
        nearest_at,
        sight,
        way,
        ..Ground::default()
    };
    if !on_ground {
        return met;
    }
    let normal = camera + sight * way;
    Ground {
        lon_rad: angle_of(normal.x, normal.y),
        lat_rad: angle_of(normal.z, normal.truncate().length()),
        normal,
        ..met
    }
}

/// Share of a line on the sea surface that is shown: where sight grazes it, lines far apart on the ground would be a tangle.
pub fn line_share(ground: &Ground) -> f32 {
    ((ground.sight.dot(ground.normal).abs() - GRAZING) / (CLEAR - GRAZING)).clamp(0.0, 1.0)
}

/// Angle of a vector against the x axis, -pi to pi.
///
/// Source: Abramowitz and Stegun (1964), Handbook of Mathematical Functions, eq. 4.4.49; good to 1e-7.
#[expect(
    clippy::excessive_precision,
    reason = "coefficients as printed in the source"
)]
pub fn angle_of(y: f32, x: f32) -> f32 {
    let wide = x.abs().max(y.abs());
    let t = x.abs().min(y.abs()) / wide.max(1.0e-30);
    let q = t * t;
    let high = q * (-0.0752896400 + q * (0.0429096138 + q * (-0.0161657367 + q * 0.0028662257)));
    let mut angle = t
        * (1.0
            + q * (-0.3333314528
                + q * (0.1999355085 + q * (-0.1420889944 + q * (0.1065626393 + high)))));
    if y.abs() > x.abs() {
        angle = FRAC_PI_2 - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    if y < 0.0 { -angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::angle_of;

    #[test]
    fn angles_agree_with_the_arc_tangent_all_round() {
        for i in 0..10_000 {
            let (y, x) = (f64::from(i) * std::f64::consts::TAU / 10_000.0).sin_cos();
            let expected = y.atan2(x);
            let found = f64::from(angle_of(y as f32, x as f32));
            let turn = (found - expected)
                .abs()
                .min(std::f64::consts::TAU - (found - expected).abs());
            assert!(turn < 3e-7, "{x} {y}: {found} against {expected}");
        }
    }
}
