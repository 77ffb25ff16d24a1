//! Which cells are good enough, as a profile asks by another variable of the file: levels, flags, numbers.

use contract::event::RejectReason;

use super::Planning;
use crate::error::Rejection;
use crate::inspect::file::description::{Dimension, Variable};
use crate::plan::cf::coordinate::{Axis, Role};
use crate::plan::cf::flag::{self, Flag};
use crate::plan::cf::packing::{Packing, Unpacked};

/// Which cells are good enough.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Quality {
    /// The variable that says so.
    pub(crate) variable: String,
    /// Its axes, which are those of the landed variable or, without time, its map.
    pub(crate) axes: Vec<Axis>,
    packing: Packing,
    /// Lowest and highest level that is good enough; any, if absent.
    levels: Option<(f64, f64)>,
    kept: Vec<Flag>,
    rejected: Vec<Flag>,
    rejected_values: Vec<f64>,
}

impl Quality {
    /// Is a cell with this stored number good enough? One without a number is not.
    pub(crate) fn accepts(&self, stored: f64) -> bool {
        let unpacked = self.packing.unpacked(stored);
        let is_level = |level: f64| {
            self.levels
                .is_none_or(|(low, high)| (low..=high).contains(&level))
        };
        let is_level_good = match unpacked {
            Unpacked::Missing => return false,
            Unpacked::Value(level) => is_level(level),
            // Bits may add up to more than the range of a file that thinks of one bit at a time.
            Unpacked::OutOfRange => self.levels.is_none(),
        };
        let number = self.packing.unsigned(stored);
        is_level_good
            && (self.kept.is_empty() || self.kept.iter().any(|flag| flag.holds(number)))
            && !self.rejected.iter().any(|flag| flag.holds(number))
            && !self.rejected_values.contains(&number)
    }
}

fn refused(object: &str, detail: impl AsRef<str>) -> Rejection {
    Rejection::new(RejectReason::Values, object, detail)
}

/// What the profile asks, checked against the file. Where it asks nothing and the file has something, that is noted.
pub(super) fn plan(
    planning: &mut Planning<'_>,
    variable: &Variable,
    axes: &[Axis],
) -> Result<Option<Quality>, Rejection> {
    let Some(rules) = planning.profile.and_then(|p| p.quality.as_ref()) else {
        note_unused(planning, variable);
        return Ok(None);
    };
    let name = &rules.variable;
    let missing = || {
        let detail = "is asked for by [quality] of the profile and not in the file as numbers; give the profile that fits, or leave [quality] out";
        refused(name, detail)
    };
    let layer = planning
        .file
        .variable(name)
        .filter(|v| v.is_numeric())
        .ok_or_else(missing)?;
    let flags = if rules.keep_flags.is_empty() && rules.reject_flags.is_empty() {
        vec![]
    } else {
        let advice = "use at_least, at_most or reject_values in [quality] of the profile";
        flag::of(layer).map_err(|e| refused(name, format!("{e}; {advice}")))?
    };
    Ok(Some(Quality {
        variable: name.clone(),
        axes: layer_axes(variable, axes, layer)?,
        packing: Packing::of(layer).with_any_range_text().checked(layer)?,
        levels: rules.at_least.or(rules.at_most).map(|_stated| {
            let low = rules.at_least.unwrap_or(f64::NEG_INFINITY);
            (low, rules.at_most.unwrap_or(f64::INFINITY))
        }),
        kept: named(layer, &flags, &rules.keep_flags)?,
        rejected: named(layer, &flags, &rules.reject_flags)?,
        rejected_values: rules.reject_values.clone(),
    }))
}

/// The flags of these names.
fn named(layer: &Variable, flags: &[Flag], names: &[String]) -> Result<Vec<Flag>, Rejection> {
    let find = |name: &String| {
        let found = flags.iter().find(|flag| flag.name == *name).cloned();
        found.ok_or_else(|| {
            let known: Vec<&str> = flags.iter().map(|flag| flag.name.as_str()).collect();
            let detail = format!(
                "has no flag {name:?} as [quality] of the profile asks; its flag_meanings are {}",
                known.join(" ")
            );
            refused(&layer.name, detail)
        })
    };
    names.iter().map(find).collect()
}

/// The axes of the layer: those of the variable in their order, all of them or all but what is no latitude or longitude.
fn layer_axes(
    variable: &Variable,
    axes: &[Axis],
    layer: &Variable,
) -> Result<Vec<Axis>, Rejection> {
    let own: Vec<(&Axis, &Dimension)> = axes.iter().zip(&variable.dimensions).collect();
    let is_plane = |axis: &Axis| matches!(axis.role, Role::Latitude | Role::Longitude);
    let map = own
        .iter()
        .filter(|(axis, _)| is_plane(axis))
        .copied()
        .collect();
    for candidate in [own, map] {
        let dimensions: Vec<&Dimension> = candidate.iter().map(|(_, d)| *d).collect();
        if dimensions == layer.dimensions.iter().collect::<Vec<_>>() {
            return Ok(candidate
                .into_iter()
                .map(|(axis, _)| axis.clone())
                .collect());
        }
    }
    let shape = |v: &Variable| {
        let shown = |d: &Dimension| match &d.name {
            Some(name) => format!("{name} {}", d.len),
            None => d.len.to_string(),
        };
        v.dimensions
            .iter()
            .map(shown)
            .collect::<Vec<_>>()
            .join(" x ")
    };
    let detail = format!(
        "has the shape {}, but {:?} has {}: [quality] needs the same shape, or that of its map; name another variable in the profile",
        shape(layer),
        variable.name,
        shape(variable)
    );
    Err(refused(&layer.name, detail))
}

/// Notes a variable about quality that lies beside the landed one and is not asked for.
fn note_unused(planning: &mut Planning<'_>, variable: &Variable) {
    let beside = variable
        .attributes
        .text("ancillary_variables")
        .unwrap_or_default();
    let is_quality = |v: &&Variable| {
        let text = |name: &str| v.attributes.text(name).unwrap_or_default();
        let is_named = ["quality_level", "quality_flag", "status_flag"]
            .iter()
            .any(|word| v.name.eq_ignore_ascii_case(word) || text("standard_name").ends_with(word));
        let is_beside = beside.split_whitespace().any(|name| name == v.name);
        let has_flags = v.attributes.0.contains_key("flag_meanings");
        v.name != variable.name
            && v.is_numeric()
            && v.dimensions.len() >= 2
            && (is_named || is_beside && has_flags)
    };
    if let Some(found) = planning.file.variables.iter().find(is_quality) {
        let name = found.name.clone();
        planning.assume(format!(
            "{}: every value is taken, whatever {name:?} says of its quality; [quality] in a profile asks it",
            variable.name
        ));
    }
}
