//! The stamps of a time axis: its numbers as dates of its calendar.

use super::Planning;
use super::refused::refused;
use crate::error::{Rejection, Stop};
use crate::plan::cf::calendar::{Calendar, CalendarDate, TimeUnit};

/// The unit of a time variable; `unit` and `calendar` instead of those of the file.
pub(super) fn unit(
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
    let calendar = self::calendar(planning, name, calendar)?;
    TimeUnit::parse(unit, calendar).map_err(|e| refused(name, e))
}

/// The calendar of a time variable; `stated` instead of that of the file.
pub(super) fn calendar(
    planning: &Planning<'_>,
    name: &str,
    stated: Option<&str>,
) -> Result<Calendar, Rejection> {
    let of_file = || planning.file.variable(name)?.attributes.text("calendar");
    Calendar::parse(stated.or_else(of_file)).map_err(|e| refused(name, e))
}

/// All stamps of a time variable.
pub(super) async fn read(
    planning: &mut Planning<'_>,
    name: &str,
    stated: Option<&str>,
    calendar: Option<&str>,
) -> Result<Vec<CalendarDate>, Stop> {
    let unit = unit(planning, name, stated, calendar)?;
    let numbers = planning.coordinate(name).await?;
    numbers
        .into_iter()
        .map(|n| unit.date(n).map_err(|e| refused(name, e).into()))
        .collect()
}
