//! The one period of a file from its attributes: `time_coverage_start`, `time_coverage_end` and `time_coverage_resolution`.

use contract::time::{Period, TimeMs};

use super::refused::refused;
use super::{Planning, date};
use crate::error::Rejection;
use crate::plan::cf::calendar::CalendarDate;
use crate::plan::cf::period::{self, Covers, StampAt};

const DAY_MS: i64 = 86_400_000;
const HOUR_MS: i64 = 3_600_000;
/// Coverage of at least this is meant to be of whole days: that of a day of orbits begins and ends with one of them.
const WHOLE_DAYS_MS: i64 = 20 * HOUR_MS;
/// How far from a midnight such an orbit may begin or end.
const ORBITS_MS: i64 = 4 * HOUR_MS;
/// An end that is this close before a midnight names the last instant instead of the first after it.
const LAST_INSTANT_MS: i64 = 60_000;
/// How far coverage and a stated length may be apart and mean the same, as a share of it, of more than an orbit and at most a day: a
/// last day may be named by its midnight.
const SAME_STEP: i64 = 5;
/// Coverage of whole days to within this that begins an hour or more from midnight is that of days of its own.
const EXACT_MS: i64 = 60_000;

const ONE_STAMP: &str = "has one stamp and no bounds, so nothing says what it covers; say in a profile, such as [time] covers = \"month\", from = { variable = { name = \"time\" } }";
const NO_TIME: &str = "has no time axis and no attribute that says its period; say in a profile where the time comes from";

/// What the attributes of a file say.
#[derive(Clone, Copy)]
struct Coverage {
    start: TimeMs,
    end: Option<TimeMs>,
}

impl Coverage {
    fn of(planning: &Planning<'_>) -> Option<Self> {
        let attributes = &planning.file.attributes;
        let text = |name: &str| attributes.text(name);
        let instant = |text: &str| period::instant(date::of_attribute(text)?).ok();
        let start = instant(text("time_coverage_start")?)?;
        let end = |name: &&str| {
            let end = date::end_of_attribute(text(name)?);
            end.filter(|end| *end > start)
        };
        let end = ["time_coverage_end", "time_coverage_stop"]
            .iter()
            .find_map(end);
        Some(Self { start, end })
    }
}

/// The one period of a file that has a stamp (of the variable `time`), or none.
pub(super) fn period(
    planning: &mut Planning<'_>,
    stamp: Option<(&str, CalendarDate)>,
) -> Result<Period, Rejection> {
    let coverage = Coverage::of(planning);
    let resolution = period::of_attributes(&planning.file.attributes);
    let whole = coverage.and_then(|coverage| Some((coverage.start, coverage.end?)));
    let found = match (resolution, whole, stamp) {
        (Some(covers), Some(whole), _) => agreed(planning, covers, whole)?,
        (Some(covers), None, stamp) => by_resolution(planning, covers, coverage, stamp)?,
        (None, Some((start, end)), _) => snapped(planning, start, end)?,
        (None, _, Some((time, _))) => return Err(refused(time, ONE_STAMP)),
        (None, _, None) => return Err(refused("file", NO_TIME)),
    };
    check_stamp(found, stamp)?;
    Ok(found)
}

/// The period of a stated length where the coverage says the same, or lies within it; the coverage where it is as long and lies elsewhere.
/// Whether days end with their year the coverage says.
///
/// # Errors
/// They are of different lengths: what is stated may be how far values are apart, or the coverage that of a larger file.
fn agreed(
    planning: &mut Planning<'_>,
    covers: Covers,
    (start, end): (TimeMs, TimeMs),
) -> Result<Period, Rejection> {
    let (whole, _) = whole_days(start, end)?;
    let length_ms = |period: Period| period.end.ms() - period.start.ms();
    let allowed_ms = |step: Period| (length_ms(step) / SAME_STEP).clamp(ORBITS_MS, DAY_MS);
    let off_end_ms = |step: Period| (whole.end.ms() - step.end.ms()).abs();
    let cut = from_start(covers, start)?;
    let over_new_year = covers.period_over_new_year(date::of_instant(first_of(start)));
    let stated = over_new_year
        .ok()
        .filter(|step| off_end_ms(*step) <= allowed_ms(*step).min(off_end_ms(cut)))
        .unwrap_or(cut);
    let off_ms = allowed_ms(stated);
    let early_ms = stated.start.ms() - whole.start.ms();
    let late_ms = whole.end.ms() - stated.end.ms();
    let is_long = length_ms(stated) <= DAY_MS || 2 * length_ms(whole) >= length_ms(stated);
    if early_ms.max(late_ms) <= off_ms && is_long {
        if early_ms.min(late_ms) < -off_ms {
            planning.assume(format!(
                "file: time_coverage_start and _end, {start} and {end}, lie within the step {stated}, whose length time_coverage_resolution gives"
            ));
        }
        if let Some(told) = covers.told("file", &[stated]) {
            planning.assume(told);
        }
        return Ok(stated);
    }
    if (length_ms(whole) - length_ms(stated)).abs() <= off_ms {
        planning.assume(format!(
            "file: its step is {whole}, as time_coverage_start and _end say; time_coverage_resolution gives its length alone"
        ));
        return snapped(planning, start, end);
    }
    let detail = format!(
        "has a time_coverage_resolution by which its step is {stated}, but time_coverage_start and _end say {whole}; say in a profile which is right (covers = \"month\", say)"
    );
    Err(refused("file", detail))
}

/// The period of a stated length from the start of the coverage on.
fn from_start(covers: Covers, start: TimeMs) -> Result<Period, Rejection> {
    let period = covers.period(date::of_instant(first_of(start)));
    period.map_err(|e| refused("time_coverage_start", e))
}

/// The midnight that the start of a coverage of orbits is near to, else the start itself.
fn first_of(start: TimeMs) -> TimeMs {
    match nearest_midnight(start) {
        Some((midnight, off_ms)) if off_ms <= ORBITS_MS => midnight,
        _ => start,
    }
}

/// The period of a stated length: a month or year that holds the stamp, days from the start of the coverage.
fn by_resolution(
    planning: &mut Planning<'_>,
    covers: Covers,
    coverage: Option<Coverage>,
    stamp: Option<(&str, CalendarDate)>,
) -> Result<Period, Rejection> {
    let attribute = "time_coverage_resolution";
    if let Some(Coverage { start, .. }) = coverage {
        let period = from_start(covers, start)?;
        if let Some(told) = covers.told("file", &[period]) {
            planning.assume(told);
        }
        return Ok(period);
    }
    let Some((time, stamp)) = stamp else {
        return Err(refused("file", NO_TIME));
    };
    let is_edge = stamp.day == 1 && stamp.second <= 0.0;
    if is_edge || !matches!(covers, Covers::Month | Covers::Year) {
        planning.assume(format!(
            "{time}: its one stamp is taken for the start of the step that {attribute} gives the length of"
        ));
    }
    let period = covers.period_at(stamp, Some(StampAt::Start));
    let period = period.map_err(|e| refused(time, e))?;
    if let Some(told) = covers.told(time, &[period]) {
        planning.assume(told);
    }
    Ok(period)
}

/// Coverage as it is, or the whole days that it was meant to be.
fn snapped(planning: &mut Planning<'_>, start: TimeMs, end: TimeMs) -> Result<Period, Rejection> {
    let (period, is_other) = whole_days(start, end)?;
    if is_other {
        planning.assume(format!(
            "file: time_coverage_start and _end, {start} and {end}, are taken for the whole days {period}"
        ));
    }
    Ok(period)
}

/// The same, and whether that is more than an end that names its last instant.
fn whole_days(start: TimeMs, end: TimeMs) -> Result<(Period, bool), Rejection> {
    let bad = |e: contract::ContractError| refused("time_coverage_end", e.to_string());
    let as_it_is = Period::new(start, end).map_err(bad)?;
    let length_ms = end.ms() - start.ms();
    let (Some((first, first_off_ms)), Some((last, last_off_ms))) =
        (nearest_midnight(start), nearest_midnight(end))
    else {
        return Ok((as_it_is, false));
    };
    let is_whole = (length_ms + EXACT_MS).rem_euclid(DAY_MS) <= 2 * EXACT_MS;
    let is_of_its_own = is_whole && first_off_ms >= HOUR_MS && last_off_ms >= HOUR_MS;
    if length_ms < WHOLE_DAYS_MS || first_off_ms.max(last_off_ms) > ORBITS_MS || is_of_its_own {
        return Ok((as_it_is, false));
    }
    let whole = Period::new(first, last).map_err(bad)?;
    let is_last_instant = end <= last && last_off_ms <= LAST_INSTANT_MS;
    let is_other = first_off_ms > 0 || last_off_ms > 0 && !is_last_instant;
    Ok((whole, is_other))
}

/// The nearest midnight, and how far it is, ms.
fn nearest_midnight(time: TimeMs) -> Option<(TimeMs, i64)> {
    let midnight_ms = (time.ms() + DAY_MS / 2).div_euclid(DAY_MS) * DAY_MS;
    Some((
        TimeMs::new(midnight_ms).ok()?,
        (time.ms() - midnight_ms).abs(),
    ))
}

/// Refuses a stamp that is more than a day from the period that attributes give.
fn check_stamp(period: Period, stamp: Option<(&str, CalendarDate)>) -> Result<(), Rejection> {
    let Some((time, stamp)) = stamp else {
        return Ok(());
    };
    let Ok(stamp) = period::instant(stamp) else {
        return Ok(());
    };
    if stamp.ms() < period.start.ms() - DAY_MS || stamp.ms() > period.end.ms() + DAY_MS {
        let detail = format!(
            "has its stamp at {stamp}, but time_coverage_start and its like say {period}; say in a profile which is right"
        );
        return Err(refused(time, detail));
    }
    Ok(())
}
