//! How high and how deep columns go in a picture: accumulated carbon of the cells in it in, the most of either sign out.

use std::f64::consts::PI;

use contract::earth::SPHERE_RADIUS_M;
use contract::grid::Grid;
use contract::heights::HEIGHT_LIMIT_M;
use contract::job::RenderJob;
use render::plan::Projection;
use render::scene::Scene;
use render::stages::interpolate::cpu::interpolated;
use render::stages::layout::is_missing;

/// The most carbon that a column in a picture stands for, of either sign.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lifted {
    /// Given off: what rises, kg m⁻².
    pub up_kg_m2: f64,
    /// Taken up: what sinks, kg m⁻², at least 0.
    pub down_kg_m2: f64,
}

/// What a job's height bar needs to know; the job has one.
struct Wanted<'a> {
    projection: Projection,
    size: [f64; 2],
    grid: &'a Grid,
    m_per_kg_m2: f64,
}

impl Lifted {
    /// Of a loaded scene; nothing where the job has no height bar.
    pub fn of(job: &RenderJob, scene: &Scene) -> Self {
        let (Some(wanted), Some(carbon)) = (Wanted::of(job, &scene.grid), &scene.accumulated)
        else {
            return Self::default();
        };
        let [before, after] = [&carbon.before, &carbon.after].map(|field| field.cells.content());
        let weight = carbon.weight as f32;
        wanted.most(|cell| interpolated(before[cell], after[cell], weight))
    }
}

impl<'a> Wanted<'a> {
    fn of(job: &'a RenderJob, grid: &'a Grid) -> Option<Self> {
        job.annotations.as_ref()?.height?;
        Some(Self {
            projection: Projection::of(&job.view)?,
            size: job.view.size_px().map(f64::from),
            grid,
            m_per_kg_m2: job.style.height_m_per_kg_m2,
        })
    }

    /// The most of both signs, of `kg_m2` of every cell; a missing one has none.
    fn most(&self, kg_m2: impl Fn(usize) -> f32) -> Lifted {
        let mut most = Lifted::default();
        let Grid { rows, cols, .. } = *self.grid;
        let (below, _from_middle) = self.projection.stands();
        let (sin_below, cos_below) = below.lat.to_radians().sin_cos();
        let east = |col| {
            (self.grid.cell_center(0, col).lon - below.lon)
                .to_radians()
                .cos()
        };
        let east: Vec<f64> = (0..cols).map(east).collect();
        let least_cosine = self.reach().cos();
        for row in 0..rows {
            let (sin_lat, cos_lat) = self.grid.cell_center(row, 0).lat.to_radians().sin_cos();
            for (col, cos_east) in (0..cols).zip(&east) {
                let carbon = kg_m2((row * cols + col) as usize);
                let cosine = sin_lat * sin_below + cos_lat * cos_below * cos_east;
                if is_missing(carbon) || cosine < least_cosine {
                    continue;
                }
                let carbon = f64::from(carbon);
                let is_more = carbon > most.up_kg_m2 || -carbon > most.down_kg_m2;
                // Most cells have less than one that was met before: few need be looked for in the picture.
                if is_more && self.is_in_picture(row, col, carbon) {
                    most.up_kg_m2 = most.up_kg_m2.max(carbon);
                    most.down_kg_m2 = most.down_kg_m2.max(-carbon);
                }
            }
        }
        most
    }

    /// From the place below the camera to the farthest column whose end may be seen, radians.
    fn reach(&self) -> f64 {
        let beyond = (1.0 / (1.0 + HEIGHT_LIMIT_M / SPHERE_RADIUS_M)).acos();
        (self.projection.horizon() + beyond).min(PI)
    }

    /// Is the foot or the end of a cell's column in the picture, with nothing of the globe before it?
    fn is_in_picture(&self, row: u32, col: u32, kg_m2: f64) -> bool {
        let place = self.grid.cell_center(row, col);
        let end_m = (kg_m2 * self.m_per_kg_m2).clamp(-HEIGHT_LIMIT_M, HEIGHT_LIMIT_M);
        [0.0, end_m].into_iter().any(|height_m| {
            let seen = self.projection.seen(place, height_m);
            seen.is_some_and(|seen| {
                let [width, height] = self.size;
                seen.is_visible
                    && (0.0..width).contains(&seen.x_px)
                    && (0.0..height).contains(&seen.y_px)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use contract::annotation::{Annotations, HeightScale};
    use contract::camera::CameraAngles;
    use contract::job::View;
    use render::scene::{Field, Interval};
    use render_proof::ocean::{self, FIVE_DEGREES};

    use super::*;

    /// Looks north over the equator at the limb.
    fn job() -> RenderJob {
        let view = View::Globe {
            lon_deg: 2.5,
            lat_deg: 2.5,
            height_m: 3e6,
            width_px: 400,
            height_px: 400,
            angles: CameraAngles {
                tilt_deg: 30.0,
                ..CameraAngles::NADIR
            },
        };
        let since = "2000".parse().unwrap();
        RenderJob {
            grid: FIVE_DEGREES,
            annotations: Some(Annotations {
                height: Some(HeightScale { since }),
                ..Annotations::none()
            }),
            ..ocean::job(view)
        }
    }

    /// Carbon of one value all over but in some cells, by their middles.
    fn values(all: f32, others: &[([f64; 2], f32)]) -> Vec<f32> {
        let mut values = vec![all; FIVE_DEGREES.cell_count()];
        for ([lon, lat], value) in others {
            let (row, col) = ((90.0 - lat) / 5.0, (lon + 180.0) / 5.0);
            values[row as usize * 72 + col as usize] = *value;
        }
        values
    }

    fn scene(before: Field, after: Field, weight: f64) -> Scene {
        Scene {
            accumulated: Some(Interval {
                before: Arc::new(before),
                after: Arc::new(after),
                weight,
            }),
            ..ocean::scene(FIVE_DEGREES)
        }
    }

    /// What goes up and down, tenths of a gram a square metre.
    fn lifted(job: &RenderJob, values: &[f32]) -> [i64; 2] {
        let field = || Field::new(values.to_vec());
        let Lifted {
            up_kg_m2,
            down_kg_m2,
        } = Lifted::of(job, &scene(field(), field(), 0.0));
        [up_kg_m2, down_kg_m2].map(|kg_m2| (kg_m2 * 1e4).round() as i64)
    }

    #[test]
    fn what_is_in_the_picture_counts_for_its_side_and_nothing_else_does() {
        let job = job();
        let near = [[2.5, 12.5], [-2.5, 17.5]];
        // Behind the globe, behind the camera, and to its side.
        let elsewhere = [
            ([-177.5, -2.5], 0.9),
            ([2.5, -27.5], -0.8),
            ([82.5, 2.5], 0.7),
        ];
        let of = |up: f32, down: f32| {
            let own = [(near[0], up), (near[1], -down)];
            lifted(&job, &values(0.0, &[&own[..], &elsewhere[..]].concat()))
        };
        assert_eq!(of(0.03, 0.02), [300, 200]);
        assert_eq!(of(0.03, 0.0), [300, 0]);
        assert_eq!(of(0.0, 0.02), [0, 200]);
        assert_eq!(of(f32::NAN, 0.0), [0, 0]);
        // Its foot lies beyond the horizon, its end does not; a low one is hidden as a whole.
        let beyond = |kg_m2: f32| lifted(&job, &values(0.0, &[([2.5, 57.5], kg_m2)]));
        assert_eq!(beyond(0.15), [1500, 0]);
        assert_eq!(beyond(0.001), [0, 0]);
    }

    #[test]
    fn a_picture_without_a_height_bar_is_not_looked_through() {
        let mut job = job();
        job.annotations = None;
        assert_eq!(lifted(&job, &values(0.5, &[])), [0, 0]);
    }

    #[test]
    fn amounts_are_those_of_the_instant_and_what_is_missing_counts_for_nothing() {
        let job = job();
        let before = Field::new(values(0.01, &[([2.5, 12.5], f32::NAN)]));
        let after = Field::new(values(0.05, &[([2.5, 12.5], 0.9)]));
        let of = |scene: &Scene| Lifted::of(&job, scene).up_kg_m2;
        let scene = scene(before, after, 0.25);
        assert!((of(&scene) - 0.02).abs() < 1e-6, "{}", of(&scene));
    }
}
