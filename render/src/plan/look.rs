//! The numbers behind the look of a picture that no job sets: sizes, numbers and thickness of particles.

use contract::base_map::BaseMap;
use contract::job::{Mode, RenderJob, View};

/// Turns of a particle through its column for each kg m⁻²: at 60 g m⁻² a year it rises three times a year.
pub(super) const TURNS_PER_KG_M2: f32 = 50.0;
/// Share of the optical depth that a cell without flux keeps.
pub(super) const FLOOR_DIVERGING: f32 = 0.5;
/// The same for quantities without a sign.
pub(super) const FLOOR_SEQUENTIAL: f32 = 0.45;
/// Light that reaches everything: in full shadow a colour keeps 0.8 of its place in sRGB, so that it still says the value.
pub(super) const AMBIENT: f32 = 0.62;
/// Direct light at full strength: above 1 together with the ambient, 1.05 in sRGB, so that lit slopes stand out.
pub(super) const DIRECT: f32 = 0.5;
/// Share of all light on the night side, where the sun is the real one: half as bright in sRGB.
pub(super) const NIGHT: f32 = 0.25;
/// Share of the eye's optical depth that dims light; the rest is scattered forwards.
pub(super) const LIGHT_DEPTH: f64 = 0.6;
/// Opacity of a thematic map: the base map shines through a little.
pub(super) const MAP_ALPHA: f32 = 0.9;
/// Pixels north that a metre of height moves a particle, in pixels a metre: the slope of the view of map tiles.
pub(super) const OBLIQUE: f64 = 0.35;
/// Largest particle, pixels: keeps positions and reaches far inside 32-bit integers.
pub(super) const MAX_RADIUS_PX: f32 = 100_000.0;
/// Shadows of a lower sun would fall far beyond a tile: particles of map tiles are lit as by this one, which the descriptions of the sun
/// in addresses and on the command line say.
pub(super) const LOWEST_SUN_DEG: f64 = 20.0;
/// Light texel over particle radius: depositing and looking up with hats of this width blurs as much as the
/// particle's own kernel does (variance texel²/3 against radius²/8).
pub(super) const TEXEL_PER_RADIUS: f64 = 0.612;

/// Light layer over particle radius: giving to the two nearest layers and summing half of its own blurs by half a layer
/// squared, the particle's own kernel by radius²/8.
pub(super) const LAYER_PER_RADIUS: f64 = 0.5;

/// Power of the light by which what is seen of it counts on globes where sun and eye stand equally high: of two places one
/// behind the other, so much deeper is the farther one in what dims the eye's sight than in what dims the light. Elsewhere
/// it is that times the sine of the sun's height over the eye's.
pub(super) const LOOK_POWER_GLOBE: f64 = 1.0 / LIGHT_DEPTH;
/// What is added to it on map tiles where a particle's radius is a slice.
const LOOK_POWER_OF_A_SLICE: f64 = 3.6;
/// More is nowhere nearer to the reference.
const MOST_LOOK_POWER: f64 = 2.0;

/// How much more of what is lit is seen than of what is dark on map tiles, as a power of the light, for particles with a
/// radius of so many slices. Where slices are thin, blending one after the other says what is seen; of what lies in one
/// slice nothing else does. Fitted to scenes with 16 to 256 slices (docs/performance-quality.md).
pub(super) fn look_power_tile(radius_slices: f64) -> f32 {
    let thick = LOOK_POWER_OF_A_SLICE / radius_slices.max(1e-3).powf(2.5);
    thick.min(MOST_LOOK_POWER) as f32
}

/// Clouds that overlap at a place: the fewer, the grainier; the more, the slower.
const CLOUDS_OVER_A_POINT: f64 = 50.0;
/// Radius of the largest clouds over the side of a cell: larger ones would blur what the grid resolves.
const WIDEST_CELLS: f64 = 2.1;

/// How much of its light the rim of a dot keeps, and what is added to it: over a dark ground, and over a light one.
const RIM_ON_DARK: [f32; 2] = [0.6, 0.22];
const RIM_ON_LIGHT: [f32; 2] = [0.2, 0.0];

/// The rims of a job's dots. Map tiles lie over the map of their client, which pale dots would vanish on where it is light.
pub(super) fn rim(job: &RenderJob) -> [f32; 2] {
    let is_dark =
        matches!(job.view, View::Globe { .. }) && job.style.context.base_map == BaseMap::Dark;
    if is_dark { RIM_ON_DARK } else { RIM_ON_LIGHT }
}

/// Whole numbers that sums of the light and the eye may reach.
const MOST_SUM: f64 = 2_147_483_648.0;
/// Depth of a whole beam of light over that of a cell's column at most: along the sheet of particles at the limb it is
/// some fifty times as deep.
const DEEPEST_BEAM: f64 = 512.0;
/// Largest number that an entry has for the depth of a splat.
const MOST_ENTRY_DEPTH: f64 = 65_535.0;
/// Optical depth 1 in the integers of the eye: coarser than the first, thick splats would be rounded; finer than the
/// second, slices that are no thicker than they may be would reach the end of their sums.
const EYE_ONE: [f64; 2] = [4096.0, 65_536.0];

/// Optical depth 1 in the integers that the light sums up, a power of two: as fine as sums of a beam allow, so that the
/// share of each of very many thin particles counts. The same for all pictures of a style.
pub(super) fn light_one(style_depth: f64) -> f32 {
    let deepest = DEEPEST_BEAM * LIGHT_DEPTH * style_depth.max(0.01);
    power_of_two((MOST_SUM / deepest).clamp(4096.0, 16_777_216.0))
}

/// The same in the integers that the eye sums up, for splats of at most this depth.
pub(super) fn eye_one(deepest_splat: f64) -> f32 {
    let [coarsest, finest] = EYE_ONE;
    power_of_two((MOST_ENTRY_DEPTH / deepest_splat.max(1e-3)).clamp(coarsest, finest))
}

fn power_of_two(most: f64) -> f32 {
    most.log2().floor().exp2() as f32
}

/// Radius of a trail's end is smaller by this share where it lies over another layer.
const TRAIL_TAPER: f32 = 0.15;

/// How particles of one mode look.
pub(super) struct Look {
    /// Radius over the side of a cell; for clouds the least.
    pub radius_cells: f64,
    /// Smallest radius.
    pub min_radius_px: f32,
    /// Largest radius.
    pub max_radius_px: f64,
    /// Radius of a particle without flux is smaller by this share.
    pub size_spread: f32,
    /// Random places spread over 2 to the minus this of a cell.
    pub jitter_shift: u32,
    /// Pixels for each particle: fewer particles a cell are drawn where cells are small.
    pub area_px_per_particle: f64,
    /// Optical depth at the centre if it is the same at any size, over the style's optical depth.
    pub center_depth: Option<f64>,
}

impl Look {
    /// How the particles of a job look.
    pub(super) fn of_job(job: &RenderJob) -> Self {
        let usual = Self::of(job.mode);
        let Some(own) = job.flow.as_ref().and_then(|flow| flow.look) else {
            return usual;
        };
        Self {
            min_radius_px: usual.min_radius_px.min(own.radius_px as f32),
            max_radius_px: own.radius_px,
            area_px_per_particle: own.area_px,
            // Tails as wide as heads, almost: dots of fast water would part.
            size_spread: TRAIL_TAPER,
            center_depth: Some(own.depth),
            ..usual
        }
    }

    pub(super) fn of(mode: Mode) -> Self {
        match mode {
            Mode::Points => Self {
                // With a rim, so that they stand apart from a ground of any tone.
                radius_cells: 0.09,
                min_radius_px: 2.0,
                max_radius_px: 4.2,
                size_spread: 0.15,
                jitter_shift: 0,
                area_px_per_particle: 16.0,
                center_depth: Some(3.0),
            },
            Mode::Sprites => Self {
                radius_cells: 0.24,
                min_radius_px: 2.2,
                max_radius_px: 28.0,
                size_spread: 0.45,
                jitter_shift: 0,
                area_px_per_particle: 12.0,
                center_depth: Some(2.0),
            },
            // Heads of trails; `area_px_per_particle` is that of a trail.
            Mode::Flow => Self {
                radius_cells: 0.4,
                min_radius_px: 0.9,
                max_radius_px: 1.6,
                size_spread: 0.45,
                jitter_shift: 0,
                area_px_per_particle: 36.0,
                center_depth: Some(0.8),
            },
            Mode::Volume | Mode::Map => Self {
                radius_cells: 0.85,
                min_radius_px: 1.8,
                max_radius_px: f64::INFINITY,
                size_spread: 0.1,
                jitter_shift: 5,
                area_px_per_particle: 1.8,
                center_depth: None,
            },
        }
    }

    /// Particles drawn in a cell of this side, at most what the style allows; never fewer than one. Not a whole number:
    /// the last one comes gradually.
    pub(super) fn particles_per_cell(&self, cell_px: f64, style: u32) -> f64 {
        let wanted = cell_px * cell_px / self.area_px_per_particle;
        wanted.min(f64::from(style)).max(1.0)
    }

    /// Radius of a full-size particle in a cell of this side, pixels. Clouds are larger where fewer share a cell, so
    /// that about as many overlap everywhere.
    pub(super) fn radius_px(&self, cell_px: f64, particles: f64) -> f64 {
        let least = f64::from(self.min_radius_px);
        let cells = if self.center_depth.is_some() {
            self.radius_cells
        } else {
            (CLOUDS_OVER_A_POINT / (std::f64::consts::PI * particles))
                .sqrt()
                .clamp(self.radius_cells, WIDEST_CELLS)
        };
        (cells * cell_px).clamp(least, self.max_radius_px.max(least))
    }

    /// Side of a square that stands for a cell: at least most of its longer side, so that rows leave no gaps where
    /// meridians run together.
    pub(super) fn side(width: f64, height: f64) -> f64 {
        (width * height).sqrt().max(0.8 * width.max(height))
    }

    /// Optical depth at a particle's centre for a column of optical depth 1: what the column's depth over its area is
    /// when spread over the kernel `(1 - q)²`, whose integral is a third of its disc.
    pub(super) fn depth_gain(
        &self,
        cell_area: f64,
        radius: f64,
        particles: f64,
        style_depth: f64,
    ) -> f64 {
        match self.center_depth {
            Some(depth) => depth / style_depth.max(1e-6),
            None => cell_area * 3.0 / (particles * std::f64::consts::PI * radius * radius),
        }
    }
}
