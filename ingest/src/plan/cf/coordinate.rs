//! What each dimension of a variable is: latitude, longitude, time or something else.

use contract::event::RejectReason;

use super::projection;
use serde::{Deserialize, Serialize};

use crate::error::Rejection;
use crate::inspect::file::description::{Description, Variable};

/// What a dimension or a coordinate variable is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Role {
    Latitude,
    Longitude,
    Time,
    Other,
}

/// A dimension of a variable: its role and, if it has one, its coordinate variable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Axis {
    pub(crate) role: Role,
    pub(crate) coordinate: Option<String>,
    pub(crate) len: u64,
}

/// What says that a variable is a latitude or longitude.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Evidence {
    /// Its units or its standard name.
    Stated,
    /// Nothing but what it is called.
    NameAlone,
}

/// What a coordinate variable is.
pub(crate) fn role_of(variable: &Variable) -> Role {
    evidence(variable).map_or(Role::Other, |(role, _)| role)
}

/// What a coordinate variable is, and what says so. Units come first: real files carry other files' standard names by
/// mistake, but no program works with `degrees_north` on a longitude. `axis` says which way a dimension runs, not that it
/// is a longitude: the axes of every projection have it.
pub(crate) fn evidence(variable: &Variable) -> Option<(Role, Evidence)> {
    let text = |name: &str| {
        variable
            .attributes
            .text(name)
            .unwrap_or_default()
            .to_ascii_lowercase()
    };
    let (units, standard_name) = (text("units"), text("standard_name"));
    if units.contains(" since ") {
        return Some((Role::Time, Evidence::Stated));
    }
    if projection::of_coordinate(variable).is_some() {
        return None;
    }
    if let Some((role, _)) = of_units(variable) {
        return Some((role, Evidence::Stated));
    }
    match standard_name.as_str() {
        "latitude" => return Some((Role::Latitude, Evidence::Stated)),
        "longitude" => return Some((Role::Longitude, Evidence::Stated)),
        "time" => return Some((Role::Time, Evidence::Stated)),
        _ if text("axis") == "t" => return Some((Role::Time, Evidence::Stated)),
        _ => {}
    }
    let role = match variable.name.to_ascii_lowercase().as_str() {
        "lat" | "latitude" | "nav_lat" => Role::Latitude,
        "lon" | "longitude" | "nav_lon" => Role::Longitude,
        "time" => Role::Time,
        _ => return None,
    };
    Some((role, Evidence::NameAlone))
}

/// What the units of a variable make it, and whether they count against the way that this program does.
fn of_units(variable: &Variable) -> Option<(Role, bool)> {
    let units = variable.attributes.text("units")?.to_ascii_lowercase();
    match units.replace(' ', "_").as_str() {
        "degrees_north" | "degree_north" | "degrees_n" | "degree_n" | "degreesn" | "degreen" => {
            Some((Role::Latitude, false))
        }
        "degrees_east" | "degree_east" | "degrees_e" | "degree_e" | "degreese" | "degreee" => {
            Some((Role::Longitude, false))
        }
        "degrees_south" | "degree_south" | "degrees_s" | "degree_s" => Some((Role::Latitude, true)),
        "degrees_west" | "degree_west" | "degrees_w" | "degree_w" | "degreesw" | "degreew" => {
            Some((Role::Longitude, true))
        }
        _ => None,
    }
}

/// Do numbers of a coordinate count the other way than northwards and eastwards, as in `degrees_west` (UDUNITS: -1 degree east)?
pub(crate) fn is_turned(coordinate: &Variable) -> bool {
    matches!(of_units(coordinate), Some((_, true)))
}

/// Numbers of a coordinate, northwards and eastwards.
pub(crate) fn turned(coordinate: &Variable, numbers: Vec<f64>) -> Vec<f64> {
    if !is_turned(coordinate) {
        return numbers;
    }
    // Nothing has no sign.
    numbers.into_iter().map(|number| 0.0 - number).collect()
}

/// The axes of a variable, slowest first.
pub(crate) fn axes(file: &Description, variable: &Variable) -> Vec<Axis> {
    let mut axes: Vec<Axis> = Vec::new();
    for dimension in &variable.dimensions {
        let coordinate = match &dimension.name {
            Some(name) => file
                .variable(name)
                .filter(|c| c.is_coordinate() && c.is_numeric()),
            // A plain HDF5 file names no dimensions: a coordinate of that length which is the only one of its role left.
            None => unnamed_coordinate(file, dimension.len, &axes),
        };
        // A dimension may be called time and have no coordinate: then the time comes from elsewhere.
        let is_time = dimension
            .name
            .as_deref()
            .is_some_and(|name| name.eq_ignore_ascii_case("time"));
        let bare = if is_time { Role::Time } else { Role::Other };
        let role = coordinate.map_or(bare, role_of);
        axes.push(Axis {
            role,
            coordinate: coordinate.map(|c| c.name.clone()),
            len: dimension.len,
        });
    }
    axes
}

fn unnamed_coordinate<'a>(file: &'a Description, len: u64, taken: &[Axis]) -> Option<&'a Variable> {
    let fits = |v: &&Variable| {
        let role = role_of(v);
        v.is_coordinate()
            && v.dimensions[0].len == len
            && role != Role::Other
            && v.is_numeric()
            && taken.iter().all(|axis| axis.role != role)
    };
    let mut found = file.variables.iter().filter(fits);
    // Of a square grid latitude comes first, as everywhere.
    let first = found.next()?;
    let second = found.next();
    [Some(first), second]
        .into_iter()
        .flatten()
        .min_by_key(|v| match role_of(v) {
            Role::Time => 0,
            Role::Latitude => 1,
            Role::Longitude | Role::Other => 2,
        })
}

/// A refusal for a variable without a latitude and a longitude axis, which says why.
pub(crate) fn no_grid(file: &Description, variable: &Variable) -> Rejection {
    if let Err(rejection) = projection::check(file, variable) {
        return rejection;
    }
    let is_plane =
        |v: &&Variable| v.dimensions.len() >= 2 && v.is_numeric() && v.name != variable.name;
    let swath = file
        .variables
        .iter()
        .filter(is_plane)
        .find(|v| matches!(role_of(v), Role::Latitude | Role::Longitude));
    let unproven = variable
        .dimensions
        .iter()
        .filter_map(|dimension| file.variable(dimension.name.as_deref()?))
        .find(|v| role_of(v) == Role::Other && v.attributes.text("axis").is_some());
    let detail = match (swath, unproven) {
        (Some(coordinate), _) => format!(
            "is a swath: {:?} has {} dimensions, so every value has a place of its own; grid it to regular latitudes and longitudes first",
            coordinate.name,
            coordinate.dimensions.len()
        ),
        (None, Some(axis)) => format!(
            "has an axis {:?} of which axis = {:?} says the direction, but neither units (degrees_north, degrees_east) nor standard_name that it is a latitude or longitude; if it is, name it in a profile ([grid] latitude and longitude)",
            axis.name,
            axis.attributes.text("axis").unwrap_or_default()
        ),
        (None, None) => {
            "has no latitude and longitude axes; name them, or state the grid, in a profile"
                .to_owned()
        }
    };
    Rejection::new(RejectReason::Grid, &variable.name, detail)
}
