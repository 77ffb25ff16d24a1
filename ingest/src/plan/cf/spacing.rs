//! Stamps without bounds to periods: from their distances, and where in its period each is likely to stand.

use contract::time::Period;

use super::calendar::CalendarDate;
use super::period::{Covers, StampAt, between};

const DAY_MS: i64 = 86_400_000;
const HOUR_MS: i64 = 3_600_000;
const WEEK_DAYS: u32 = 7;

/// How long steps are, and where their stamps stand in them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Spacing {
    pub(crate) covers: Covers,
    /// None: a month or year holds its stamp.
    pub(crate) at: Option<StampAt>,
    /// What is taken for granted, where the stamps do not tell.
    pub(crate) assumption: Option<&'static str>,
}

/// How long steps of intervals are, from the distance of their stamps, which rise, in their own calendar; none if that does not
/// tell.
pub(crate) fn of(stamps: &[CalendarDate]) -> Option<Spacing> {
    let times = times(stamps)?;
    let year_days = stamps.first()?.calendar.year_days();
    let spacings = times.windows(2).map(|pair| pair[1] - pair[0]);
    let (low, high) = (spacings.clone().min()?, spacings.max()?);
    let months: Vec<i64> = stamps
        .iter()
        .map(|s| i64::from(s.year) * 12 + i64::from(s.month))
        .collect();
    let each_in_the_next_month = months.windows(2).all(|pair| pair[1] == pair[0] + 1);
    let whole = |ms: i64, unit_ms: i64, most: u32| {
        (ms % unit_ms == 0)
            .then(|| u32::try_from(ms / unit_ms).ok())
            .flatten()
            .filter(|n| *n <= most)
    };
    if each_in_the_next_month && low >= 27 * DAY_MS {
        return Some(holding(Covers::Month, stamps, |s| s.day == 1));
    }
    if low >= (year_days - 1) * DAY_MS && high <= (year_days + 2) * DAY_MS {
        return Some(holding(Covers::Year, stamps, |s| {
            (s.month, s.day) == (1, 1)
        }));
    }
    if low != high || low <= 0 {
        return None;
    }
    if let Some(days) = whole(low, DAY_MS, 366) {
        return Some(of_days(days, stamps, &times));
    }
    let hours = whole(low, HOUR_MS, 8784)?;
    let phase_ms = times[0].rem_euclid(low);
    let (at, assumption) = if DAY_MS % low == 0 && phase_ms * 2 == low {
        (StampAt::Middle, None)
    } else {
        (
            StampAt::Start,
            Some("stamps are taken for the starts of the steps"),
        )
    };
    Some(Spacing {
        covers: Covers::Hours(hours),
        at: Some(at),
        assumption,
    })
}

/// Steps that hold their stamps, wherever in them these stand; on the first instant they could also be ends.
fn holding(
    covers: Covers,
    stamps: &[CalendarDate],
    is_first: impl Fn(&CalendarDate) -> bool,
) -> Spacing {
    let is_edge = stamps.iter().all(|s| is_first(s) && s.second == 0.0);
    Spacing {
        covers,
        at: None,
        assumption: is_edge
            .then_some("stamps on first instants are taken for the starts of the steps"),
    }
}

/// Steps of days. Those of several days are counted from the first of January, as the makers of such composites do.
fn of_days(days: u32, stamps: &[CalendarDate], times: &[i64]) -> Spacing {
    let of_day_ms = times[0].rem_euclid(DAY_MS);
    // What goes on over New Year at one distance is not counted anew there, and weeks are counted by the day of the week.
    let are_middles = days != WEEK_DAYS
        && stamps.iter().zip(times).all(|(stamp, time)| {
            let place = day_of_year(*stamp, *time) % i64::from(days);
            place != 0 && place == i64::from(days) / 2
        });
    let is_noon = of_day_ms * 2 == DAY_MS;
    let (at, assumption) = match (days, of_day_ms) {
        (1, _) if is_noon => (StampAt::Middle, None),
        (1, 0) => (
            StampAt::Start,
            Some("stamps at midnight are taken for the starts of the days"),
        ),
        (1, _) => (
            StampAt::Start,
            Some("steps are taken for the days that hold their stamps"),
        ),
        // The middle of an odd number of days is a noon.
        (n, _) if is_noon && n % 2 == 1 => (StampAt::Middle, None),
        (_, 0) if are_middles => (
            StampAt::Middle,
            Some("stamps are taken for the middles of steps that are counted from 1 January"),
        ),
        _ => (
            StampAt::Start,
            Some("stamps are taken for the starts of the steps"),
        ),
    };
    Spacing {
        covers: Covers::Days(days),
        at: Some(at),
        assumption,
    }
}

/// Days since the start of the year of a stamp, of which the time is given, in its own calendar.
fn day_of_year(stamp: CalendarDate, time: i64) -> i64 {
    let new_year = CalendarDate {
        month: 1,
        day: 1,
        second: 0.0,
        ..stamp
    };
    let start = new_year.count_ms();
    start.map_or(0, |start| (time - start).div_euclid(DAY_MS))
}

/// The periods for which values at instants stand: half way to the neighbours. At least two instants, which rise.
pub(crate) fn around(stamps: &[CalendarDate]) -> Result<Vec<Period>, String> {
    let few = || "has fewer than two instants; say in a profile what a step covers".to_owned();
    let times = times(stamps)
        .filter(|times| times.len() > 1)
        .ok_or_else(few)?;
    let halves: Vec<i64> = times
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / 2)
        .collect();
    let after = |(stamp, ms): (&CalendarDate, i64)| {
        let edge = stamp.later(ms);
        edge.ok_or_else(|| format!("has a step about {stamp} that leads past the years 1 to 9998"))
    };
    let before_first = stamps.iter().take(1).zip([-halves[0]]);
    let after_each = halves.iter().chain(halves.last()).copied();
    let edges = before_first.chain(stamps.iter().zip(after_each)).map(after);
    let edges = edges.collect::<Result<Vec<_>, String>>()?;
    edges
        .windows(2)
        .map(|pair| between(pair[0], pair[1]))
        .collect()
}

/// Milliseconds of stamps on the count of their calendar.
fn times(stamps: &[CalendarDate]) -> Option<Vec<i64>> {
    stamps.iter().map(|s| s.count_ms()).collect()
}

/// Why the distance of stamps, which rise, does not tell how long steps are, with the first place where it does not; `is_backwards`: the file has them the
/// other way round.
pub(crate) fn untold(stamps: &[CalendarDate], is_backwards: bool) -> String {
    let advice = "say in a profile what a step covers";
    let times = times(stamps).unwrap_or_default();
    let distances: Vec<i64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let step = |at: usize| {
        if is_backwards {
            stamps.len() - at
        } else {
            at + 1
        }
    };
    let is_odd = |distance: &i64| Some(distance) != distances.first();
    match distances.iter().position(is_odd) {
        Some(at) => format!(
            "has stamps at uneven distances: {} and {} are the first two, and {} and {} are the steps {} and {} of the file; {advice}",
            stamps[0],
            stamps[1],
            stamps[at],
            stamps[at + 1],
            step(at),
            step(at + 1)
        ),
        None => format!("has stamps whose distance is no length of steps that is known; {advice}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::cf::calendar::Calendar;

    fn stamp(year: i32, month: u32, day: u32, hour: f64) -> CalendarDate {
        CalendarDate {
            year,
            month,
            day,
            second: hour * 3600.0,
            calendar: Calendar::Standard,
        }
    }

    /// First period of the steps, and whether something was assumed.
    fn told(stamps: &[CalendarDate]) -> Option<(String, bool)> {
        let Spacing {
            covers,
            at,
            assumption,
        } = of(stamps)?;
        let period = covers.period_at(stamps[0], at).unwrap();
        Some((period.to_string(), assumption.is_some()))
    }

    fn days(first: u32, step: usize, hour: f64) -> Vec<CalendarDate> {
        (first..29)
            .step_by(step)
            .map(|day| stamp(2001, 1, day, hour))
            .collect()
    }

    #[test]
    fn months_and_years_hold_their_stamps() {
        let months = |day| {
            (1..=12)
                .map(|m| stamp(2001, m, day, 0.0))
                .collect::<Vec<_>>()
        };
        let january = "2001-01-01T00:00:00Z/2001-02-01T00:00:00Z".to_owned();
        assert_eq!(told(&months(15)), Some((january.clone(), false)));
        assert_eq!(told(&months(1)), Some((january, true)));
        let years: Vec<_> = (1999..=2004).map(|y| stamp(y, 7, 1, 0.0)).collect();
        let year = "1999-01-01T00:00:00Z/2000-01-01T00:00:00Z".to_owned();
        assert_eq!(told(&years), Some((year, false)));
    }

    #[test]
    fn centred_days_are_told_from_starts() {
        let day = "2001-01-01T00:00:00Z/2001-01-02T00:00:00Z".to_owned();
        assert_eq!(told(&days(1, 1, 12.0)), Some((day.clone(), false)));
        assert_eq!(told(&days(1, 1, 0.0)), Some((day.clone(), true)));
        assert_eq!(told(&days(1, 1, 9.0)), Some((day, true)));
        let eight = "2001-01-01T00:00:00Z/2001-01-09T00:00:00Z".to_owned();
        assert_eq!(told(&days(1, 8, 0.0)), Some((eight.clone(), true)));
        assert_eq!(told(&days(5, 8, 0.0)), Some((eight, true)));
        let five = "2001-01-01T00:00:00Z/2001-01-06T00:00:00Z".to_owned();
        assert_eq!(told(&days(3, 5, 12.0)), Some((five, false)));
    }

    #[test]
    fn what_goes_on_over_new_year_is_not_counted_from_it_and_weeks_never_are() {
        let all = |days: [(i32, u32, u32); 3]| {
            days.map(|(year, month, day)| stamp(year, month, day, 0.0))
        };
        // 23 December is a middle of eight days that are counted from 1 January 2003, and 8 January is none.
        let eight = all([(2003, 12, 23), (2003, 12, 31), (2004, 1, 8)]);
        let start = "2003-12-23T00:00:00Z/2003-12-31T00:00:00Z".to_owned();
        assert_eq!(told(&eight), Some((start, true)));
        let middle = "2003-12-19T00:00:00Z/2003-12-27T00:00:00Z".to_owned();
        assert_eq!(told(&eight[..2]), Some((middle, true)));
        let week = all([(2003, 4, 26), (2003, 5, 3), (2003, 5, 10)]);
        let start = "2003-04-26T00:00:00Z/2003-05-03T00:00:00Z".to_owned();
        assert_eq!(told(&week), Some((start, true)));
    }

    #[test]
    fn hours_that_stand_in_the_middle_are_told() {
        let hours = |first: f64, step: f64| {
            (0..4)
                .map(|i| stamp(2001, 1, 1, first + step * f64::from(i)))
                .collect::<Vec<_>>()
        };
        let first = "2001-01-01T00:00:00Z/2001-01-01T06:00:00Z".to_owned();
        assert_eq!(told(&hours(3.0, 6.0)), Some((first.clone(), false)));
        assert_eq!(told(&hours(0.0, 6.0)), Some((first, true)));
    }

    #[test]
    fn uneven_stamps_and_single_ones_do_not_tell() {
        let uneven = [
            stamp(2001, 1, 1, 0.0),
            stamp(2001, 1, 4, 0.0),
            stamp(2001, 1, 5, 0.0),
        ];
        assert_eq!((told(&uneven), told(&uneven[..1])), (None, None));
    }

    #[test]
    fn instants_stand_for_the_time_around_them() {
        let stamps: Vec<_> = [0.0, 6.0, 12.0].map(|h| stamp(2001, 1, 1, h)).to_vec();
        let periods: Vec<String> = around(&stamps)
            .unwrap()
            .iter()
            .map(Period::to_string)
            .collect();
        assert_eq!(
            periods,
            [
                "2000-12-31T21:00:00Z/2001-01-01T03:00:00Z",
                "2001-01-01T03:00:00Z/2001-01-01T09:00:00Z",
                "2001-01-01T09:00:00Z/2001-01-01T15:00:00Z"
            ]
        );
        assert!(around(&stamps[..1]).unwrap_err().contains("fewer than two"));
    }

    /// Distances are those of the calendar of the file: 28 February and 1 March follow each other in one without leap days.
    #[test]
    fn steps_of_a_model_are_told_in_its_own_calendar() {
        let stamps = |calendar, dates: &[(i32, u32, u32)]| {
            let stamp = |(year, month, day): &(i32, u32, u32)| CalendarDate {
                calendar,
                ..stamp(*year, *month, *day, 12.0)
            };
            dates.iter().map(stamp).collect::<Vec<_>>()
        };
        let days = stamps(
            Calendar::NoLeap,
            &[(2004, 2, 27), (2004, 2, 28), (2004, 3, 1)],
        );
        assert_eq!(of(&days).unwrap().covers, Covers::Days(1));
        let around: Vec<_> = around(&days)
            .unwrap()
            .iter()
            .map(Period::to_string)
            .collect();
        assert_eq!(around[1], "2004-02-28T00:00:00Z/2004-02-29T00:00:00Z");
        assert_eq!(around[2], "2004-03-01T00:00:00Z/2004-03-02T00:00:00Z");
        let months = stamps(
            Calendar::Days360,
            &[(2001, 1, 30), (2001, 2, 30), (2001, 3, 30)],
        );
        assert_eq!(of(&months).unwrap().covers, Covers::Month);
        let years = stamps(
            Calendar::Days360,
            &[(2001, 7, 1), (2002, 7, 1), (2003, 7, 1)],
        );
        assert_eq!(of(&years).unwrap().covers, Covers::Year);
    }

    #[test]
    fn uneven_distances_are_told_with_their_places() {
        let day = |day| stamp(2001, 1, day, 0.0);
        let stamps = [day(1), day(2), day(5)];
        assert_eq!(told(&stamps), None);
        for (is_backwards, steps) in [(false, "the steps 2 and 3"), (true, "the steps 2 and 1")] {
            let uneven = untold(&stamps, is_backwards);
            for part in ["uneven", "2001-01-05", steps] {
                assert!(uneven.contains(part), "{part}: {uneven}");
            }
        }
    }
}
