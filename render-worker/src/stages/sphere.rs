//! CPU twin of `sphere.wgsl`: where the sight line of a pixel meets the sea surface of the globe.

use glam::Vec3;

use crate::stages::layout::Params;

/// What a pixel's sight line meets.
#[derive(Debug, Clone, Copy, Default)]
pub struct Ground {
    pub on_ground: bool,
    pub lon_rad: f32,
    pub lat_rad: f32,
    pub normal: Vec3,
    /// How far inside the globe's outline it runs, pixels.
    pub rim_px: f32,
}

/// What the centre of a pixel of a globe view shows.
pub fn ground_below(params: &Params, pixel: [u32; 2]) -> Ground {
    let x = ((pixel[0] as i32 + params.origin_x_px) as f32 + 0.5 - params.center_px_x) / params.focal_px;
    let y = (params.center_px_y - (pixel[1] as i32 + params.origin_y_px) as f32 - 0.5) / params.focal_px;
    let camera = Vec3::new(params.eye_x, params.eye_y, params.eye_z);
    let toward = Vec3::new(params.forward_x, params.forward_y, params.forward_z)
        + Vec3::new(params.right_x, params.right_y, params.right_z) * x
        + Vec3::new(params.up_x, params.up_y, params.up_z) * y;
    let sight = toward / toward.length();
    let nearest_at = -camera.dot(sight);
    let foot = camera + sight * nearest_at;
    let miss_sq = foot.dot(foot);
    let rim_px = (1.0 - miss_sq.sqrt()) * params.focal_px / nearest_at.max(1.0e-6);
    if miss_sq >= 1.0 || nearest_at <= 0.0 {
        return Ground { rim_px, ..Ground::default() };
    }
    let normal = camera + sight * (nearest_at - (1.0 - miss_sq).sqrt());
    Ground {
        on_ground: true,
        lon_rad: normal.x.atan2(normal.y),
        lat_rad: normal.z.clamp(-1.0, 1.0).asin(),
        normal,
        rim_px,
    }
}
