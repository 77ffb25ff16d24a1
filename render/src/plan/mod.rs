//! From a job and a scene to plain data for the stages: parameters, tables and the list of cells to draw.
//!
//! Everything that must not depend on which tile is drawn (slice planes, light texels, particle sizes and numbers)
//! is computed here from the scene and the zoom level alone.

mod camera;
mod context;
mod extent;
mod flow;
mod footprint;
mod globe;
mod ground;
mod held;
mod isolines;
mod later;
mod look;
mod masks;
mod projection;
mod shape;
mod tile;
mod trails;

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use contract::colour::Scale;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::heights::{HEIGHT_LIMIT_M, SHEET_M};
use contract::job::{Mode, RenderJob, View};
use glam::{UVec2, Vec3};

use crate::error::RenderError;
use crate::scene::{Interval, Scene};
use crate::stages::bin::params::ListParams;
use crate::stages::colour::{code_of, linear_of};
use crate::stages::interpolate::params::InterpolateParams;
use crate::stages::isolines::params::Isoline;
use crate::stages::layout::{
    Active, Axis, Col, GroundAxis, KERNEL_BALL, KERNEL_CLOUD, KERNEL_DOT, KERNEL_RIMMED, LIGHT_OFF,
    LIGHT_OWN, NEVER_LONG, Row, SCREEN_TILE_PX, SQUARE, SUBPIXELS, VIEW_TILE,
};
use crate::stages::light::params::LightParams;
use crate::stages::map::params::MapParams;
use crate::stages::params::{GridParams, Params, ValueParams, ViewParams};
use crate::stages::particles::params::ParticleParams;
use crate::stages::project::params::ProjectParams;
use crate::stages::sizes::{HALF_BYTES, workgroups};
use held::MOST_HELD_BYTES;
use look::Look;

pub use isolines::graticule_step_deg;
pub use later::Later;
pub use projection::{Projection, Seen};

/// 0 stands for no plan.
static NEXT_ID: AtomicU64 = AtomicU64::new(1);

/// Most particles of one picture, those of cells without data included.
const MOST_PARTICLES: u64 = 1 << 27;
/// Largest part of a picture drawn at once, pixels a side; a multiple of the screen tile.
const PART_PX: u32 = 2048;
/// Shorter lists are not cut into parts: on an H100 a frame that is tilted by 60 degrees, 1.13 M particles in 128 slices, takes 0.63 ms
/// with 1024 here, 0.56 with 512 and with 256, and one seen from above a pole 0.94, 0.95 and 1.35 ms.
const LEAST_LONG_LIST: u32 = 512;
/// A list is long that holds so many times the particles that all screen tiles would have if they had the same.
const LONG_OVER_FAIR: u32 = 1;
/// Largest share of its depth that a particle has at a place in its column.
const MOST_ENVELOPE: f64 = 24.0 / 23.0;
/// Particles that one invocation makes, unless cells hold fewer: neighbours share sums, more of them share better.
const PARTICLES_EACH: u32 = 4;

/// Everything the stages need for one picture.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Different for every plan made by this process; what is copied is the same.
    pub id: u64,
    pub mode: Mode,
    pub params: Params,
    pub rows: Vec<Row>,
    /// Those of the grid that this one is a window of; empty of one that is all there is.
    whole_rows: Vec<Row>,
    pub cols: Vec<Col>,
    /// The cells to draw, listed for the twins; devices find them by themselves.
    pub active: Vec<Active>,
    pub axes: Vec<Axis>,
    pub palette: Vec<u32>,
    /// The table of isolines; empty without any.
    pub isolines: Vec<Isoline>,
    /// Columns, then rows of a tile in its surroundings; empty otherwise.
    pub ground_axes: Vec<GroundAxis>,
    /// Words of the mask of the whole picture: coast lines of a tile, four pixels each; of a globe view land, lakes, shores
    /// and borders of one pixel. Empty without any; made while the particles are drawn.
    pub coast: Later<Arc<Vec<u32>>>,
    /// Trails on the sea surface as pixels of the whole picture, red lowest; empty without any.
    pub trails: Vec<u32>,
    /// Some screen tiles may hold many times the particles of others: a pole or the limb is in view.
    pub is_crowded: bool,
    size_px: [u32; 2],
}

/// A rectangle of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Part {
    pub origin_px: [u32; 2],
    pub size_px: [u32; 2],
}

impl Part {
    /// As good as no picture, for what is made besides.
    pub const NONE: Self = Self {
        origin_px: [0, 0],
        size_px: [1, 1],
    };

    /// Is it a part of a picture of this size, and not empty?
    pub fn is_within(self, size_px: [u32; 2]) -> bool {
        (0..2).all(|axis| {
            let end = self.origin_px[axis].checked_add(self.size_px[axis]);
            self.size_px[axis] > 0 && end.is_some_and(|end| end <= size_px[axis])
        })
    }

    /// Cut into those that are drawn at once, in reading order.
    pub(crate) fn pieces(self) -> Vec<Self> {
        let ([left, top], [width, height]) = (self.origin_px, self.size_px);
        let starts = |length: u32| (0..length).step_by(PART_PX as usize);
        let piece = |x: u32, y: u32| Self {
            origin_px: [left + x, top + y],
            size_px: [PART_PX.min(width - x), PART_PX.min(height - y)],
        };
        starts(height)
            .flat_map(|y| starts(width).map(move |x| piece(x, y)))
            .collect()
    }
}

impl Plan {
    /// The plan of a valid job with the list of its cells; `most_buffer_bytes` is the largest buffer to be filled.
    pub fn new(
        job: &RenderJob,
        scene: &Scene,
        most_buffer_bytes: u64,
    ) -> Result<Self, RenderError> {
        // The twins read fields where they are, whole.
        let mut plan = Self::holding(job, scene, most_buffer_bytes, u64::MAX)?;
        plan.list_cells(scene);
        Ok(plan)
    }

    /// The same without the list; quick, whatever the size of the grid.
    pub fn for_device(
        job: &RenderJob,
        scene: &Scene,
        most_buffer_bytes: u64,
    ) -> Result<Self, RenderError> {
        Self::holding(job, scene, most_buffer_bytes, MOST_HELD_BYTES)
    }

    /// The same with fields of more than `most_held_bytes` held in bands of rows.
    pub fn holding(
        job: &RenderJob,
        scene: &Scene,
        most_buffer_bytes: u64,
        most_held_bytes: u64,
    ) -> Result<Self, RenderError> {
        Self::check(job, scene)?;
        let mut plan = Self::viewed(job, scene);
        isolines::plan(&mut plan, job, scene);
        context::plan(&mut plan, job, scene);
        trails::plan(&mut plan, job);
        plan.choose_units(job);
        plan.count_particles(most_buffer_bytes)?;
        plan.choose_band(most_buffer_bytes, most_held_bytes)?;
        Ok(plan)
    }

    fn check(job: &RenderJob, scene: &Scene) -> Result<(), RenderError> {
        job.validate()?;
        scene.validate()?;
        if job.mode == Mode::Flow && scene.northward.is_none() {
            return Err(RenderError::NoNorthward);
        }
        if job.trails.is_some() && scene.trails.is_none() {
            return Err(RenderError::NoTrails);
        }
        Ok(())
    }

    /// What follows from the view, before anything is counted.
    fn viewed(job: &RenderJob, scene: &Scene) -> Self {
        let size_px = job.view.size_px();
        let mut plan = Self {
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            mode: job.mode,
            params: common(job, scene),
            rows: vec![],
            whole_rows: vec![],
            cols: vec![],
            active: vec![],
            axes: vec![],
            palette: palette(job),
            isolines: vec![],
            ground_axes: vec![],
            coast: Later::default(),
            trails: vec![],
            is_crowded: false,
            size_px,
        };
        match job.view {
            View::Tile { tile, size_px } => {
                tile::plan(&mut plan, job, scene, (tile, size_px));
            }
            View::Globe { .. } => globe::plan(&mut plan, job, scene),
        }
        plan
    }

    /// Whole numbers that depths are summed up in: by what all pictures of a style or of a zoom level share, so that
    /// neighbours round alike.
    fn choose_units(&mut self, job: &RenderJob) {
        let style_depth = job.style.optical_depth;
        let gain = self.all_rows().iter().map(|row| f64::from(row.depth_gain));
        let gain = gain.fold(0.0, f64::max);
        let thinnest = 1.0 - f64::from(self.params.projection.size_spread);
        let params = &mut self.params;
        params.lighting.depth_one = look::light_one(style_depth);
        params.lists.depth_one =
            look::eye_one(style_depth * gain * MOST_ENVELOPE / (thinnest * thinnest).max(1e-3));
    }

    /// Rows of all of the grid, whichever window of it is drawn.
    fn all_rows(&self) -> &[Row] {
        match &self.whole_rows[..] {
            [] => &self.rows,
            whole => whole,
        }
    }

    /// Rows and columns of a grid that a picture can show something of; columns may go on beyond the last one where the grid goes
    /// all the way round. `carbon` is the range of what is accumulated, if anything is. None where it shows nothing of it.
    pub fn seen_cells(
        job: &RenderJob,
        grid: &Grid,
        carbon: Option<[f32; 2]>,
    ) -> Option<[Range<u32>; 2]> {
        let plan = Self::viewed(job, &Scene::unread(*grid, carbon, None));
        let [rows, cols] = match job.view {
            View::Tile { size_px, .. } => tile::seen(&plan, grid, size_px),
            View::Globe { .. } => globe::seen(&plan, job, grid),
        };
        let cols = covering(cols, grid)?;
        let (first, last) = (rows.first()?, rows.last()?);
        Some([*first..last + 1, cols])
    }

    fn count_particles(&mut self, most_buffer_bytes: u64) -> Result<(), RenderError> {
        let params = &mut self.params;
        params.cells.particles_each = match self.mode {
            // All dots of a trail, which lie along one way.
            Mode::Flow => flow::TRAIL_DOTS,
            Mode::Map | Mode::Points | Mode::Sprites | Mode::Volume => {
                params.cells.particles_per_cell.clamp(1, PARTICLES_EACH)
            }
        };
        let groups: u64 = workgroups(params).into_iter().map(u64::from).product();
        let count = groups * u64::from(SQUARE * SQUARE * params.cells.particles_each);
        let limit = MOST_PARTICLES.min(most_buffer_bytes / HALF_BYTES);
        if count > limit {
            return Err(RenderError::TooManyParticles { count, limit });
        }
        params.cells.splat_count = count as u32;
        Ok(())
    }

    /// Lists the cells of the domain that a device would visit, by the rule of `splat.wgsl`.
    fn list_cells(&mut self, scene: &Scene) {
        let params = &self.params;
        let domain = scene.domain.content();
        let rows = params.cells.first_row..params.cells.first_row + params.cells.row_count;
        for row in rows {
            for (slot, col) in (0..).zip(&self.cols) {
                let cell = row * params.grid.cols + col.index;
                if domain[cell as usize] != 0 && is_in_cap(params, &self.rows[row as usize], col) {
                    self.active.push(Active { cell, slot });
                }
            }
        }
    }

    /// The picture cut into parts that are drawn at once, in reading order.
    pub fn parts(&self) -> Vec<Part> {
        self.whole().pieces()
    }

    /// The whole picture as one part.
    pub fn whole(&self) -> Part {
        Part {
            origin_px: [0, 0],
            size_px: self.size_px,
        }
    }

    /// Parameters for drawing one part.
    pub fn params_of(&self, part: Part) -> Params {
        let mut params = self.params;
        let tiles = UVec2::from(part.size_px.map(|px| px.div_ceil(SCREEN_TILE_PX)));
        params.view.size_px = part.size_px.into();
        params.view.origin_px = UVec2::from(part.origin_px).as_ivec2();
        params.view.tiles = tiles;
        let fair_share = params.cells.splat_count / tiles.element_product().max(1);
        params.lists.long_list = if self.is_crowded {
            LEAST_LONG_LIST.max(fair_share.saturating_mul(LONG_OVER_FAIR))
        } else {
            NEVER_LONG
        };
        params
    }

    /// Whole picture, pixels.
    pub fn size_px(&self) -> [u32; 2] {
        self.size_px
    }
}

/// The fewest columns side by side that hold all of these.
fn covering(mut cols: Vec<u32>, grid: &Grid) -> Option<Range<u32>> {
    cols.sort_unstable();
    cols.dedup();
    let (first, last) = (*cols.first()?, *cols.last()?);
    if !grid.is_periodic() {
        return Some(first..last + 1);
    }
    // Behind each the next one, behind the last the first of the next turn.
    let next = cols.iter().skip(1).copied().chain([first + grid.cols]);
    let gaps = cols.iter().zip(next).map(|(own, next)| (next - own, next));
    let (gap, start) = gaps.max_by_key(|(gap, start)| (*gap, std::cmp::Reverse(*start)))?;
    let start = start % grid.cols;
    Some(start..start + grid.cols + 1 - gap)
}

/// Side of a grid's cells in a view, pixels: at the equator of a tile's level, where a globe view's ground is nearest.
pub fn cell_px(view: &View, grid: &Grid) -> f64 {
    let cell_deg = (grid.dlon_deg * grid.dlat_deg).sqrt();
    match *view {
        View::Tile { tile, size_px } => tile::world_px(tile, size_px) * cell_deg / 360.0,
        View::Globe { .. } => camera::Camera::of(view).map_or(0.0, |camera| {
            cell_deg.to_radians() * camera.focal_px / camera.nearest
        }),
    }
}

/// Parameters that do not depend on the view.
fn common(job: &RenderJob, scene: &Scene) -> Params {
    let (style, grid) = (&job.style, &scene.grid);
    let transfer = &style.transfer;
    let look = Look::of_job(job);
    let weight = |interval: &Interval| interval.weight as f32;
    let (transfer_low, transfer_per_unit) = shape::place_params(transfer);
    let [rim_kept, rim_added] = look::rim(job);
    Params {
        view: ViewParams {
            slices: style.slices,
            front_to_back: 1,
            hides: 1.0,
            ..ViewParams::default()
        },
        grid: GridParams::whole(grid).window_of(scene.whole.as_ref()),
        values: ValueParams {
            weight: weight(&scene.value),
            accumulated_weight: scene.accumulated.as_ref().map_or(0.0, weight),
            northward_weight: scene.northward.as_ref().map_or(0.0, weight),
            has_accumulated: u32::from(scene.accumulated.is_some()),
            transfer_low,
            transfer_per_unit,
            is_log: u32::from(transfer.scale == Scale::Log),
            has_shape: u32::from(shape::is_given(transfer)),
            has_uncertainty: u32::from(style.uncertainty && scene.value.has_uncertainty()),
            has_coverage: u32::from(scene.domain.is_joined()),
            is_nearest: u32::from(style.nearest),
        },
        particles: ParticleParams {
            jitter_shift: look.jitter_shift,
            diverging: u32::from(shape::is_diverging(transfer)),
            strength_per_unit: (1.0 / transfer.low.abs().max(transfer.high.abs())) as f32,
            depth_floor: shape::depth_floor(transfer),
            optical_depth: style.optical_depth as f32,
            height_m_per_kg_m2: style.height_m_per_kg_m2 as f32,
            height_limit_m: HEIGHT_LIMIT_M as f32,
            sheet_m: SHEET_M as f32,
            turns_per_kg_m2: look::TURNS_PER_KG_M2,
            sea_per_m: style.context.sea_extinction_per_m() as f32,
        },
        projection: ProjectParams {
            size_spread: shape::size_spread(transfer, &look),
            min_radius_px: look.min_radius_px,
            max_radius_px: look::MAX_RADIUS_PX,
            lon_span_rad: grid.dlon_deg.to_radians() as f32,
            beyond_m: trails::beyond_m(job),
            ..ProjectParams::default()
        },
        lighting: lighting(job),
        lists: ListParams {
            kernel: match job.mode {
                Mode::Points => KERNEL_RIMMED,
                Mode::Flow => KERNEL_DOT,
                Mode::Sprites => KERNEL_BALL,
                Mode::Volume | Mode::Map => KERNEL_CLOUD,
            },
            rim_kept,
            rim_added,
            ..ListParams::default()
        },
        interpolation: InterpolateParams {
            first_cell: 0,
            end_cell: grid.cell_count() as u32,
        },
        thematic: MapParams {
            alpha: look::MAP_ALPHA,
            ..MapParams::default()
        },
        ..Params::default()
    }
}

fn lighting(job: &RenderJob) -> LightParams {
    LightParams {
        mode: if job.mode == Mode::Volume {
            LIGHT_OWN
        } else {
            LIGHT_OFF
        },
        // Map tiles have the layers of the eye's slices.
        layers: job.style.slices,
        part: 1.0,
        sunward_per_slice: 1.0,
        deeper: 1.0,
        ambient: look::AMBIENT,
        direct: look::DIRECT,
        night: if job.style.sun.subsolar.is_some() {
            look::NIGHT
        } else {
            1.0
        },
        ..LightParams::default()
    }
}

/// 256 colours of the transfer function, red lowest: sRGB for maps, linear light by its codes for particles. Behind them
/// its opacity and size where users gave any.
fn palette(job: &RenderJob) -> Vec<u32> {
    let transfer = &job.style.transfer;
    let byte = |share: f64| match job.mode {
        Mode::Map => (share * 255.0).round() as u32,
        Mode::Points | Mode::Sprites | Mode::Volume | Mode::Flow => {
            code_of(linear_of(Vec3::splat(share as f32)).x)
        }
    };
    let colours = (0..256).map(|i| {
        let value = transfer.value_at(f64::from(i) / 255.0);
        let [r, g, b] = transfer.colour(value);
        byte(r) | byte(g) << 8 | byte(b) << 16
    });
    colours.chain(shape::table(job.mode, transfer)).collect()
}

/// Lowest and highest particle, m: from the fields, so that every tile of an instant has the same slice planes.
fn height_range_m(job: &RenderJob, scene: &Scene) -> [f64; 2] {
    let [low, high] = scene.accumulated.as_ref().map_or([0.0; 2], Interval::range);
    let scaled = |kg_m2: f32| {
        (f64::from(kg_m2) * job.style.height_m_per_kg_m2).clamp(-HEIGHT_LIMIT_M, HEIGHT_LIMIT_M)
    };
    // Half the sheet, and a metre so that rounding cannot put a particle outside.
    let sheet = 0.5 * SHEET_M + 1.0;
    [scaled(low).min(0.0) - sheet, scaled(high).max(0.0) + sheet]
}

/// Shift that makes positions up to `widest_px` beyond a screen tile fit 16 bits with their sign.
fn entry_shift(widest_px: f64) -> u32 {
    let farthest_sub = (widest_px + 2.0 * f64::from(SCREEN_TILE_PX)) * f64::from(SUBPIXELS);
    (farthest_sub / f64::from(i16::MAX)).max(1.0).log2().ceil() as u32
}

/// Is a cell near enough to the place below the camera to be seen, or to shadow what is seen?
fn is_in_cap(params: &Params, row: &Row, col: &Col) -> bool {
    let center = Vec3::new(
        row.cos_lat * col.sin_lon,
        row.cos_lat * col.cos_lon,
        row.sin_lat,
    );
    params.view.kind == VIEW_TILE || center.dot(params.view.cap) >= params.view.cap_least
}

/// Area of the cells of every row, m².
fn area_m2(grid: &Grid, row: u32) -> f32 {
    grid.cell_area_m2(row, Earth::Wgs84) as f32
}
