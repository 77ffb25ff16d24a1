//! When the steps of a variable are, and how the values of each become the stored unit.

use contract::event::RejectReason;
use contract::time::Period;

use super::{PlannedStep, Planning, date};
use crate::cf::calendar::{Calendar, CalendarDate, TimeUnit};
use crate::cf::coordinate::{Axis, Role};
use crate::cf::period;
use crate::cf::quantity::Named;
use crate::error::Stop;
use crate::file::description::{Part, Variable};
use crate::profile::{Profile, TimeRules, TimeSource};
use crate::rejection::Rejection;
use crate::unit;

const ONE_STAMP: &str = "has one stamp and no bounds, so nothing says what it covers; say in a profile (covers = \"month\", say)";
const NO_TIME: &str = "has no time axis and no attribute that says its period; say in a profile where the time comes from";

fn refused(object: &str, detail: impl AsRef<str>) -> Rejection {
    Rejection::new(RejectReason::Time, object, detail)
}

/// The periods of all steps, in the order of the file, not overlapping.
pub(super) async fn periods(
    planning: &mut Planning<'_>,
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
        None => by_file(planning, axes).await?,
    };
    if periods.len() as u64 != count {
        let detail = format!(
            "has {} stamps for {count} steps; say in a profile where the time comes from",
            periods.len()
        );
        return Err(refused("time", detail).into());
    }
    let mut sorted = periods.clone();
    sorted.sort();
    let overlapping = sorted.windows(2).find(|pair| pair[0].overlaps(pair[1]));
    if let Some([first, second]) = overlapping {
        let detail = format!(
            "has steps that overlap ({first} and {second}); say in a profile what a step covers"
        );
        return Err(refused("time", detail).into());
    }
    Ok(periods)
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
        } => stamps(planning, name, unit.as_deref(), calendar.as_deref()).await?,
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
    let period = |stamp| {
        rules
            .covers
            .period(with_year(stamp))
            .map_err(|e| refused("time", e).into())
    };
    stamps.into_iter().map(period).collect()
}

/// Time as CF has it: bounds, then the distance of stamps, then attributes about the coverage.
async fn by_file(planning: &mut Planning<'_>, axes: &[Axis]) -> Result<Vec<Period>, Stop> {
    let Some(name) = planning.time_variable(axes) else {
        return Ok(vec![by_coverage(planning, "file", NO_TIME)?]);
    };
    let stamps = stamps(planning, &name, None, None).await?;
    let bounds = planning
        .file
        .variable(&name)
        .and_then(|v| v.attributes.text("bounds"))
        .map(str::to_owned);
    if let Some(bounds) = bounds
        && let Some(periods) = by_bounds(planning, &name, &bounds, stamps.len() as u64).await?
    {
        return Ok(periods);
    }
    let covers =
        period::of_spacing(&stamps).or_else(|| period::of_attributes(&planning.file.attributes));
    let covers = match covers {
        Some(covers) => covers,
        None if stamps.len() == 1 => {
            return Ok(vec![by_coverage(planning, &name, ONE_STAMP)?]);
        }
        None => {
            return Err(refused(
                &name,
                "has stamps at uneven distances; say in a profile what a step covers",
            )
            .into());
        }
    };
    stamps
        .into_iter()
        .map(|s| covers.period(s).map_err(|e| refused(&name, e).into()))
        .collect()
}

/// The one period of a file from `time_coverage_start` and `time_coverage_end`.
///
/// Without them the refusal says `missing` of `object`.
fn by_coverage(planning: &Planning<'_>, object: &str, missing: &str) -> Result<Period, Rejection> {
    let attributes = &planning.file.attributes;
    let at = |names: &[&str]| {
        names
            .iter()
            .find_map(|name| attributes.text(name))
            .and_then(date::of_attribute)
    };
    let start = at(&["time_coverage_start"]).ok_or_else(|| refused(object, missing))?;
    if let Some(covers) = period::of_attributes(attributes) {
        return covers
            .period(start)
            .map_err(|e| refused("time_coverage_start", e));
    }
    let end =
        at(&["time_coverage_end", "time_coverage_stop"]).ok_or_else(|| refused(object, missing))?;
    let both = period::instant(start).and_then(|s| Ok((s, period::instant(end)?)));
    let (start, end) = both.map_err(|e| refused("time_coverage_start", e))?;
    Period::new(start, end).map_err(|e| refused("time_coverage_end", e.to_string()))
}

/// Periods from a bounds variable of two numbers a step; none if there is no such variable.
async fn by_bounds(
    planning: &mut Planning<'_>,
    time: &str,
    bounds: &str,
    count: u64,
) -> Result<Option<Vec<Period>>, Stop> {
    let Some(variable) = planning.file.variable(bounds) else {
        return Ok(None);
    };
    let lens: Vec<u64> = variable.dimensions.iter().map(|d| d.len).collect();
    if lens != [count, 2] || !variable.is_numeric() {
        return Ok(None);
    }
    let unit = time_unit(planning, time, None, None)?;
    let numbers = planning
        .session
        .read(bounds, &[Part::All, Part::All], count * 2)
        .await?;
    let at = |number: f64| {
        unit.date(number)
            .and_then(period::instant)
            .map_err(|e| refused(bounds, e))
    };
    let period = |pair: &[f64]| {
        Period::new(at(pair[0])?, at(pair[1])?).map_err(|e| refused(bounds, e.to_string()))
    };
    Ok(Some(
        numbers
            .chunks_exact(2)
            .map(period)
            .collect::<Result<_, Rejection>>()?,
    ))
}

fn time_unit(
    planning: &Planning<'_>,
    name: &str,
    unit: Option<&str>,
    calendar: Option<&str>,
) -> Result<TimeUnit, Rejection> {
    let missing = || {
        refused(
            name,
            "is not in the file; say in a profile where the time comes from",
        )
    };
    let variable = planning.file.variable(name).ok_or_else(missing)?;
    let unit = unit.or_else(|| variable.attributes.text("units"));
    let unit = unit.ok_or_else(|| refused(name, "has no units; state them in a profile"))?;
    let calendar = calendar.or_else(|| variable.attributes.text("calendar"));
    let calendar = Calendar::parse(calendar).map_err(|e| refused(name, e))?;
    TimeUnit::parse(unit, calendar).map_err(|e| refused(name, e))
}

async fn stamps(
    planning: &mut Planning<'_>,
    name: &str,
    unit: Option<&str>,
    calendar: Option<&str>,
) -> Result<Vec<CalendarDate>, Stop> {
    let unit = time_unit(planning, name, unit, calendar)?;
    let numbers = planning.coordinate(name).await?;
    numbers
        .into_iter()
        .map(|n| unit.date(n).map_err(|e| refused(name, e).into()))
        .collect()
}

/// The steps with the conversion of each to the stored unit.
pub(super) fn convert(
    variable: &Variable,
    profile: Option<&Profile>,
    meaning: Named,
    periods: &[Period],
) -> Result<Vec<PlannedStep>, Rejection> {
    let stated = profile.and_then(|p| p.variable.unit.as_deref());
    let own = ["units", "Units", "unit", "Unit"]
        .into_iter()
        .find_map(|name| variable.attributes.text(name));
    let bad = |detail: String| Rejection::new(RejectReason::Unit, &variable.name, detail);
    let missing = || bad("has no units attribute; state the unit in a profile".to_owned());
    let spelling = stated.or(own).ok_or_else(missing)?;
    let wrong = |e: String| bad(format!("has unit {spelling:?}, which {e}"));
    let unit = unit::parse(spelling).map_err(wrong)?;
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
