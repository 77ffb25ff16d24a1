//! Colours of the plain globe: the only place where they stand. The device reads them as parameters, mirrored in
//! `globe.wgsl`.

use contract::base_map::{Background, BaseMap};
use glam::Vec3;

use crate::stages::colour::linear_of;

/// Optical depth of all air straight up; what makes the globe's outline soft without a veil over its middle.
const AIR_DEPTH: f32 = 0.045;
/// Height over which the air thins by the factor e, earth radii: 64 km, some eight times that of the earth's air, which
/// would be a line of a pixel or two.
const AIR_HEIGHT: f32 = 0.01;
/// Depth from which on the sea has the colour of the deep, m.
const DEEP_M: f32 = 6000.0;
/// Height from which on land has the colour of mountains, m.
const HIGH_M: f32 = 4500.0;

shared_struct! {
    /// The plain globe as it is drawn; colours are red, green and blue of linear light, 0 to 1.
    pub struct BaseMapParams {
        pub land: Vec3,
        /// How much of the light on slopes is shown, 0 to 1.
        pub shading: f32,
        pub land_high: Vec3,
        pub high_m: f32,
        /// The sea where no floor is drawn.
        pub sea: Vec3,
        pub border_grey: f32,
        /// Shallow sea.
        pub shelf: Vec3,
        pub border_alpha: f32,
        pub deep: Vec3,
        pub deep_m: f32,
        /// What is added to the sea where the product has no data.
        pub hatch: Vec3,
        /// Optical depth of the air straight up.
        pub air_depth: f32,
        pub air: Vec3,
        /// Height over which the air thins by the factor e, earth radii.
        pub air_height: f32,
        pub sky: Vec3,
        /// 1: a sky is drawn behind the globe.
        pub sky_alpha: f32,
        pub lake: Vec3,
        /// How much of the difference between day and night is shown, 0 to 1.
        pub sun_share: f32,
        /// What is added to the sea of a relief where the product has no data.
        pub hatch_over_relief: Vec3,
        /// Grey and opacities of coasts and borders over what has colours of its own.
        pub over_grey: f32,
        pub over_coast_alpha: f32,
        pub over_border_alpha: f32,
    }
}

/// Grey and opacity of lines.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    pub grey: f32,
    pub alpha: f32,
}

/// Colours in sRGB, as they are named everywhere else.
struct Colours {
    land: [f32; 3],
    land_high: [f32; 3],
    sea: [f32; 3],
    shelf: [f32; 3],
    deep: [f32; 3],
    hatch: [f32; 3],
    air: [f32; 3],
    sky: [f32; 3],
    lake: [f32; 3],
    shading: f32,
    sun_share: f32,
    coast: Line,
    border: Line,
}

const DARK: Colours = Colours {
    land: [0.25, 0.265, 0.28],
    land_high: [0.37, 0.38, 0.39],
    sea: [0.035, 0.075, 0.14],
    shelf: [0.08, 0.15, 0.235],
    deep: [0.018, 0.042, 0.09],
    hatch: [0.05, 0.06, 0.07],
    air: [0.30, 0.50, 0.80],
    sky: [0.012, 0.016, 0.028],
    lake: [0.06, 0.115, 0.19],
    shading: 0.9,
    sun_share: 1.0,
    coast: Line {
        grey: 0.80,
        alpha: 0.50,
    },
    border: Line {
        grey: 0.70,
        alpha: 0.28,
    },
};

const LIGHT: Colours = Colours {
    land: [0.80, 0.79, 0.765],
    land_high: [0.87, 0.865, 0.85],
    sea: [0.62, 0.695, 0.755],
    shelf: [0.69, 0.755, 0.80],
    deep: [0.52, 0.61, 0.685],
    hatch: [-0.06, -0.055, -0.05],
    air: [0.62, 0.74, 0.87],
    sky: [0.945, 0.955, 0.965],
    lake: [0.66, 0.735, 0.79],
    shading: 0.35,
    sun_share: 0.45,
    coast: Line {
        grey: 0.20,
        alpha: 0.60,
    },
    border: Line {
        grey: 0.35,
        alpha: 0.40,
    },
};

/// What an eye below the sea surface sees, in sRGB: the surface from underneath, water level and above, water downwards.
struct Below {
    ceiling: [f32; 3],
    water: [f32; 3],
    deep: [f32; 3],
    /// Land and lakes on the surface, and coasts and borders.
    land: [f32; 3],
    lake: [f32; 3],
    line: Line,
}

const BELOW_DARK: Below = Below {
    ceiling: [0.60, 0.83, 0.88],
    water: [0.08, 0.22, 0.33],
    deep: [0.008, 0.022, 0.05],
    land: [0.12, 0.17, 0.20],
    lake: [0.36, 0.53, 0.58],
    line: Line {
        grey: 0.03,
        alpha: 0.75,
    },
};

const BELOW_LIGHT: Below = Below {
    ceiling: [0.86, 0.94, 0.96],
    water: [0.50, 0.67, 0.76],
    deep: [0.16, 0.29, 0.40],
    land: [0.42, 0.49, 0.53],
    lake: [0.66, 0.75, 0.79],
    line: Line {
        grey: 0.12,
        alpha: 0.75,
    },
};

/// A sea of middle depth as a relief has it, which is the same on both base maps, and how much lighter it is where the product
/// has no data, sRGB: as much as on the dark base map.
const RELIEF_SEA: [f32; 3] = [0.14, 0.28, 0.38];

/// How much darker the surface is from below where the product has no data, sRGB.
const HATCH_BELOW: [f32; 3] = [-0.05; 3];
/// Opacity of borders on it over that of coasts.
const BORDER_BELOW: f32 = 0.5;

/// Lines over a thematic map or a relief with colours of its own: their grey, opacities of coasts and of borders.
const OVER_COLOURS: [f32; 3] = [0.06, 0.75, 0.35];

fn colours(base_map: BaseMap) -> &'static Colours {
    match base_map {
        BaseMap::Dark => &DARK,
        BaseMap::Light => &LIGHT,
    }
}

/// Coasts over the plain globe.
pub fn coast(base_map: BaseMap) -> Line {
    colours(base_map).coast
}

fn below(base_map: BaseMap) -> &'static Below {
    match base_map {
        BaseMap::Dark => &BELOW_DARK,
        BaseMap::Light => &BELOW_LIGHT,
    }
}

/// Coasts on the sea surface seen from underneath.
pub fn coast_from_below(base_map: BaseMap) -> Line {
    below(base_map).line
}

/// Light of the water round an eye below the sea surface: level and above, and downwards.
pub fn water(base_map: BaseMap) -> [Vec3; 2] {
    let below = below(base_map);
    [below.water, below.deep].map(composed)
}

/// A colour as composition computes with it: linear light.
fn composed(srgb: [f32; 3]) -> Vec3 {
    linear_of(srgb.into())
}

/// The same of a grey.
pub fn composed_grey(srgb: f32) -> f32 {
    composed([srgb; 3]).x
}

fn sum(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

impl BaseMapParams {
    /// The sea surface seen from underneath.
    pub fn from_below(base_map: BaseMap, background: Background) -> Self {
        let below = below(base_map);
        let grey = composed_grey(below.line.grey);
        Self {
            land: composed(below.land),
            sea: composed(below.ceiling),
            lake: composed(below.lake),
            hatch: composed(sum(below.ceiling, HATCH_BELOW)) - composed(below.ceiling),
            border_grey: grey,
            border_alpha: below.line.alpha * BORDER_BELOW,
            ..Self::of(base_map, background)
        }
    }

    /// The plain globe in the colours of a base map, before a background.
    pub fn of(base_map: BaseMap, background: Background) -> Self {
        let colours = colours(base_map);
        let [over_grey, over_coast_alpha, over_border_alpha] = OVER_COLOURS;
        Self {
            land: composed(colours.land),
            shading: colours.shading,
            land_high: composed(colours.land_high),
            high_m: HIGH_M,
            sea: composed(colours.sea),
            border_grey: composed_grey(colours.border.grey),
            shelf: composed(colours.shelf),
            border_alpha: colours.border.alpha,
            deep: composed(colours.deep),
            deep_m: DEEP_M,
            // A difference of composed colours, so that sea of any depth is hatched alike.
            hatch: composed(sum(colours.sea, colours.hatch)) - composed(colours.sea),
            air_depth: AIR_DEPTH,
            air: composed(colours.air),
            air_height: AIR_HEIGHT,
            sky: composed(colours.sky),
            sky_alpha: f32::from(u8::from(background == Background::Sky)),
            lake: composed(colours.lake),
            sun_share: colours.sun_share,
            hatch_over_relief: composed(sum(RELIEF_SEA, DARK.hatch)) - composed(RELIEF_SEA),
            over_grey: composed_grey(over_grey),
            over_coast_alpha,
            over_border_alpha,
        }
    }
}
