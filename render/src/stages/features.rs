//! Uniform features of a picture, which decide what branches of a kernel are taken. Hardware jumps over the others; software
//! adapters (lavapipe) execute both sides of a branch under a mask, so they get kernels specialised by override constants, in
//! which the branches of other features are not compiled: `feature` in `prelude.wgsl`.

use crate::stages::layout::{KERNEL_CLOUD, LIGHT_ALONE, LIGHT_OFF, LIGHT_OWN, VIEW_TILE};
use crate::stages::params::Params;

/// Features, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Features(u32);

/// Declares the features in the order of their bits, each with what has it.
macro_rules! features {
    ($params:ident; $($(#[$doc:meta])+ $name:ident: $has:expr,)*) => {
        /// The name of each in the shaders and its bit.
        pub const NAMES: &[(&str, u32)] = {
            #[expect(non_camel_case_types, reason = "as the shaders spell them")]
            #[derive(Clone, Copy)]
            enum Bit { $($(#[$doc])+ $name,)* }
            &[$((stringify!($name), 1 << Bit::$name as u32),)*]
        };

        impl Features {
            /// Those of a picture.
            pub fn of($params: &Params) -> Self {
                let has = [$($has,)*];
                let bits = NAMES.iter().zip(has).filter(|(_, has)| *has);
                Self(bits.map(|((_, bit), _)| bit).sum())
            }
        }
    };
}

features! { params;
    /// The view is a tile.
    IS_TILE: params.view.kind == VIEW_TILE,
    /// The eye stands below the sea surface.
    IS_SUBMERGED: params.view.hides < 1.0,
    /// The globe, or the terrain of a tile, is seen.
    HAS_SURFACE: params.context.surface == 1,
    /// It is the terrain of the job.
    HAS_TERRAIN: params.context.terrain_on == 1,
    /// It is shaded by the relief of the program.
    HAS_SEA_FLOOR: params.context.sea_floor_on == 1,
    /// The sea has a colour of its own.
    HAS_WATER: params.context.has_water == 1,
    /// A thematic map is dark where it is night.
    HAS_NIGHT: params.context.night_on == 1,
    /// Particles of a tile are lit by the sun's place.
    HAS_DAY: params.projection.day_on == 1,
    /// The sun stands alike at every place.
    HAS_LOCAL_SUN: params.view.sun_is_local == 1,
    /// Coast lines are drawn.
    HAS_COAST: params.context.coast_on == 1,
    /// They lie over the picture.
    HAS_COAST_ABOVE: params.context.coast_above == 1,
    /// Isolines or a graticule are drawn.
    HAS_LINES: params.context.lines_on == 1,
    /// Trails lie on the sea.
    HAS_TRAILS: params.context.trails_on == 1,
    /// Land hides what lies behind it.
    LAND_HIDES: params.context.land_hides == 1,
    /// Cells may hold data in a part of their area.
    HAS_COVERAGE: params.values.has_coverage == 1,
    /// The palette is followed by opacities and sizes.
    HAS_SHAPE: params.values.has_shape == 1,
    /// Filled gaps are drawn differently.
    HAS_UNCERTAINTY: params.values.has_uncertainty == 1,
    /// Particles stand as high as carbon adds up to.
    HAS_ACCUMULATED: params.values.has_accumulated == 1,
    /// Colours are those of logarithms.
    IS_LOG: params.values.is_log == 1,
    /// The range of colours lies on both sides of zero.
    IS_DIVERGING: params.particles.diverging == 1,
    /// Particles are lit.
    IS_LIT: params.lighting.mode != LIGHT_OFF,
    /// The picture makes its own light.
    MAKES_LIGHT: params.lighting.mode == LIGHT_OWN,
    /// Light is made, and no picture.
    IS_LIGHT_ALONE: params.lighting.mode == LIGHT_ALONE,
    /// Slices are blended away from the eye.
    IS_FRONT_TO_BACK: params.view.front_to_back == 1,
    /// Particles are clouds.
    HAS_CLOUDS: params.lists.kernel == KERNEL_CLOUD,
    /// What lies below the sea is seen through it.
    HAS_SEA_DEPTH: params.particles.sea_per_m > 0.0,
    /// The grid goes round the globe.
    IS_PERIODIC: params.grid.periodic == 1,
    /// Values over land are left out.
    MASKS_LAND: params.context.land_masked == 1,
    /// Pixels of a thematic map have the value of their cell.
    IS_NEAREST: params.values.is_nearest == 1,
}

impl Features {
    /// Kernels ask the parameters of each picture.
    pub const ASKED: Self = Self(u32::MAX);

    /// Those that a shader asks for: pictures that differ in others have the same kernel.
    #[must_use]
    pub fn asked_by(self, source: &str) -> Self {
        let is_asked = |name: &str| source.contains(&format!("feature({name}, "));
        let asked = NAMES.iter().filter(|(name, _)| is_asked(name));
        Self(self.0 & asked.map(|(_, bit)| bit).sum::<u32>())
    }

    /// The value of `FEATURES` in the shaders.
    pub fn bits(self) -> u32 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Features {
        /// Made up: so many.
        pub(crate) fn with(self, bits: u32) -> Self {
            Self(self.0 ^ bits)
        }
    }

    fn bit(name: &str) -> u32 {
        let (_, bit) = NAMES.iter().find(|(own, _)| *own == name).unwrap();
        *bit
    }

    #[test]
    fn a_kernel_is_the_same_for_pictures_that_differ_in_what_it_does_not_ask() {
        let source = "if (feature(IS_LOG, values.is_log == 1u)) { }";
        let mut params = Params::default();
        let plain = Features::of(&params).asked_by(source);
        params.view.kind = u32::MAX;
        assert_eq!(Features::of(&params).asked_by(source), plain);
        params.values.is_log = 1;
        assert_eq!(Features::of(&params).asked_by(source).bits(), bit("IS_LOG"));
    }

    #[test]
    fn no_picture_has_all_features() {
        let all: u32 = NAMES.iter().map(|(_, bit)| bit).sum();
        assert!(
            all < Features::ASKED.bits(),
            "it would be taken for one that asks"
        );
    }
}
