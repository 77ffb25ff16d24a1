//! One measured variable of a NetCDF file: what it measures, in which unit, and which coordinates and flags are its own.

use contract::event::RejectReason;

use super::argo;
use super::convert::Conversion;
use super::coordinate::{self, Coordinate, Says};
use super::epic;
use super::pressure;
use super::property;
use super::quality::{self, Scheme};
use super::recognise::Feature;
use super::sampling::Sampling;
use crate::error::{Rejection, Stop};
use crate::inspect::file::description::{Description, Kind, Variable};
use crate::inspect::reader::session::Session;
use crate::plan::cf::calendar::{Calendar, TimeUnit};
use crate::plan::method;
use crate::plan::unit;

/// What numbers lack that are none of samples.
const NO_NAME: &str = "has neither a standard name nor a unit";
const NO_PLACE: &str = "has no latitude, longitude and time for each of its values";

/// A measured variable with all that its samples need.
pub(super) struct Measured<'a> {
    pub(super) variable: &'a Variable,
    pub(super) conversion: Conversion,
    pub(super) time: Coordinate,
    pub(super) time_unit: TimeUnit,
    pub(super) latitude: Coordinate,
    pub(super) longitude: Coordinate,
    pub(super) depth: Option<(Coordinate, ToDepth)>,
    /// Are samples at depths of all kinds, so that nobody knows how deep one is whose depth is missing?
    pub(super) is_of_depths: bool,
    pub(super) flags: Vec<(Coordinate, Scheme)>,
    /// Mode of each cast of a float, where that says whether the variable counts, and the values that count where it does not.
    pub(super) mode: Option<(Coordinate, Option<Coordinate>)>,
}

/// How a vertical coordinate becomes metres below the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ToDepth {
    /// It is a length, up or down.
    Length { factor: f64 },
    /// It is the pressure of the water.
    Pressure { dbar_per_unit: f64 },
}

impl ToDepth {
    /// Metres below the surface of a number of the coordinate.
    pub(super) fn depth_m(self, number: f64, lat_deg: f64) -> f64 {
        match self {
            Self::Length { factor } => number * factor,
            Self::Pressure { dbar_per_unit } => pressure::depth_m(number * dbar_per_unit, lat_deg),
        }
    }
}

/// Can it be a measured variable: numbers that are neither coordinates nor remarks?
pub(super) fn is_candidate(file: &Description, variable: &Variable) -> bool {
    let attributes = &variable.attributes;
    let is_remark = epic::code_of(variable).is_some_and(epic::is_remark)
        || attributes
            .text("standard_name")
            .is_some_and(quality::is_flag_name)
        || [
            "flag_values",
            "flag_masks",
            "sample_dimension",
            "instance_dimension",
            "cf_role",
        ]
        .iter()
        .any(|name| attributes.0.contains_key(*name))
        || attributes.text("long_name").is_some_and(is_about_quality);
    let is_bounds = file
        .variables
        .iter()
        .any(|v| v.attributes.text("bounds") == Some(variable.name.as_str()));
    let is_axis = coordinate::says(variable).is_some() && !epic::is_measured_place(variable);
    variable.is_numeric() && !variable.dimensions.is_empty() && !is_remark && !is_bounds && !is_axis
}

/// Is it of a variable that was measured? Numbers without a name, or without a place and a time, are of something else.
pub(super) fn is_of_samples(rejection: &Rejection) -> bool {
    ![NO_NAME, NO_PLACE].contains(&rejection.detail.as_str())
}

fn is_about_quality(long_name: &str) -> bool {
    let lower = long_name.to_ascii_lowercase();
    lower.ends_with("quality") || lower.ends_with("quality flag") || lower.ends_with(" flag")
}

/// Name of what a variable measures; none if nothing says it and it has no unit either.
fn property_of(variable: &Variable) -> Option<String> {
    /// Short names of files without standard names.
    const SHORT: [(&str, &str); 9] = [
        ("temp", "sea_water_temperature"),
        ("temperature", "sea_water_temperature"),
        ("sal", "sea_water_practical_salinity"),
        ("salinity", "sea_water_practical_salinity"),
        ("psal", "sea_water_practical_salinity"),
        ("sst", "sea_surface_temperature"),
        ("sss", "sea_surface_salinity"),
        ("sigma_t", "sea_water_sigma_t"),
        ("airt", "air_temperature"),
    ];
    let standard = variable
        .attributes
        .text("standard_name")
        .map(property::name_of);
    let by_code = || {
        variable.attributes.0.get("epic_code")?;
        let meaning = epic::meaning(epic::code_of(variable)?)?;
        Some(meaning.property.to_owned())
    };
    let short = || {
        let name = variable.name.to_ascii_lowercase();
        let known = SHORT.iter().find(|(short, _)| *short == name)?;
        Some(known.1.to_owned())
    };
    let own = || {
        variable
            .attributes
            .text("units")
            .map(|_| property::name_of(&variable.name))
    };
    standard
        .filter(|name| !name.is_empty())
        .or_else(by_code)
        .or_else(short)
        .or_else(own)
        .filter(|name| !name.is_empty())
}

/// Finds all that the samples of a variable need; or why there is no sense in them.
pub(super) async fn prepare<'a>(
    session: &mut Session,
    file: &Description,
    variable: &'a Variable,
    (feature, sampling): (Feature, &Sampling),
) -> Result<Result<Measured<'a>, Rejection>, Stop> {
    let refuse = |reason, detail: String| Ok(Err(Rejection::new(reason, &variable.name, detail)));
    let Some(property) = property_of(variable) else {
        return refuse(RejectReason::Unit, NO_NAME.to_owned());
    };
    let spelling = variable.attributes.text("units").unwrap_or_default();
    let conversion = match Conversion::new(&property, spelling) {
        Ok(conversion) => conversion,
        Err(wrong) => return refuse(RejectReason::Unit, wrong),
    };
    let found = [
        coordinate::find(session, file, variable, sampling, Says::Time).await?,
        place(session, file, variable, sampling, Says::Latitude).await?,
        place(session, file, variable, sampling, Says::Longitude).await?,
    ];
    let [Some(time), Some(latitude), Some(longitude)] = found else {
        let detail = NO_PLACE.to_owned();
        return refuse(RejectReason::NoVariable, detail);
    };
    let time_unit = match time_unit(file, &time.name) {
        Ok(unit) => unit,
        Err(wrong) => return Ok(Err(Rejection::new(RejectReason::Time, &time.name, wrong))),
    };
    if let Some(wrong) = no_value(variable, &property, &time.name) {
        return refuse(RejectReason::Values, wrong);
    }
    let is_of_casts = feature.is_of_casts();
    let depth = match depth(session, file, variable, (is_of_casts, sampling)).await? {
        Ok(depth) => depth,
        Err(rejection) => return Ok(Err(rejection)),
    };
    let is_of_levels = || has_levels(variable, sampling, &[&time, &latitude, &longitude]);
    if is_of_casts && depth.is_none() && is_of_levels() {
        let detail = "has values at several depths, and nothing says which; give a depth in m, or sea_water_pressure in dbar";
        return refuse(RejectReason::NoVariable, detail.to_owned());
    }
    let is_deep = |(coordinate, to): &(Coordinate, ToDepth)| {
        is_by_level(variable, coordinate, &[&time, &latitude, &longitude])
            || reaches_down(coordinate, *to)
    };
    let is_of_depths = is_of_casts || depth.as_ref().is_some_and(is_deep);
    let mode = mode(session, file, variable, sampling).await?;
    Ok(Ok(Measured {
        mode,
        conversion,
        time,
        time_unit,
        latitude,
        longitude,
        depth,
        is_of_depths,
        flags: flags(session, file, variable, sampling).await?,
        variable,
    }))
}

/// The mode of each cast of a float and the values of the variable's twin, if it has one.
async fn mode(
    session: &mut Session,
    file: &Description,
    variable: &Variable,
    sampling: &Sampling,
) -> Result<Option<(Coordinate, Option<Coordinate>)>, Stop> {
    let Some(twin) = argo::twin(file, variable) else {
        return Ok(None);
    };
    let Some(modes) = argo::modes(session, file, variable).await? else {
        return Ok(None);
    };
    let modes = (modes.dimensions.as_slice(), modes.values);
    let mode = coordinate::along("the modes of casts", modes, variable, sampling);
    let twin = coordinate::beside(session, twin, variable, sampling).await?;
    Ok(mode.map(|mode| (mode, twin)))
}

/// Where the values of a variable are; measured places are at themselves.
async fn place(
    session: &mut Session,
    file: &Description,
    variable: &Variable,
    sampling: &Sampling,
    what: Says,
) -> Result<Option<Coordinate>, Stop> {
    let code = match what {
        Says::Latitude => epic::LATITUDE,
        _ => epic::LONGITUDE,
    };
    let is_it = |v: &&Variable| epic::is_measured_place(v) && epic::code_of(v) == Some(code);
    if epic::is_measured_place(variable)
        && let Some(beside) = file.variables.iter().find(is_it)
    {
        return coordinate::beside(session, beside, variable, sampling).await;
    }
    coordinate::find(session, file, variable, sampling, what).await
}

/// What values of a variable are where they are not those of its property, by its `cell_methods`: they would be taken for them. A
/// name of the file's own, and one that speaks of extremes itself (gusts), is what the file says.
fn no_value(variable: &Variable, property: &str, time: &str) -> Option<String> {
    let is_own =
        variable.attributes.text("standard_name").is_none() && property::known(property).is_none();
    let words = ["gust", "maximum", "minimum"];
    if is_own || words.iter().any(|word| property.contains(word)) {
        return None;
    }
    let (method, what) = method::other_over_time(variable, Some(time))?;
    Some(format!(
        "holds {what} over time (cell_methods {method:?}) and would be taken for {property} itself"
    ))
}

/// Does a variable of casts have a dimension that is neither of their times nor of their places? Then it runs over depths, as
/// the samples of ragged casts do.
fn has_levels(variable: &Variable, sampling: &Sampling, known: &[&Coordinate]) -> bool {
    let mut dimensions = variable.dimensions.iter().enumerate();
    dimensions.any(|(place, dimension)| {
        let is_of_samples =
            dimension.name.is_some() && dimension.name.as_deref() == sampling.sample_dimension();
        is_of_samples || !known.iter().any(|of| of.varies_along(place))
    })
}

/// Does a depth run along a dimension of its own, that neither times nor places run along?
fn is_by_level(variable: &Variable, depth: &Coordinate, others: &[&Coordinate]) -> bool {
    let mut dimensions = variable.dimensions.iter().enumerate();
    dimensions.any(|(place, dimension)| {
        dimension.len > 1
            && depth.varies_along(place)
            && !others.iter().any(|of| of.varies_along(place))
    })
}

/// Is one of the depths of a coordinate beyond what ships and buoys measure "the surface" at: that of a glider or a diver?
fn reaches_down(depth: &Coordinate, to: ToDepth) -> bool {
    // Only casts have their depth by pressure, for which alone the latitude matters.
    (depth.values.iter()).any(|number| to.depth_m(*number, 0.0) > property::SURFACE_M)
}

fn time_unit(file: &Description, name: &str) -> Result<TimeUnit, String> {
    let attributes = &file.variable(name).ok_or("is not in the file")?.attributes;
    let calendar = Calendar::parse(attributes.text("calendar"))?;
    if !calendar.is_real() {
        return Err(format!(
            "is in the calendar {}, in which nothing was measured; give times of the real calendar",
            calendar.name()
        ));
    }
    TimeUnit::parse(attributes.text("units").ok_or("has no units")?, calendar)
}

/// The vertical coordinate of a variable: a depth of its own, or the file's; of casts the pressure of the water, if there is no
/// depth.
async fn depth(
    session: &mut Session,
    file: &Description,
    variable: &Variable,
    (is_of_casts, sampling): (bool, &Sampling),
) -> Result<Result<Option<(Coordinate, ToDepth)>, Rejection>, Stop> {
    let own = epic::code_of(variable)
        .and_then(epic::meaning)
        .and_then(|code| code.depth);
    if let Some(own) = own
        && let Some(beside) = file
            .variables
            .iter()
            .find(|v| epic::code_of(v) == Some(own))
        && let Some(found) = coordinate::beside(session, beside, variable, sampling).await?
    {
        return Ok(Ok(Some((found, ToDepth::Length { factor: 1.0 }))));
    }
    let mut found = coordinate::find(session, file, variable, sampling, Says::Depth).await?;
    if found.is_none() && is_of_casts {
        found = coordinate::find(session, file, variable, sampling, Says::Pressure).await?;
    }
    let Some(mut found) = found else {
        return Ok(Ok(None));
    };
    let Some(vertical) = file.variable(&found.name) else {
        return Ok(Ok(None));
    };
    if let Some(values) = argo::counting(session, file, vertical).await? {
        found.values = values;
    }
    Ok(match to_depth(vertical) {
        Ok(to) => Ok(Some((found, to))),
        Err(detail) => Err(Rejection::new(RejectReason::Unit, &found.name, detail)),
    })
}

/// How the numbers of a vertical coordinate become depths, or what is wrong with its unit.
fn to_depth(vertical: &Variable) -> Result<ToDepth, String> {
    let text = |name: &str| vertical.attributes.text(name).unwrap_or_default();
    let spelling = text("units");
    if pressure::is_pressure(vertical) {
        let Some(dbar_per_unit) = pressure::dbar_per_unit(spelling) else {
            return Err(format!(
                "has unit {spelling:?}, which is none of pressure; give it in dbar, or depths in m"
            ));
        };
        return Ok(ToDepth::Pressure { dbar_per_unit });
    }
    let metre = |spelling: &str| {
        let (own, metre) = (unit::parse(spelling).ok()?, unit::parse("m").ok()?);
        (own.dimension == metre.dimension).then_some(own.factor)
    };
    let Some(factor) = metre(if spelling.is_empty() { "m" } else { spelling }) else {
        return Err(format!(
            "has unit {spelling:?}, which is no length; give depths in m"
        ));
    };
    let is_up = text("positive").eq_ignore_ascii_case("up")
        || text("positive").is_empty() && matches!(text("standard_name"), "height" | "altitude");
    let sign = if is_up { -1.0 } else { 1.0 };
    Ok(ToDepth::Length {
        factor: sign * factor,
    })
}

/// The flags that speak of a variable: those that it names, those of its EPIC code, or those named after it.
async fn flags(
    session: &mut Session,
    file: &Description,
    variable: &Variable,
    sampling: &Sampling,
) -> Result<Vec<(Coordinate, Scheme)>, Stop> {
    let ancillary = variable
        .attributes
        .text("ancillary_variables")
        .unwrap_or_default();
    let by_name = format!("{}_qc", variable.name.to_ascii_lowercase());
    let codes = epic::code_of(variable)
        .and_then(epic::meaning)
        .map_or(&[][..], |code| code.flags);
    let mut found = vec![];
    for flag in file
        .variables
        .iter()
        .filter(|v| v.is_numeric() || v.kind == Kind::Text(1))
    {
        let is_named = ancillary.split_whitespace().any(|name| name == flag.name)
            && quality::is_flag(flag)
            || flag.name.to_ascii_lowercase() == by_name;
        let code = epic::code_of(flag).filter(|code| epic::is_flag(*code) && codes.contains(code));
        let scheme = match (is_named, code) {
            (true, _) => Scheme::of(flag),
            (false, Some(_)) => Scheme::TropicalArray,
            (false, None) => continue,
        };
        if let Some(mut beside) = coordinate::beside(session, flag, variable, sampling).await? {
            if flag.kind == Kind::Text(1) {
                for letter in &mut beside.values {
                    *letter = digit(*letter);
                }
            }
            found.push((beside, scheme));
        }
    }
    Ok(found)
}

/// The digit that a letter is, as flags are written where they are letters; no number if it is none.
fn digit(letter: f64) -> f64 {
    let digit = letter - f64::from(b'0');
    if (0.0..=9.0).contains(&digit) {
        digit
    } else {
        f64::NAN
    }
}
