//! [`InspectedGranule`] in, [`PlannedGranule`] out: which variable, where its cells are, when its steps are, which unit.
//!
//! Nothing of the variable is read yet; only coordinates, which are small. A profile overrides what the file says.

mod bounds;
pub(crate) mod cf;
mod coverage;
mod date;
mod edges;
mod flags;
mod further;
pub(crate) mod method;
mod model_calendar;
mod pairs;
mod place;
pub(crate) mod profile;
mod quality;
pub(crate) mod recipe;
mod refused;
mod stamps;
mod steps;
mod target;
pub(crate) mod unit;
pub(crate) mod written;

use contract::event::RejectReason;
use contract::index::DimensionIndex;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use cube::foreign::ForeignError;
use storage::attached::Cause;

use crate::error::{Rejection, Stop};
use crate::fetch::RawGranule;
use crate::inspect::InspectedGranule;
use crate::inspect::file::description::{Description, Part, Variable};
use crate::inspect::indexed::Indexed;
use crate::inspect::values::Values;
use crate::limits::Limits;
use crate::plan::cf::axis::Mapping;
use crate::plan::cf::carbon_flux;
use crate::plan::cf::coordinate::{self, Axis, Role};
use crate::plan::cf::open;
use crate::plan::cf::packing::Packing;
use crate::plan::cf::quantity::Named;
use crate::plan::profile::Profile;
use crate::plan::recipe::Recipe;
use crate::settings::Settings;
pub(crate) use quality::Quality;
pub(crate) use target::packing;

/// A file of which is known what will be read and what it will become.
pub(crate) struct PlannedGranule {
    pub(crate) raw: RawGranule,
    pub(crate) plan: Plan,
}

/// What will be read of a file, or of a store of others, and what it will become.
pub(crate) struct Plan {
    pub(crate) values: Values,
    pub(crate) target: Target,
    pub(crate) variable: Variable,
    pub(crate) axes: Vec<Axis>,
    pub(crate) mapping: Mapping,
    pub(crate) packing: Packing,
    pub(crate) steps: Vec<PlannedStep>,
    /// Which cells are good enough; all, if absent.
    pub(crate) quality: Option<Quality>,
    pub(crate) recipe: Recipe,
    /// What was taken for granted, because nothing in the file says it. One line each.
    pub(crate) assumptions: Vec<String>,
}

impl Plan {
    /// Cells of one map as it lies in the file.
    pub(crate) fn plane_cells(&self) -> u64 {
        let is_plane = |axis: &&Axis| matches!(axis.role, Role::Latitude | Role::Longitude);
        let plane = self.axes.iter().filter(is_plane);
        plane.map(|axis| axis.len).fold(1, u64::saturating_mul)
    }
}

/// What a file becomes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Target {
    pub(crate) product: ProductId,
    pub(crate) title: String,
    pub(crate) source: String,
    pub(crate) quantity: Quantity,
    pub(crate) synthetic: bool,
}

/// One step of the file: where it is and how its values become stored ones, `stored = value * factor + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlannedStep {
    pub(crate) period: Period,
    pub(crate) time_index: u64,
    pub(crate) factor: f64,
    pub(crate) offset: f64,
}

/// What the caller wants, beyond what the file says.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Wish<'a> {
    pub(crate) profile: Option<&'a Profile>,
    pub(crate) product: Option<&'a ProductId>,
    /// The variable to land of a file that no profile is for; of another one it is the profile's, or refused.
    pub(crate) variable: Option<&'a str>,
    /// What that variable means, where it is known beyond what it says: a cube of this program.
    pub(crate) meaning: Option<Named>,
    /// Which index is read of dimensions beside time and the map, in the order of their names.
    pub(crate) indexes: &'a [DimensionIndex],
}

/// A file on its way through planning.
struct Planning<'a> {
    values: Values,
    file: &'a Description,
    file_name: &'a str,
    profile: Option<&'a Profile>,
    limits: Limits,
    assumptions: Vec<String>,
    /// Is the variable one that holds at any time, so that its file says of none?
    holds_always: bool,
}

pub(crate) async fn run(
    granule: InspectedGranule,
    wish: Wish<'_>,
    settings: &Settings,
) -> Result<PlannedGranule, Stop> {
    let InspectedGranule {
        raw,
        session,
        description,
    } = granule;
    let fits = |profile: &&Profile| profile.is_for(&raw.file_name, &description);
    let profile = wish.profile.or_else(|| settings.profiles.iter().find(fits));
    if let (None, Some(found), Some(asked)) = (wish.profile, profile, wish.variable) {
        target::read_by(found, asked, &settings.profiles)?;
    }
    let wish = Wish { profile, ..wish };
    let (description, indexed) = Indexed::of(description, wish.indexes)?;
    let held = (Values::Process(Box::new(session), indexed), &description);
    let plan = plan(held, &raw.file_name, wish, settings.limits).await?;
    Ok(PlannedGranule { raw, plan })
}

/// The same of anything that was described and gives values: the one way from what is said to what is stored.
pub(crate) async fn plan(
    (values, description): (Values, &Description),
    file_name: &str,
    wish: Wish<'_>,
    limits: Limits,
) -> Result<Plan, Stop> {
    let profile = wish.profile;
    further::check(description, wish.indexes)?;
    let (variable, meaning, assumption) = target::choose(description, wish)?;
    let mut planning = Planning {
        values,
        file: description,
        file_name,
        profile,
        limits,
        assumptions: assumption.into_iter().collect(),
        holds_always: false,
    };
    further::check_time(description, variable, wish.indexes)?;
    let (axes, mapping) = place::mapping(&mut planning, variable).await?;
    further::tell(&mut planning, variable, wish.indexes).await?;
    let periods = steps::periods(&mut planning, (variable, meaning.quantity), &axes).await?;
    if profile.is_none() && wish.meaning.is_none() {
        let time = planning.time_variable(&axes);
        method::check(variable, meaning.quantity, time.as_deref())?;
        written::check(description, variable, meaning.quantity)?;
        let told = written::climatology(description, variable);
        if let Some(told) = told {
            planning.assume(told);
        }
    }
    if matches!(meaning.quantity, Quantity::Open(_)) && open::stated_unit(variable).is_none() {
        planning.assume(format!(
            "{}: has no units; taken for a number without one, as CF says",
            variable.name
        ));
    }
    if profile.is_none() && matches!(meaning.quantity, Quantity::Open(_)) {
        let untold = || Some(carbon_flux::told(variable)?.err()?.note(&variable.name));
        let note = written::note(description, variable).or_else(untold);
        let note = note.filter(|_| written::of_file(description, variable).is_none());
        if let Some(note) = note {
            planning.assume(note);
        }
    }
    let target = target::target(&planning, variable, wish, meaning.quantity)?;
    let steps = steps::convert(variable, profile, meaning, &periods)?;
    let packing = packing(variable, profile)?;
    packing
        .assumption
        .iter()
        .for_each(|text| planning.assume(text));
    let quantity = flags::told(&mut planning, variable, target.quantity, (&packing, &steps));
    let target = Target { quantity, ..target };
    let quality = quality::plan(&mut planning, variable, &axes)?;
    let Planning {
        values,
        assumptions,
        ..
    } = planning;
    Ok(Plan {
        values,
        target,
        variable: variable.clone(),
        axes,
        mapping,
        packing,
        steps,
        quality,
        recipe: Recipe::of(wish),
        assumptions,
    })
}

/// What is said of an axis of so many labels whose bounds are there and are not two numbers for each. `instead` is what can be stated
/// in a profile.
fn no_bounds(bounds: &Variable, count: u64, instead: &str) -> String {
    let lens: Vec<u64> = bounds.dimensions.iter().map(|own| own.len).collect();
    format!(
        "names bounds {:?}, which are not two numbers for each of its labels but {} of the shape {lens:?}; write them as numbers of the shape [{count}, 2], or state {instead} in a profile",
        bounds.name,
        bounds.kind.name()
    )
}

/// What is told of a file, in which text of it may stand, as one short line.
pub(crate) fn line(text: impl AsRef<str>) -> String {
    Rejection::new(RejectReason::Values, "", text).detail
}

impl<'a> Planning<'a> {
    /// Notes what is taken for granted; text of the file becomes one short line.
    fn assume(&mut self, text: impl AsRef<str>) {
        let line = line(text);
        if !self.assumptions.contains(&line) {
            self.assumptions.push(line);
        }
    }

    /// The bounds that an axis names; none where they are not there. `instead` is what can be stated in a profile.
    ///
    /// # Errors
    /// They are there and cannot be read: without them the labels of the axis may mean something else.
    fn bounds_of(
        &self,
        (axis, bounds): (&str, &str),
        instead: &str,
    ) -> Result<Option<&'a Variable>, Rejection> {
        let Some(unread) = self.values.unread(bounds) else {
            return Ok(self.file.variable(bounds));
        };
        let detail = format!(
            "is what {axis} names as its bounds, and cannot be read, so that nothing says what its labels stand for; write it otherwise, or state {instead} in a profile: {}",
            unread.reason
        );
        Err(Rejection::new(
            RejectReason::Unreadable,
            &unread.place,
            detail,
        ))
    }

    /// Why one of these coordinates, which is there, cannot be read; none if there is no such one.
    fn unread<'n>(&self, mut names: impl Iterator<Item = &'n str>) -> Option<Rejection> {
        // Where nothing may be listed, no access is also the answer for what is not there, and a dimension needs no coordinate.
        let is_there = |own: &&ForeignError| own.cause == Cause::Content;
        let unread = names.find_map(|name| self.values.unread(name).filter(is_there))?;
        Some(Rejection::new(
            RejectReason::Unreadable,
            &unread.place,
            &unread.reason,
        ))
    }

    /// All values of a coordinate variable, unpacked; NaN for fill values.
    async fn coordinate(&mut self, name: &str) -> Result<Vec<f64>, Stop> {
        /// Longest coordinate axis.
        const MAX_LABELS: u64 = 1 << 20;
        let missing = || {
            Rejection::new(
                RejectReason::Grid,
                name,
                "is not in the file; name another coordinate in the profile",
            )
        };
        let variable = self.file.variable(name).ok_or_else(missing)?;
        let count = match variable.dimensions.as_slice() {
            [] => 1,
            [only] => only.len,
            more => {
                let detail = format!(
                    "has {} dimensions where a coordinate has one: this is a swath; grid it first",
                    more.len()
                );
                return Err(Rejection::new(RejectReason::Grid, name, detail).into());
            }
        };
        if count > MAX_LABELS || !variable.is_numeric() {
            let detail = format!(
                "is no coordinate axis ({count} labels, at most {MAX_LABELS} numbers are read)"
            );
            return Err(Rejection::new(RejectReason::Grid, name, detail).into());
        }
        let parts = vec![Part::All; variable.dimensions.len()];
        let packing = Packing::of(variable).with_any_range_text();
        let packing = packing.checked(variable)?;
        let stored = self.values.read(name, &parts, count).await?;
        let numbers: Vec<f64> = stored.into_iter().map(|v| packing.value(v)).collect();
        let first = numbers.first().copied();
        let turned = coordinate::turned(variable, numbers);
        if let (Some(first), Some(to)) = (first, turned.first())
            && coordinate::is_turned(variable)
        {
            let units = variable.attributes.text("units").unwrap_or_default();
            self.assume(format!(
                "{name}: is in {units}; its numbers are turned, so that its first, {first}, is {to} northwards or eastwards"
            ));
        }
        Ok(turned)
    }

    /// The time axis, or a scalar time beside the axes.
    fn time_variable(&self, axes: &[Axis]) -> Option<String> {
        let on_axis = axes
            .iter()
            .find(|a| a.role == Role::Time)
            .and_then(|a| a.coordinate.clone());
        // When a forecast was begun is no time of its values.
        let is_begin =
            |v: &Variable| v.attributes.text("standard_name") == Some("forecast_reference_time");
        let is_scalar_time = |v: &&Variable| {
            let is_time = coordinate::role_of(v) == Role::Time && !is_begin(v);
            v.cell_count() == 1 && v.is_numeric() && is_time
        };
        let is_called_so = |v: &&Variable| {
            let name = v.attributes.text("standard_name").unwrap_or(&v.name);
            name.eq_ignore_ascii_case("time")
        };
        on_axis.or_else(|| {
            let scalars = || self.file.variables.iter().filter(is_scalar_time);
            let found = scalars().find(is_called_so).or_else(|| scalars().next());
            found.map(|v| v.name.clone())
        })
    }
}
