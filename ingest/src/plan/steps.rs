//! When the steps of a variable are, and how the values of each become the stored unit.

use std::cmp::Ordering;

use contract::event::RejectReason;
use contract::quantity::Quantity;
use contract::time::Period;

use super::bounds::{self, Bounds};
use super::refused::refused;
use super::{PlannedStep, Planning, coverage, date, model_calendar, stamps};
use crate::error::{Rejection, Stop};
use crate::inspect::file::description::Variable;
use crate::plan::cf::calendar::{Calendar, CalendarDate};
use crate::plan::cf::cell_methods::{self, TimeMethod};
use crate::plan::cf::coordinate::{Axis, Role};
use crate::plan::cf::open;
use crate::plan::cf::quantity::Named;
use crate::plan::cf::{period, spacing};
use crate::plan::profile::{Profile, TimeRules, TimeSource};
use crate::plan::unit;

/// The year, a leap year, that stands for all where a file means none.
const REFERENCE_YEAR: i32 = 2000;

/// The periods of all steps, in the order of the file, not overlapping.
pub(super) async fn periods(
    planning: &mut Planning<'_>,
    (variable, quantity): (&Variable, Quantity),
    axes: &[Axis],
) -> Result<Vec<Period>, Stop> {
    let count = axes
        .iter()
        .find(|a| a.role == Role::Time)
        .map_or(1, |a| a.len);
    if count == 0 || count > planning.limits.steps {
        let detail = format!("has {count} steps, 1 to {} are read", planning.limits.steps);
        let reason = if count == 0 {
            RejectReason::Time
        } else {
            RejectReason::TooLarge
        };
        return Err(Rejection::new(reason, "time", detail).into());
    }
    let periods = match planning.profile.and_then(|p| p.time.as_ref()) {
        Some(rules) => by_rules(planning, rules, count).await?,
        None => by_file(planning, (variable, quantity), axes).await?,
    };
    if periods.len() as u64 != count {
        let detail = format!(
            "has {} stamps for {count} steps; say in a profile where the time comes from",
            periods.len()
        );
        return Err(refused("time", detail).into());
    }
    if let Some((name, calendar)) = calendar(planning, axes)? {
        model_calendar::check(planning, &name, calendar, &periods)?;
    }
    check_apart(&periods)?;
    Ok(periods)
}

/// The time variable that the steps are counted by, and its calendar.
fn calendar(
    planning: &Planning<'_>,
    axes: &[Axis],
) -> Result<Option<(String, Calendar)>, Rejection> {
    let (name, stated) = match planning.profile.and_then(|p| p.time.as_ref()) {
        None => (planning.time_variable(axes), None),
        Some(rules) => match &rules.from {
            TimeSource::Variable { name, calendar, .. } => {
                (Some(name.clone()), calendar.as_deref())
            }
            _ => (None, None),
        },
    };
    let Some(name) = name else {
        return Ok(None);
    };
    let calendar = stamps::calendar(planning, &name, stated)?;
    Ok(Some((name, calendar)))
}

/// Refuses steps that share some of their time, which would be counted twice.
fn check_apart(periods: &[Period]) -> Result<(), Rejection> {
    let mut order: Vec<usize> = (0..periods.len()).collect();
    order.sort_by_key(|at| periods[*at]);
    let mut pairs = order.windows(2).map(|pair| (pair[0], pair[1]));
    let Some((one, other)) = pairs.find(|(one, other)| periods[*one].overlaps(periods[*other]))
    else {
        return Ok(());
    };
    let (first, second) = (one.min(other), one.max(other));
    let which = if periods[first] == periods[second] {
        format!("both are {}", periods[first])
    } else {
        format!("{} and {}", periods[first], periods[second])
    };
    let detail = format!(
        "has steps that overlap, {} and {} of the file ({which}); leave one out, or say in a profile what a step covers",
        first + 1,
        second + 1
    );
    Err(refused("time", detail))
}

async fn by_rules(
    planning: &mut Planning<'_>,
    rules: &TimeRules,
    count: u64,
) -> Result<Vec<Period>, Stop> {
    let stamps = match &rules.from {
        TimeSource::Variable {
            name,
            unit,
            calendar,
        } => stamps::read(planning, name, unit.as_deref(), calendar.as_deref()).await?,
        TimeSource::Attribute(name) => {
            let missing = || {
                refused(
                    name,
                    "is not in the file; say in a profile where the time comes from",
                )
            };
            let text = planning.file.attributes.text(name).ok_or_else(missing)?;
            vec![
                date::of_attribute(text)
                    .ok_or_else(|| refused(name, format!("says {text:?}, which is no date")))?,
            ]
        }
        TimeSource::FileName(pattern) => {
            vec![date::of_file_name(pattern, planning.file_name, rules.year)?]
        }
        TimeSource::MonthNumber => {
            let year = rules
                .year
                .ok_or_else(|| refused("profile", "from = \"month_number\" needs a year"))?;
            (1..=count.min(12) as u32)
                .map(|month| date::day(year, month, 1))
                .collect()
        }
        TimeSource::Fixed(time) => vec![date::of_instant(*time)],
    };
    let with_year = |stamp: CalendarDate| CalendarDate {
        year: rules.year.unwrap_or(stamp.year),
        ..stamp
    };
    let stamps: Vec<CalendarDate> = stamps.into_iter().map(with_year).collect();
    let periods = rules.covers.periods_at(&stamps, rules.stamp);
    let periods = periods.map_err(|e| refused("time", e))?;
    if let Some(told) = rules.covers.told("time", &periods) {
        planning.assume(told);
    }
    Ok(periods)
}

/// Time as CF has it: bounds, then `cell_methods`, the distance of stamps, and attributes about the coverage.
async fn by_file(
    planning: &mut Planning<'_>,
    (variable, quantity): (&Variable, Quantity),
    axes: &[Axis],
) -> Result<Vec<Period>, Stop> {
    let is_fixed = open::is_fixed(quantity);
    let Some(name) = planning.time_variable(axes) else {
        if let Some(unread) = unread_time(planning, variable, axes) {
            return Err(unread.into());
        }
        let period = coverage::period(planning, None);
        return Ok(vec![period.or_else(|silent| {
            fixed(planning, variable, None, is_fixed, silent)
        })?]);
    };
    let stamps = stamps_of(planning, &name).await?;
    let method = variable.attributes.text("cell_methods");
    let mut method = method.and_then(|text| cell_methods::of_time(text, &name));
    match bounds::read(planning, &name, &stamps, method).await? {
        Bounds::Periods(periods) => return Ok(periods),
        Bounds::Instants => method = Some(TimeMethod::Point),
        Bounds::Silent => {}
    }
    if let [stamp] = stamps[..] {
        let period = coverage::period(planning, Some((&name, stamp)));
        return Ok(vec![period.or_else(|silent| {
            fixed(planning, variable, Some(stamp), is_fixed, silent)
        })?]);
    }
    let (stamps, is_backwards) = rising(&name, stamps)?;
    let mut periods = if method == Some(TimeMethod::Point) {
        planning.assume(format!(
            "{name}: has values at instants; each stands for the time half way to its neighbours"
        ));
        spacing::around(&stamps).map_err(|e| refused(&name, e))?
    } else {
        by_spacing(planning, &name, (&stamps, is_backwards))?
    };
    if is_backwards {
        periods.reverse();
    }
    Ok(periods)
}

/// Why a time that is there cannot be read, be it along an axis or beside all; none if there is none.
fn unread_time(planning: &Planning<'_>, variable: &Variable, axes: &[Axis]) -> Option<Rejection> {
    let along = axes.iter().zip(&variable.dimensions);
    let along = along.filter(|(axis, _)| axis.role == Role::Time);
    let along = along.filter_map(|(_, dimension)| dimension.name.as_deref());
    let beside = variable.attributes.text("coordinates").unwrap_or_default();
    let beside = beside.split_whitespace();
    planning.unread(along.chain(beside.filter(|name| name.eq_ignore_ascii_case("time"))))
}

/// Stamps in the order of time, and whether the file has them the other way round.
fn rising(
    name: &str,
    mut stamps: Vec<CalendarDate>,
) -> Result<(Vec<CalendarDate>, bool), Rejection> {
    let place = |stamp: Option<&CalendarDate>| stamp.and_then(|stamp| stamp.count_ms());
    let is_backwards = place(stamps.first()) > place(stamps.last());
    for (index, pair) in stamps.windows(2).enumerate() {
        let (before, after) = (place(pair.first()), place(pair.last()));
        let (first, second) = (index + 1, index + 2);
        let detail = match before.cmp(&after) {
            Ordering::Equal => format!(
                "has the time {} twice, of the steps {first} and {second} of the file; leave one out, or say in a profile where the time comes from",
                pair[0]
            ),
            order if (order == Ordering::Greater) != is_backwards => format!(
                "goes neither up nor down: step {second} of the file is of {}, after {}; sort the file by time",
                pair[1], pair[0]
            ),
            _ => continue,
        };
        return Err(refused(name, detail));
    }
    if is_backwards {
        stamps.reverse();
    }
    Ok((stamps, is_backwards))
}

/// The one step of what holds at any time, of which nothing says when it is: the year of its stamp, if it has one.
fn fixed(
    planning: &mut Planning<'_>,
    variable: &Variable,
    stamp: Option<CalendarDate>,
    is_fixed: bool,
    silent: Rejection,
) -> Result<Period, Rejection> {
    if !is_fixed {
        return Err(silent);
    }
    planning.holds_always = true;
    let year = stamp.map_or(REFERENCE_YEAR, |stamp| stamp.year);
    planning.assume(format!(
        "{}: says of no time that it covers it; taken for what holds at any time, its one step is the year {year}",
        variable.name
    ));
    let period = Period::year(year);
    period.map_err(|e| refused(&variable.name, e.to_string()))
}

/// The stamps of a time axis. Those in the year 0 are of a mean year (COARDS), and become those of a year that can be shown.
async fn stamps_of(planning: &mut Planning<'_>, time: &str) -> Result<Vec<CalendarDate>, Stop> {
    let units = planning.file.variable(time);
    let units = units.and_then(|v| v.attributes.text("units"));
    if let Some(unit) = units.and_then(in_reference_year) {
        let moved = stamps::read(planning, time, Some(&unit), None).await?;
        if moved.iter().all(|stamp| stamp.year == REFERENCE_YEAR) {
            planning.assume(format!(
                "{time}: is in the year 0, which stands for a mean year; its steps are those of {REFERENCE_YEAR}"
            ));
            return Ok(moved);
        }
    }
    stamps::read(planning, time, None, None).await
}

/// `hours since 0000-01-01` from the same day of the reference year on.
fn in_reference_year(units: &str) -> Option<String> {
    let (step, date) = units.split_once(" since ")?;
    let day = ["0000-", "0-"]
        .iter()
        .find_map(|year| date.trim().strip_prefix(year))?;
    Some(format!("{step} since {REFERENCE_YEAR}-{day}"))
}

/// Steps from the distance of their stamps, or of the length that an attribute states.
fn by_spacing(
    planning: &mut Planning<'_>,
    name: &str,
    (stamps, is_backwards): (&[CalendarDate], bool),
) -> Result<Vec<Period>, Rejection> {
    let stated = || {
        Some(spacing::Spacing {
            covers: period::of_attributes(&planning.file.attributes)?,
            at: None,
            assumption: Some("stamps are taken for the starts of the steps"),
        })
    };
    let spacing = spacing::of(stamps).or_else(stated);
    let spacing::Spacing {
        covers,
        at,
        assumption,
    } = spacing.ok_or_else(|| refused(name, spacing::untold(stamps, is_backwards)))?;
    if let Some(assumption) = assumption {
        planning.assume(format!(
            "{name}: has no bounds; {assumption} (if they are not, say stamp = \"middle\" or \"end\" in a profile)"
        ));
    }
    let periods = covers.periods_at(stamps, at);
    let periods = periods.map_err(|e| refused(name, e))?;
    if let Some(told) = covers.told(name, &periods) {
        planning.assume(told);
    }
    Ok(periods)
}

/// The steps with the conversion of each to the stored unit.
pub(super) fn convert(
    variable: &Variable,
    profile: Option<&Profile>,
    meaning: Named,
    periods: &[Period],
) -> Result<Vec<PlannedStep>, Rejection> {
    let stated = profile.and_then(|p| p.variable.unit.as_deref());
    let own = open::stated_unit(variable);
    let bad = |detail: String| Rejection::new(RejectReason::Unit, &variable.name, detail);
    let missing = || bad("has no units attribute; state the unit in a profile".to_owned());
    if let (Quantity::Open(open), None) = (meaning.quantity, profile) {
        let factor = factor_of_open(own.unwrap_or("1"), &open.words().unit).map_err(bad)?;
        let step = |(time_index, period): (usize, &Period)| PlannedStep {
            period: *period,
            time_index: time_index as u64,
            factor,
            offset: 0.0,
        };
        return Ok(periods.iter().enumerate().map(step).collect());
    }
    let spelling = stated.or(own).ok_or_else(missing)?;
    let wrong = |e: String| bad(format!("has unit {spelling:?}, which {e}"));
    let unit = unit::of(meaning.quantity, spelling).map_err(wrong)?;
    let conversion = unit
        .to_quantity(meaning.quantity, meaning.substance)
        .map_err(wrong)?;
    let step = |(time_index, period): (usize, &Period)| {
        let (factor, offset) = conversion.for_period(*period).map_err(wrong)?;
        let (factor, offset) = (factor * meaning.sign, offset * meaning.sign);
        Ok(PlannedStep {
            period: *period,
            time_index: time_index as u64,
            factor,
            offset,
        })
    };
    periods.iter().enumerate().map(step).collect()
}

/// What values in a unit are multiplied by to be in that of their open quantity: in base units or, as this program writes what it computed, as
/// they are. Units that are not read stay.
fn factor_of_open(own: &str, unit: &str) -> Result<f64, String> {
    match unit::canonical(own) {
        _ if own == unit => Ok(1.0),
        Some((base, factor)) if base == unit => Ok(factor),
        Some(_) => Err(format!(
            "has unit {own:?}, and what it holds is in {unit:?}; give it in that"
        )),
        None => Ok(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_in_the_unit_of_its_quantity_stays_and_other_units_come_to_it_or_are_refused() {
        for (own, unit, factor) in [
            ("km", "km", 1.0),
            ("K year-1", "K year-1", 1.0),
            ("hPa", "Pa", 100.0),
            ("dB", "dB", 1.0),
            ("1", "1", 1.0),
        ] {
            assert_eq!(factor_of_open(own, unit), Ok(factor), "{own}");
        }
        let refused = factor_of_open("hPa", "km").unwrap_err();
        assert!(refused.contains("\"km\""), "{refused}");
    }
}
