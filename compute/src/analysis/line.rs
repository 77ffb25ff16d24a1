//! Steps at equal distances: periods in, the line without a gap that they lie on and the place of each out.

use contract::time::{Period, TimeMs, TimeStep};

/// Bins of the calendar, shortest first.
const CALENDAR: [TimeStep; 5] = [
    TimeStep::Day,
    TimeStep::Week,
    TimeStep::Month,
    TimeStep::Season,
    TimeStep::Year,
];
/// Most steps of a line with gaps: 270 years of days.
const MOST_STEPS: usize = 100_000;
/// Most lengths between the first of equal periods and the last: more than there are days that an instant can name.
const MOST_LENGTHS: i64 = 4_000_000;

/// A line of steps without a gap.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// All its steps, in the order of time.
    pub steps: Vec<Period>,
    /// Which of them each period is, from 0.
    pub places: Vec<usize>,
}

impl Line {
    /// The line from the first of some periods to the last: the periods where each begins as the one before ends; else bins of
    /// the calendar or equal lengths, as far apart as all the periods allow, so that what has a March a year has one step a year.
    ///
    /// None where they lie on no such line, or on one of more than 100 000 steps. `periods` are in the order of time.
    pub fn of(periods: &[Period]) -> Option<Self> {
        let is_whole = periods.windows(2).all(|pair| pair[0].end == pair[1].start);
        let (Some(first), Some(last), false) = (periods.first(), periods.last(), is_whole) else {
            return Some(Self::as_they_are(periods));
        };
        let are_bins_of = |step: &TimeStep| periods.iter().all(|period| is_bin(*step, *period));
        let close = match CALENDAR.into_iter().find(are_bins_of) {
            Some(step) => step.whole_bins(Period {
                start: first.start,
                end: last.end,
            }),
            None => equal_lengths(*first, *last)?,
        };
        let place = |period: &Period| close.binary_search(period).ok();
        let places = periods.iter().map(place).collect::<Option<Vec<usize>>>()?;
        let apart = places.windows(2).map(|pair| pair[0].abs_diff(pair[1]));
        let stride = apart.fold(0, greatest_divisor).max(1);
        let steps: Vec<Period> = close.into_iter().step_by(stride).collect();
        let places = places.into_iter().map(|place| place / stride).collect();
        (steps.len() <= MOST_STEPS).then_some(Self { steps, places })
    }

    /// Periods one after the other, whatever lies between them.
    pub fn as_they_are(periods: &[Period]) -> Self {
        Self {
            steps: periods.to_vec(),
            places: (0..periods.len()).collect(),
        }
    }

    /// Values of the periods, beside the steps; NaN where a step has no period. Any unit.
    pub fn spread(&self, values: &[f64]) -> Vec<f64> {
        let mut spread = vec![f64::NAN; self.steps.len()];
        for (place, value) in self.places.iter().zip(values) {
            spread[*place] = *value;
        }
        spread
    }
}

/// Values with NaN where steps are missing: those of [`Holes`].
///
/// `periods` are in the order of time, `values` beside them, any unit.
pub fn with_holes(periods: &[Period], values: &[f64]) -> Vec<f64> {
    Holes::between(periods).spread(values)
}

/// Where steps are missing, so that what follows a gap is not taken for the next step: all that a line lacks, one for each gap
/// where there is no line. Found once for all series over the same steps.
#[derive(Debug)]
pub enum Holes {
    /// The periods lie on a line.
    Line(Line),
    /// They lie on none: does something lie between each and the one before?
    Apart(Vec<bool>),
}

impl Holes {
    /// Those between some periods in the order of time.
    pub fn between(periods: &[Period]) -> Self {
        if let Some(line) = Line::of(periods) {
            return Self::Line(line);
        }
        let is_apart = |index: usize| index > 0 && periods[index - 1].end != periods[index].start;
        Self::Apart((0..periods.len()).map(is_apart).collect())
    }

    /// Values of the periods in their order, NaN where steps are missing. Any unit.
    pub fn spread(&self, values: &[f64]) -> Vec<f64> {
        let apart = match self {
            Self::Line(line) => return line.spread(values),
            Self::Apart(apart) => apart,
        };
        let mut with_holes = Vec::with_capacity(2 * values.len());
        for (value, is_apart) in values.iter().zip(apart) {
            if *is_apart {
                with_holes.push(f64::NAN);
            }
            with_holes.push(*value);
        }
        with_holes
    }
}

fn is_bin(step: TimeStep, period: Period) -> bool {
    matches!(step.calendar(period.start), Ok(Some(bin)) if bin == period)
}

/// Periods as long as the first, one after the other, to the end of the last.
fn equal_lengths(first: Period, last: Period) -> Option<Vec<Period>> {
    let length_ms = first.end.ms() - first.start.ms();
    let count = (last.end.ms() - first.start.ms()).checked_div(length_ms)?;
    if count > MOST_LENGTHS {
        return None;
    }
    let at = |index: i64| TimeMs::new(first.start.ms() + index * length_ms).ok();
    (0..count)
        .map(|index| Period::new(at(index)?, at(index + 1)?).ok())
        .collect()
}

fn greatest_divisor(a: usize, b: usize) -> usize {
    if b == 0 {
        a
    } else {
        greatest_divisor(b, a % b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn period(start: &str, end: &str) -> Period {
        Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
    }

    fn month(month: u32) -> Period {
        Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap()
    }

    #[test]
    fn a_missing_month_keeps_its_place() {
        let line = Line::of(&[month(0), month(1), month(3)]).unwrap();
        assert_eq!(line.steps, [0, 1, 2, 3].map(month));
        assert_eq!(line.places, [0, 1, 3]);
        let spread = line.spread(&[1.0, 2.0, 4.0]);
        assert!(spread[2].is_nan() && (spread[3] - 4.0).abs() < 1e-15);
        // Two that are missing are two, not one gap.
        let with_holes = with_holes(&[0, 1, 4].map(month), &[1.0, 2.0, 5.0]);
        let are_there: Vec<bool> = with_holes.iter().map(|value| !value.is_nan()).collect();
        assert_eq!(are_there, [true, true, false, false, true]);
    }

    #[test]
    fn a_march_a_year_is_a_step_a_year() {
        let line = Line::of(&[2, 14, 38].map(month)).unwrap();
        assert_eq!(line.steps, [2, 14, 26, 38].map(month));
        assert_eq!(line.places, [0, 1, 3]);
    }

    #[test]
    fn equal_lengths_make_a_line_and_others_only_where_they_touch() {
        let hours = [
            period("2001-01-01T00:00:00Z", "2001-01-01T06:00:00Z"),
            period("2001-01-01T06:00:00Z", "2001-01-01T12:00:00Z"),
            period("2001-01-01T18:00:00Z", "2001-01-02T00:00:00Z"),
        ];
        assert_eq!(Line::of(&hours).unwrap().places, [0, 1, 3]);
        let uneven = [
            period("2001-12-19", "2001-12-27"),
            period("2001-12-27", "2002-01-01"),
            period("2002-01-01", "2002-01-09"),
            period("2002-01-17", "2002-01-25"),
        ];
        assert_eq!(
            Line::of(&uneven[..3]),
            Some(Line::as_they_are(&uneven[..3]))
        );
        assert_eq!(Line::of(&uneven), None);
        let with_hole = with_holes(&uneven, &[1.0, 2.0, 3.0, 5.0]);
        assert_eq!((with_hole.len(), with_hole[3].is_nan()), (5, true));
        assert_eq!(Line::of(&[]), Some(Line::as_they_are(&[])));
    }

    #[test]
    fn a_line_that_nobody_could_read_is_none() {
        let first = period("2001-01-01T00:00:00Z", "2001-01-01T00:00:01Z");
        let last = period("2901-01-01T00:00:00Z", "2901-01-01T00:00:01Z");
        assert_eq!(Line::of(&[first, last]), None);
        let day = |year: &str| period(&format!("{year}-01-01"), &format!("{year}-01-02"));
        assert_eq!(Line::of(&[day("1001"), day("1002"), day("2001")]), None);
    }
}
