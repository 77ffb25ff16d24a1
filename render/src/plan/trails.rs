//! Trails on the sea surface: the picture of a flow by itself in, what of it lies on the sea of another picture out.

use contract::job::RenderJob;

use super::Plan;
use crate::image::Image;
use crate::stages::layout::{BEYOND_M, VIEW_GLOBE};
use crate::stages::sphere::ground_below;

/// From which distance on particles of a job lie beyond the sea surface: trails lie on the sheet of particles that are not
/// lifted, and only what rises out of it lies above them.
pub(super) fn beyond_m(job: &RenderJob) -> f32 {
    if job.trails.is_some() {
        -BEYOND_M
    } else {
        BEYOND_M
    }
}

/// Room for trails, of which there are none yet.
pub(super) fn plan(plan: &mut Plan, job: &RenderJob) {
    if job.trails.is_some() {
        let [width, height] = plan.size_px;
        plan.trails = vec![0; width as usize * height as usize];
        plan.params.context.trails_row_px = width;
    }
}

impl Plan {
    /// Lays the picture of a flow, drawn alone in the same view, on the sea surface: less of it where land lies in a pixel,
    /// and nothing beside the globe.
    pub fn lay_trails(&mut self, drawn: &Image) {
        let params = self.params_of(self.whole());
        let is_globe = params.view.kind == VIEW_GLOBE;
        let has_land = params.context.land_hides == 1;
        let pixels = drawn.rgba8.chunks_exact(4).zip(&mut self.trails);
        for (at, (pixel, word)) in (0u32..).zip(pixels) {
            let mut alpha = u32::from(pixel[3]);
            if alpha > 0 && is_globe {
                let place = [at % drawn.width, at / drawn.width];
                let cover = (ground_below(&params, place).rim_px + 0.5).clamp(0.0, 1.0);
                alpha = (alpha as f32 * cover) as u32;
            }
            if has_land {
                let sea = 255 - (self.coast[at as usize] & 255);
                alpha = (alpha * sea + 127) / 255;
            }
            let rgb = u32::from_le_bytes([pixel[0], pixel[1], pixel[2], 0]);
            *word = rgb | alpha << 24;
        }
    }
}
