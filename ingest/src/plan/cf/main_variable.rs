//! Which variable of a file is the one that it is about: the one whose standard name is known, else the only one on a grid
//! that is not there for another. Where there are several, nothing is guessed.

use contract::event::RejectReason;
use contract::quantity::Quantity;

use super::coordinate::{self, Role};
use super::projection;
use super::quantity::{Named, of_standard_name};
use crate::error::Rejection;
use crate::inspect::file::description::{Description, Kind, Variable};

/// Attributes that name other variables, which are there for the one that has them.
const NAMES_OTHERS: [&str; 7] = [
    "ancillary_variables",
    "bounds",
    "cell_measures",
    "climatology",
    "coordinates",
    "formula_terms",
    "grid_mapping",
];
/// Ends of names of statistics and of what is said about values.
const STATISTICS: [&str; 21] = [
    "count",
    "number",
    "nobs",
    "median",
    "variance",
    "var",
    "stddev",
    "std",
    "stdev",
    "sd",
    "min",
    "max",
    "minimum",
    "maximum",
    "error",
    "err",
    "uncertainty",
    "flag",
    "quality",
    "skewness",
    "kurtosis",
];
/// Attribute of every file of the Group for High Resolution Sea Surface Temperature.
const GHRSST: &str = "gds_version_id";
/// What is wrong with a variable of text, of parts, or of numbers for which there is no type here.
const NO_NUMBERS: &str = "is of a type that is not read; give integers, float32 or float64";
const ADVICE: &str = "name one with --variable, or say in a profile which one to land";

/// The variable, and what is taken for granted with it.
pub(crate) type Chosen<'a> = (&'a Variable, Option<String>);

/// The variable that is asked for.
pub(crate) fn asked<'a>(file: &'a Description, name: &str) -> Result<&'a Variable, Rejection> {
    let refused = |detail: &str| Err(Rejection::new(RejectReason::NoVariable, name, detail));
    match file.variable(name) {
        Some(found) if found.is_numeric() => Ok(found),
        Some(_) => refused(NO_NUMBERS),
        None => refused(&format!(
            "is not in the file, which holds {}",
            listed(file.variables.iter())
        )),
    }
}

/// The variable that a file is about.
pub(crate) fn of(file: &Description) -> Result<Chosen<'_>, Rejection> {
    let is_data = |v: &&Variable| {
        v.is_numeric() && coordinate::role_of(v) == Role::Other && v.dimensions.len() >= 2
    };
    let data: Vec<&Variable> = file.variables.iter().filter(is_data).collect();
    let known: Vec<(&Variable, Named)> =
        data.iter().filter_map(|v| Some((*v, named(v)?))).collect();
    let candidate = known.first().map(|(v, _)| *v).or(data.first().copied());
    // That a file is on another projection or a swath matters before what its variables are called.
    if let Some(candidate) = candidate {
        projection::check(file, candidate)?;
    }
    if let Some(first) = candidate.filter(|first| is_swath(file, first)) {
        return Err(coordinate::no_grid(file, first));
    }
    if !known.is_empty() {
        return of_known(file, &known);
    }
    let refused = |detail: String| Err(Rejection::new(RejectReason::NoVariable, "file", detail));
    let on_grid: Vec<&Variable> = data
        .iter()
        .copied()
        .filter(|v| is_on_grid(file, v))
        .collect();
    let main: Vec<&Variable> = on_grid
        .iter()
        .copied()
        .filter(|v| !is_for_another(file, &on_grid, v))
        .collect();
    match (main.as_slice(), data.as_slice()) {
        ([only], _) => Ok((only, beside(only, &on_grid))),
        ([], []) => match file.variables.iter().find(|v| is_of_other_type(v)) {
            Some(unread) => refused(format!("holds {}, which {NO_NUMBERS}", unread.name)),
            None => refused("holds no gridded variable; give a file with one".to_owned()),
        },
        ([], [_, ..]) if !on_grid.is_empty() => refused(format!(
            "holds {}, there for others by what names it or by the second word of its standard_name, and nothing else on a grid; {ADVICE}",
            listed(on_grid.iter().copied())
        )),
        ([], [first, ..]) => Err(coordinate::no_grid(file, first)),
        (several, _) => refused(format!(
            "has several gridded variables ({}), and no standard_name says which it is about; {ADVICE}",
            listed(several.iter().copied())
        )),
    }
}

/// The one of several whose standard names are known.
fn of_known<'a>(
    file: &Description,
    known: &[(&'a Variable, Named)],
) -> Result<Chosen<'a>, Rejection> {
    if let [(only, _)] = known {
        return Ok((only, None));
    }
    if let Some(temperature) = temperature_of_ghrsst(file, known) {
        return Ok((temperature, None));
    }
    let all: Vec<&Variable> = known.iter().map(|(v, _)| *v).collect();
    let mut main = all.iter().filter(|v| !is_for_another(file, &all, v));
    if let (Some(only), None) = (main.next(), main.next()) {
        return Ok((only, beside(only, &all)));
    }
    let detail = format!(
        "has several variables that could be landed ({}); {ADVICE}",
        listed(all.iter().copied())
    );
    Err(Rejection::new(RejectReason::NoVariable, "file", detail))
}

/// Would it be a map, were its values of a type that is read?
fn is_of_other_type(variable: &Variable) -> bool {
    variable.kind == Kind::Other && variable.dimensions.len() >= 2
}

fn named(variable: &Variable) -> Option<Named> {
    variable
        .attributes
        .text("standard_name")
        .and_then(of_standard_name)
}

/// Files of GHRSST are about one temperature; ice and wind beside it are what it was made with.
fn temperature_of_ghrsst<'a>(
    file: &Description,
    several: &[(&'a Variable, Named)],
) -> Option<&'a Variable> {
    file.attributes.text(GHRSST)?;
    let is_temperature = |(_, named): &&(&Variable, Named)| {
        Quantity::SeaSurfaceTemperature
            .joined(named.quantity)
            .is_some()
    };
    let mut temperatures = several.iter().filter(is_temperature);
    let (only, _) = temperatures.next()?;
    temperatures.next().is_none().then_some(only)
}

fn is_on_grid(file: &Description, variable: &Variable) -> bool {
    let axes = coordinate::axes(file, variable);
    let has = |role| axes.iter().any(|axis| axis.role == role);
    has(Role::Latitude) && has(Role::Longitude)
}

/// Is it named by another variable, or a statistic of one?
fn is_for_another(file: &Description, on_grid: &[&Variable], variable: &Variable) -> bool {
    let names = |other: &Variable| {
        NAMES_OTHERS.iter().any(|attribute| {
            let words = other.attributes.text(attribute).unwrap_or_default();
            words.split_whitespace().any(|word| word == variable.name)
        })
    };
    let is_named = file
        .variables
        .iter()
        .any(|other| other.name != variable.name && names(other));
    // A standard name may end in a modifier: `sea_water_temperature standard_error`.
    let standard_name = variable
        .attributes
        .text("standard_name")
        .unwrap_or_default();
    is_named || standard_name.contains(' ') || is_statistic(on_grid, &variable.name)
}

/// `sst_count` beside `sst` or `sst_mean`.
fn is_statistic(on_grid: &[&Variable], name: &str) -> bool {
    let Some((base, end)) = name.rsplit_once('_') else {
        return false;
    };
    let is_there = |wanted: &str| on_grid.iter().any(|v| v.name == wanted);
    STATISTICS.contains(&end.to_ascii_lowercase().as_str())
        && (is_there(base) || is_there(&format!("{base}_mean")))
}

/// What is told where there was a choice.
fn beside(chosen: &Variable, on_grid: &[&Variable]) -> Option<String> {
    let others = on_grid.iter().copied().filter(|v| v.name != chosen.name);
    (on_grid.len() > 1).then(|| {
        format!(
            "{} is taken for what the file is about; {} are there for it",
            chosen.name,
            listed(others)
        )
    })
}

/// Has the variable no latitude axis, and the file a latitude or longitude of two dimensions?
fn is_swath(file: &Description, variable: &Variable) -> bool {
    let on_axes = coordinate::axes(file, variable)
        .iter()
        .any(|a| a.role == Role::Latitude);
    let is_plane = |v: &&Variable| v.dimensions.len() >= 2;
    let mut planes = file
        .variables
        .iter()
        .filter(is_plane)
        .map(coordinate::role_of);
    !on_axes && planes.any(|role| matches!(role, Role::Latitude | Role::Longitude))
}

/// The first few names.
pub(crate) fn listed<'a>(variables: impl Iterator<Item = &'a Variable>) -> String {
    const SHOWN: usize = 8;
    let names: Vec<&str> = variables.map(|v| v.name.as_str()).collect();
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    format!("{}{more}", names[..names.len().min(SHOWN)].join(", "))
}
