//! Moorings written with EPIC codes (PMEL): what a code measures, and which other codes flag it or say its depth.

use crate::inspect::file::description::Variable;

/// What a code means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Code {
    pub(super) property: &'static str,
    /// Codes of the flags that speak of it.
    pub(super) flags: &'static [u32],
    /// Code of a variable that holds its depth at each time.
    pub(super) depth: Option<u32>,
}

/// First and last code of flags; sources and instruments have the two thousands after them.
const FLAGS: std::ops::Range<u32> = 5000..6000;
const REMARKS: std::ops::Range<u32> = 5000..8000;
/// Places.
pub(super) const LATITUDE: u32 = 500;
pub(super) const LONGITUDE: u32 = 502;
/// Depths as an axis.
pub(super) const DEPTH: u32 = 3;
/// Depth of the surface temperature at each time.
const SURFACE_DEPTH: u32 = 2003;

/// A property and the flags of its code.
type Entry = (u32, &'static str, &'static [u32], Option<u32>);

/// Winds and currents of the array point where they blow and flow to. Components have no flags of their own: those of
/// speed and direction, or of both components, speak of them.
const CODES: [Entry; 14] = [
    (20, "sea_water_temperature", &[5020], None),
    (21, "air_temperature", &[5021], None),
    (25, "sea_surface_temperature", &[5025], Some(SURFACE_DEPTH)),
    (41, "sea_water_practical_salinity", &[5041], None),
    (300, "sea_water_speed", &[5320, 5321], None),
    (310, "sea_water_velocity_to_direction", &[5320, 5321], None),
    (320, "eastward_sea_water_velocity", &[5320], None),
    (321, "northward_sea_water_velocity", &[5321], None),
    (401, "wind_speed", &[5401], None),
    (410, "wind_to_direction", &[5410], None),
    (422, "eastward_wind", &[5401, 5410], None),
    (423, "northward_wind", &[5401, 5410], None),
    (LATITUDE, "latitude", &[5500, 5502], None),
    (LONGITUDE, "longitude", &[5500, 5502], None),
];
/// Relative humidity, as one more: it is not of the sea.
const HUMIDITY: Entry = (910, "relative_humidity", &[5910], None);

/// The EPIC code of a variable: its attribute, or the number behind its name (`QT_5025`).
pub(super) fn code_of(variable: &Variable) -> Option<u32> {
    let attributes = &variable.attributes;
    let stated = attributes
        .text("epic_code")
        .and_then(|text| text.parse().ok());
    let number = attributes.number("epic_code").map(|n| n as u32);
    // Some writers keep the code of a flag in its name only.
    let named = || {
        variable
            .name
            .strip_prefix('Q')?
            .rsplit_once('_')?
            .1
            .parse()
            .ok()
    };
    stated.or(number).or_else(named)
}

/// What a code measures, if it is one that is known.
pub(super) fn meaning(code: u32) -> Option<Code> {
    let entry = CODES
        .iter()
        .chain([&HUMIDITY])
        .find(|(known, ..)| *known == code);
    entry.map(|(_, property, flags, depth)| Code {
        property,
        flags,
        depth: *depth,
    })
}

/// Is it a place that was measured from day to day, as a buoy drifts around its anchor?
pub(super) fn is_measured_place(variable: &Variable) -> bool {
    matches!(code_of(variable), Some(LATITUDE | LONGITUDE)) && variable.dimensions.len() > 2
}

/// Is it the code of a flag?
pub(super) fn is_flag(code: u32) -> bool {
    FLAGS.contains(&code)
}

/// Is it the code of something said about measurements: a flag, a source, an instrument, a depth?
pub(super) fn is_remark(code: u32) -> bool {
    REMARKS.contains(&code) || code == SURFACE_DEPTH
}
