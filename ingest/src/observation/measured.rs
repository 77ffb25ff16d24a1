//! One measured variable of a NetCDF file: what it measures, in which unit, and which coordinates and flags are its own.

use contract::event::RejectReason;

use super::convert::Conversion;
use super::coordinate::{self, Coordinate, Says};
use super::epic;
use super::property;
use super::quality::Scheme;
use super::sampling::Sampling;
use crate::error::{Rejection, Stop};
use crate::inspect::file::description::{Description, Variable};
use crate::inspect::reader::session::Session;
use crate::plan::cf::calendar::{Calendar, TimeUnit};
use crate::plan::unit;

/// A measured variable with all that its samples need.
pub(super) struct Measured<'a> {
    pub(super) variable: &'a Variable,
    pub(super) conversion: Conversion,
    pub(super) time: Coordinate,
    pub(super) time_unit: TimeUnit,
    pub(super) latitude: Coordinate,
    pub(super) longitude: Coordinate,
    pub(super) depth: Option<(Coordinate, ToDepth)>,
    pub(super) flags: Vec<(Coordinate, Scheme)>,
}

/// How a vertical coordinate becomes metres below the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ToDepth {
    pub(super) factor: f64,
}

/// Can it be a measured variable: numbers that are neither coordinates nor remarks?
pub(super) fn is_candidate(file: &Description, variable: &Variable) -> bool {
    let attributes = &variable.attributes;
    let is_remark = epic::code_of(variable).is_some_and(epic::is_remark)
        || attributes
            .text("standard_name")
            .is_some_and(|name| name.ends_with("status_flag"))
        || [
            "flag_values",
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
    sampling: &Sampling,
) -> Result<Result<Measured<'a>, Rejection>, Stop> {
    let refuse = |reason, detail: String| Ok(Err(Rejection::new(reason, &variable.name, detail)));
    let Some(property) = property_of(variable) else {
        return refuse(
            RejectReason::Unit,
            "has neither a standard name nor a unit".to_owned(),
        );
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
        let detail = "has no latitude, longitude and time for each of its values".to_owned();
        return refuse(RejectReason::NoVariable, detail);
    };
    let time_unit = match time_unit(file, &time.name) {
        Ok(unit) => unit,
        Err(wrong) => return Ok(Err(Rejection::new(RejectReason::Time, &time.name, wrong))),
    };
    let depth = match depth(session, file, variable, sampling).await? {
        Ok(depth) => depth,
        Err(rejection) => return Ok(Err(rejection)),
    };
    Ok(Ok(Measured {
        conversion,
        time,
        time_unit,
        latitude,
        longitude,
        depth,
        flags: flags(session, file, variable, sampling).await?,
        variable,
    }))
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

/// The vertical coordinate of a variable: a depth of its own, or the file's.
async fn depth(
    session: &mut Session,
    file: &Description,
    variable: &Variable,
    sampling: &Sampling,
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
        return Ok(Ok(Some((found, ToDepth { factor: 1.0 }))));
    }
    let Some(found) = coordinate::find(session, file, variable, sampling, Says::Depth).await?
    else {
        return Ok(Ok(None));
    };
    let Some(vertical) = file.variable(&found.name) else {
        return Ok(Ok(None));
    };
    let text = |name: &str| vertical.attributes.text(name).unwrap_or_default();
    let metre = |spelling: &str| {
        let (own, metre) = (unit::parse(spelling).ok()?, unit::parse("m").ok()?);
        (own.dimension == metre.dimension).then_some(own.factor)
    };
    let spelling = if text("units").is_empty() {
        "m"
    } else {
        text("units")
    };
    let Some(factor) = metre(spelling) else {
        let detail = format!("has unit {spelling:?}, which is no length; give depths in m");
        return Ok(Err(Rejection::new(RejectReason::Unit, &found.name, detail)));
    };
    let is_up = text("positive").eq_ignore_ascii_case("up")
        || text("positive").is_empty() && matches!(text("standard_name"), "height" | "altitude");
    let sign = if is_up { -1.0 } else { 1.0 };
    Ok(Ok(Some((
        found,
        ToDepth {
            factor: sign * factor,
        },
    ))))
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
    for flag in file.variables.iter().filter(|v| v.is_numeric()) {
        let is_named = ancillary.split_whitespace().any(|name| name == flag.name)
            && flag
                .attributes
                .text("standard_name")
                .is_none_or(|name| name.ends_with("status_flag"))
            || flag.name.to_ascii_lowercase() == by_name;
        let code = epic::code_of(flag).filter(|code| epic::is_flag(*code) && codes.contains(code));
        let scheme = match (is_named, code) {
            (true, _) => Scheme::of(flag),
            (false, Some(_)) => Scheme::TropicalArray,
            (false, None) => continue,
        };
        if let Some(beside) = coordinate::beside(session, flag, variable, sampling).await? {
            found.push((beside, scheme));
        }
    }
    Ok(found)
}
