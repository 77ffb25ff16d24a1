//! Periods from the bounds of a time axis: two numbers a step, of one stretch of time or of a climatology (CF 7.1, 7.4).

use contract::time::Period;

use super::pairs::Layout;
use super::refused::refused;
use super::{Planning, no_bounds, stamps};
use crate::error::{Rejection, Stop};
use crate::inspect::file::description::Part;
use crate::plan::cf::calendar::CalendarDate;
use crate::plan::cf::cell_methods::TimeMethod;
use crate::plan::cf::packing::Packing;
use crate::plan::cf::period;

/// What a profile can state where bounds cannot be read.
const INSTEAD: &str = "the time";

/// What the bounds of a time axis say.
pub(super) enum Bounds {
    Periods(Vec<Period>),
    /// Both bounds of every step are its stamp.
    Instants,
    /// There are none.
    Silent,
}

/// Reads the bounds of a time axis.
///
/// # Errors
/// They are there and cannot be read, or do not hold their stamps.
pub(super) async fn read(
    planning: &mut Planning<'_>,
    time: &str,
    stamps: &[CalendarDate],
    method: Option<TimeMethod>,
) -> Result<Bounds, Stop> {
    let text = |name: &str| {
        let variable = planning.file.variable(time)?;
        variable.attributes.text(name).map(str::to_owned)
    };
    if let Some(name) = text("climatology") {
        return climatology(planning, time, &name, stamps, method).await;
    }
    let Some(name) = text("bounds") else {
        return Ok(Bounds::Silent);
    };
    let Some(dates) = dates(planning, time, &name, stamps.len() as u64).await? else {
        planning.assume(format!(
            "{time}: names bounds {name:?}, which are not there; they are passed over"
        ));
        return Ok(Bounds::Silent);
    };
    let is_instant = |[start, end]: &[CalendarDate; 2]| start.count_ms() == end.count_ms();
    if dates.iter().all(is_instant) {
        return Ok(Bounds::Instants);
    }
    let mut periods = Vec::with_capacity(dates.len());
    for ([start, end], stamp) in dates.into_iter().zip(stamps) {
        // In the order of their axis, which may go backwards.
        let (start, end) = if start.count_ms() > end.count_ms() {
            (end, start)
        } else {
            (start, end)
        };
        let period = period::between(start, end).map_err(|e| refused(&name, e))?;
        // On the count of their own calendar, for a stamp may be a day that the real one lacks.
        let is_within = start.count_ms() <= stamp.count_ms() && stamp.count_ms() <= end.count_ms();
        if !is_within {
            let detail = format!(
                "has a stamp at {stamp} whose bounds in {name:?} are {period}; say in a profile where the time comes from"
            );
            return Err(refused(time, detail).into());
        }
        periods.push(period);
    }
    Ok(Bounds::Periods(periods))
}

/// Both dates of every step; none if they are not there.
async fn dates(
    planning: &mut Planning<'_>,
    time: &str,
    bounds: &str,
    count: u64,
) -> Result<Option<Vec<[CalendarDate; 2]>>, Stop> {
    let Some(variable) = planning.bounds_of((time, bounds), INSTEAD)? else {
        return Ok(None);
    };
    let lens: Vec<u64> = variable.dimensions.iter().map(|d| d.len).collect();
    let layout = Layout::of(&lens, count).filter(|_| variable.is_numeric());
    let Some(layout) = layout else {
        return Err(refused(time, no_bounds(variable, count, INSTEAD)).into());
    };
    if let Some(told) = layout.told() {
        planning.assume(format!("{time}: its bounds {bounds:?} are {told}"));
    }
    let parts = vec![Part::All; lens.len()];
    let unit = stamps::unit(planning, time, None, None)?;
    // No fill value: in a store of Zarr 2 it may be the first instant.
    let packing = Packing::of(variable).with_any_range_text();
    let Packing { scale, offset, .. } = packing.checked(variable)?;
    let number_count = layout.number_count(count);
    let numbers = planning.values.read(bounds, &parts, number_count).await?;
    let date = |number: f64| {
        let date = unit.date(number * scale + offset);
        date.map_err(|e| refused(bounds, e))
    };
    let pair = |[one, other]: [f64; 2]| Ok([date(one)?, date(other)?]);
    let pairs = layout.pairs(&numbers).into_iter().map(pair);
    Ok(Some(pairs.collect::<Result<_, Rejection>>()?))
}

/// The steps of a climatology, each under the year of its stamp.
async fn climatology(
    planning: &mut Planning<'_>,
    time: &str,
    name: &str,
    stamps: &[CalendarDate],
    method: Option<TimeMethod>,
) -> Result<Bounds, Stop> {
    if method == Some(TimeMethod::WithinDays) {
        let detail = "is a climatology of hours of the day (cell_methods has \"within days\"), whose steps are no stretches of time; give means of whole days";
        return Err(refused(time, detail).into());
    }
    let Some(dates) = dates(planning, time, name, stamps.len() as u64).await? else {
        let detail = format!(
            "is a climatology whose bounds {name:?} are not there; say in a profile what a step covers"
        );
        return Err(refused(time, detail).into());
    };
    let within = |(pair, stamp): (&[CalendarDate; 2], &CalendarDate)| {
        within_year(*pair, *stamp).map_err(|e| refused(name, e))
    };
    let periods = dates
        .iter()
        .zip(stamps)
        .map(within)
        .collect::<Result<Vec<_>, _>>()?;
    if let (Some(first), Some(last)) = (dates.first(), dates.last()) {
        let (from, to) = (first[0].year, last[1]);
        // The end of a year is the first instant of the next.
        let to = to.year - i32::from((to.month, to.day, to.second <= 0.0) == (1, 1, true));
        planning.assume(format!(
            "{time}: is a climatology of {from} to {to}; its steps are stored under the years of their stamps"
        ));
    }
    Ok(Bounds::Periods(periods))
}

/// The stretch of one year that a climatological step is of, in the year in which it holds the stamp.
fn within_year([start, end]: [CalendarDate; 2], stamp: CalendarDate) -> Result<Period, String> {
    let in_year = |date: CalendarDate, year: i32| {
        let dated = CalendarDate { year, ..date };
        if period::instant(dated).is_ok() {
            return dated;
        }
        // 29 February in a common year is the day after the 28th.
        CalendarDate {
            month: 3,
            day: 1,
            ..dated
        }
    };
    let place = |date: CalendarDate| (date.month, date.day, date.second);
    let turns = i32::from(place(end) <= place(start));
    let of_year = |year: i32| [in_year(start, year), in_year(end, year + turns)];
    // On the count of their own calendar, for a stamp may be a day that the real one lacks.
    let holds_stamp = |[from, to]: &[CalendarDate; 2]| {
        from.count_ms() <= stamp.count_ms() && stamp.count_ms() <= to.count_ms()
    };
    let [own, before] = [stamp.year, stamp.year - 1].map(of_year);
    let [from, to] = if !holds_stamp(&own) && holds_stamp(&before) {
        before
    } else {
        own
    };
    period::between(from, to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::cf::calendar::Calendar;

    fn date(year: i32, month: u32, day: u32) -> CalendarDate {
        CalendarDate {
            year,
            month,
            day,
            second: 0.0,
            calendar: Calendar::Standard,
        }
    }

    /// A stamp of a calendar of models may be no day of the real one; its step is one all the same.
    #[test]
    fn a_climatology_of_a_model_is_told_in_its_own_calendar() {
        let of = |calendar, dates: [(i32, u32, u32); 3]| {
            let dated = |(year, month, day)| CalendarDate {
                calendar,
                ..date(year, month, day)
            };
            let [start, end, stamp] = dates.map(dated);
            within_year([start, end], stamp).unwrap().to_string()
        };
        assert_eq!(
            of(
                Calendar::Days360,
                [(1961, 2, 1), (1990, 3, 1), (1990, 2, 30)]
            ),
            "1990-02-01T00:00:00Z/1990-03-01T00:00:00Z"
        );
        assert_eq!(
            of(
                Calendar::NoLeap,
                [(1961, 2, 28), (1990, 3, 1), (2000, 2, 28)]
            ),
            "2000-02-28T00:00:00Z/2000-02-29T00:00:00Z"
        );
    }

    #[test]
    fn a_climatological_step_lies_in_the_year_of_its_stamp() {
        let of = |start, end, stamp| within_year([start, end], stamp).unwrap().to_string();
        assert_eq!(
            of(date(1961, 1, 1), date(1990, 2, 1), date(1975, 1, 16)),
            "1975-01-01T00:00:00Z/1975-02-01T00:00:00Z"
        );
        assert_eq!(
            of(date(1961, 12, 1), date(1991, 1, 1), date(1975, 12, 16)),
            "1975-12-01T00:00:00Z/1976-01-01T00:00:00Z"
        );
        assert_eq!(
            of(date(1960, 12, 1), date(1990, 3, 1), date(1975, 1, 16)),
            "1974-12-01T00:00:00Z/1975-03-01T00:00:00Z"
        );
        assert_eq!(
            of(date(1961, 1, 1), date(1991, 1, 1), date(1976, 7, 1)),
            "1976-01-01T00:00:00Z/1977-01-01T00:00:00Z"
        );
    }
}
