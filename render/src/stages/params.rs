//! The parameters of a picture: what most stages read, and a struct for each stage with what it reads alone. Every
//! struct has the same name and fields in Rust and in WGSL; a test compares the two.

use contract::grid::Grid;
use glam::{IVec2, UVec2, Vec2, Vec3};

use crate::gpu::packed;
use crate::passes::cells::CellParams;
use crate::scene::Whole;
pub use crate::shared_struct::Fields;
use crate::stages::bin::params::ListParams;
use crate::stages::compose::base_map::BaseMapParams;
use crate::stages::compose::params::ContextParams;
use crate::stages::flow::params::FlowParams;
use crate::stages::interpolate::params::InterpolateParams;
use crate::stages::isolines::params::IsolineParams;
use crate::stages::light::params::LightParams;
use crate::stages::map::params::MapParams;
use crate::stages::particles::params::ParticleParams;
use crate::stages::project::params::ProjectParams;

shared_struct! {
    /// What is drawn and from where; lengths in earth radii, in the axes of eq. 4 (docs/method.md).
    pub struct ViewParams {
        /// The camera of a globe view.
        pub eye: Vec3,
        pub focal_px: f32,
        pub right: Vec3,
        /// A tile or the globe.
        pub kind: u32,
        pub up: Vec3,
        pub slices: u32,
        pub forward: Vec3,
        /// 1: slices are blended away from the eye.
        pub front_to_back: u32,
        /// Towards the sun.
        pub sun: Vec3,
        /// 1: the sun is given in east, north and up of every place; else in the axes of eq. 4 (docs/method.md).
        pub sun_is_local: u32,
        /// Towards the middle of the cap that is drawn, of any length, and what a cell's place times it is at least (globe).
        pub cap: Vec3,
        pub cap_least: f32,
        /// Light of the water round an eye below the sea surface, level or above (globe; day at the eye is in it).
        pub water: Vec3,
        /// Extinction of that water for each earth radius; 0 where there is none to look through.
        pub water_per_unit: f32,
        /// The same downwards, and of the core.
        pub deep: Vec3,
        /// Radius of the sphere that hides what lies beyond it, earth radii: 1, or that of the core from below the sea surface.
        pub hides: f32,
        /// Light of the sea surface from underneath, with the sun where a base map has no day or night.
        pub ceiling: Vec3,
        /// Share of what lies above the sea surface that is seen through it from underneath.
        pub ceiling_kept: f32,
        /// Of the part drawn.
        pub size_px: UVec2,
        /// Left and top of the part drawn (globe views are drawn in parts).
        pub origin_px: IVec2,
        /// Of the whole picture.
        pub center_px: Vec2,
        /// Screen tiles across and down the part drawn.
        pub tiles: UVec2,
        /// How much of the difference between day and night is shown of the sea surface from underneath, 0 to 1.
        pub sun_share: f32,
    }
}

shared_struct! {
    /// A grid of cells as the stages see it.
    pub struct GridParams {
        pub rows: u32,
        pub cols: u32,
        pub periodic: u32,
        pub west_rad: f32,
        pub north_rad: f32,
        pub cols_per_rad: f32,
        pub rows_per_rad: f32,
        /// Cells that the buffers of fields hold, the first and the end: all unless a field is too large to be held whole.
        pub held_first_cell: u32,
        pub held_end_cell: u32,
        /// Where it begins in the grid that it is a window of, and how many columns that has: random numbers are of cells there.
        pub whole_row: u32,
        pub whole_col: u32,
        pub whole_cols: u32,
    }
}

impl GridParams {
    /// The same of a window of a larger grid.
    #[must_use]
    pub fn window_of(self, whole: Option<&Whole>) -> Self {
        let Some(whole) = whole else { return self };
        Self {
            whole_row: whole.row,
            whole_col: whole.col,
            whole_cols: whole.grid.cols,
            ..self
        }
    }

    /// Row and column of a cell in the grid that this is a window of, which may go on beyond its last column.
    pub fn in_whole(&self, row: u32, col: u32) -> [u32; 2] {
        let col = self.whole_col + col;
        let turn = if col >= self.whole_cols {
            self.whole_cols
        } else {
            0
        };
        [self.whole_row + row, col - turn]
    }

    /// A grid whose fields are held whole.
    pub fn whole(grid: &Grid) -> Self {
        Self {
            rows: grid.rows,
            cols: grid.cols,
            periodic: u32::from(grid.is_periodic()),
            west_rad: grid.west_deg.to_radians() as f32,
            north_rad: grid.north_deg.to_radians() as f32,
            cols_per_rad: (1.0 / grid.dlon_deg.to_radians()) as f32,
            rows_per_rad: (1.0 / grid.dlat_deg.to_radians()) as f32,
            held_first_cell: 0,
            held_end_cell: grid.cell_count() as u32,
            whole_row: 0,
            whole_col: 0,
            whole_cols: grid.cols,
        }
    }
}

shared_struct! {
    /// How stored values are read: between which of their steps, and as which colour.
    pub struct ValueParams {
        /// Of the later step.
        pub weight: f32,
        /// Of the later step in the accumulated carbon.
        pub accumulated_weight: f32,
        /// Of the later step in the northward part of a flow.
        pub northward_weight: f32,
        pub has_accumulated: u32,
        pub transfer_low: f32,
        pub transfer_per_unit: f32,
        /// 1: the palette is followed by 256 words of opacity (low 16 bits) and size (next 8).
        pub has_shape: u32,
        /// 1: cells whose gap was filled are drawn differently.
        pub has_uncertainty: u32,
        /// 1: cells may hold data in a part of their area, as the domain says.
        pub has_coverage: u32,
        /// 1: the two numbers of the transfer function are those of binary logarithms.
        pub is_log: u32,
        /// 1: a pixel has the value of the cell that it lies in.
        pub is_nearest: u32,
    }
}

/// Declares [`Params`] and, in the same order, the numbers that stages name its structs by.
macro_rules! params {
    ($($number:ident $name:ident: $kind:ident,)*) => {
        /// Everything that all stages of one picture agree on.
        #[derive(Debug, Clone, Copy, Default, PartialEq)]
        pub struct Params {
            $(pub $name: $kind,)*
            /// The picture is composed with coast lines, terrain, sea or night: a variant of the shaders that compose.
            pub in_context: bool,
        }

        /// Which struct: bound at its number above [`FIRST_UNIFORM`](crate::gpu::FIRST_UNIFORM).
        #[derive(Debug, Clone, Copy)]
        pub enum Uniform { $($number,)* }

        impl Params {
            /// Name in the shaders, type, fields and bytes of every struct.
            pub const STRUCTS: &'static [(&'static str, &'static str, Fields, usize)] =
                &[$((stringify!($name), stringify!($kind), $kind::FIELDS, size_of::<$kind>()),)*];

            /// The bytes of all structs, as one buffer holds them.
            pub fn packed(&self) -> Vec<u8> {
                packed(&[$(bytemuck::bytes_of(&self.$name),)*])
            }
        }
    };
}

params! {
    View view: ViewParams,
    Grid grid: GridParams,
    Values values: ValueParams,
    Cells cells: CellParams,
    Particles particles: ParticleParams,
    Flow flow: FlowParams,
    Projection projection: ProjectParams,
    Lighting lighting: LightParams,
    Lists lists: ListParams,
    Interpolation interpolation: InterpolateParams,
    Thematic thematic: MapParams,
    Context context: ContextParams,
    TerrainGrid terrain_grid: GridParams,
    BaseMap base_map: BaseMapParams,
    Isolines isolines: IsolineParams,
}

impl From<Uniform> for u32 {
    fn from(uniform: Uniform) -> Self {
        uniform as Self
    }
}
