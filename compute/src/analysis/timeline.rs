//! Steps as points in time, years apart, and their means over common bins.

use contract::time::{Period, TimeStep};

use super::line::Line;

/// Milliseconds in a Julian year of 365.25 days.
pub const YEAR_MS: f64 = 365.25 * 86_400_000.0;
/// Share of a bin's time that must hold data for its mean to count; of seasons and years of that of each of their months, for what they lack else is a part
/// of the year, and their mean has the rest of the season in it.
const LEAST_SHARE: f64 = 0.5;

/// What must hold data for a mean over a bin of the calendar, in words.
pub fn least_in_words(step: TimeStep) -> &'static str {
    if has_months(step) {
        "half of each of its months"
    } else {
        "half of its time"
    }
}

/// Are bins of this step made of months?
fn has_months(step: TimeStep) -> bool {
    matches!(step, TimeStep::Season | TimeStep::Year | TimeStep::Total)
}

/// Middles of periods, years of 365.25 days after the first one's.
pub fn middles_years(periods: &[Period]) -> Vec<f64> {
    let first_ms = periods.first().map_or(0, |period| period.mid().ms());
    let years = |period: &Period| (period.mid().ms() - first_ms) as f64 / YEAR_MS;
    periods.iter().map(years).collect()
}

/// Means of steps over bins of the calendar: see [`Bins::means`]; steps as they are for `Native`, with NaN for those that are
/// missing between them ([`Line`]).
///
/// `periods` are in the order of time and do not overlap; `values` are beside them, NaN no data, any unit.
pub fn means_over(periods: &[Period], values: &[f64], step: TimeStep) -> (Vec<Period>, Vec<f64>) {
    let bins = Bins::over(periods, step);
    let means = bins.means(values);
    (bins.periods, means)
}

/// How steps lie in bins of the calendar: found once for all series over the same steps.
#[derive(Debug)]
pub struct Bins {
    periods: Vec<Period>,
    steps: Steps,
}

#[derive(Debug)]
enum Steps {
    /// Steps are taken as they are.
    Native(Line),
    /// Those that lie in each bin.
    Inside(Vec<InBin>),
}

/// Steps that lie in a bin.
#[derive(Debug)]
pub struct InBin {
    /// How they lie in it.
    pub whole: Inside,
    /// How they lie in each of its months; nothing of bins that are no longer.
    pub months: Vec<Inside>,
}

/// Steps that lie in a period of the calendar.
#[derive(Debug)]
pub struct Inside {
    /// The first step that reaches into it.
    pub from: usize,
    /// How many seconds of that and of each one after it lie in it.
    pub shared_s: Vec<f64>,
    /// Seconds that must hold data.
    pub least_s: f64,
}

impl Inside {
    /// Of steps in the order of time, those before `from` beside it.
    fn of(periods: &[Period], bin: Period, mut from: usize) -> Self {
        while from < periods.len() && periods[from].end <= bin.start {
            from += 1;
        }
        let own = periods[from..].iter();
        let own = own.take_while(|period| period.start < bin.end);
        let shared_s = own.map(|period| {
            let shared_ms = period.end.min(bin.end).ms() - period.start.max(bin.start).ms();
            shared_ms as f64 / 1000.0
        });
        Self {
            from,
            shared_s: shared_s.collect(),
            least_s: LEAST_SHARE * bin.seconds(),
        }
    }

    /// Do steps hold data over enough of it?
    fn is_held(&self, values: &[f64]) -> bool {
        let shared = values[self.from..].iter().zip(&self.shared_s);
        let with_data_s = shared.map(|(value, s)| if value.is_nan() { 0.0 } else { *s });
        with_data_s.sum::<f64>() >= self.least_s
    }
}

impl Bins {
    /// Bins without a gap from the first step to the last; for `Native` the steps themselves, and those that are missing where
    /// they lie on a line ([`Line::of`]).
    ///
    /// `periods` are in the order of time and do not overlap.
    pub fn over(periods: &[Period], step: TimeStep) -> Self {
        if step == TimeStep::Native {
            let line = Line::of(periods).unwrap_or_else(|| Line::as_they_are(periods));
            return Self {
                periods: line.steps.clone(),
                steps: Steps::Native(line),
            };
        }
        let bins = bins_over(periods, step);
        let mut inside: Vec<InBin> = Vec::with_capacity(bins.len());
        for bin in &bins {
            let from = inside.last().map_or(0, |before| before.whole.from);
            let months = has_months(step).then(|| TimeStep::Month.whole_bins(*bin));
            let in_month = |month: &Period| Inside::of(periods, *month, from);
            inside.push(InBin {
                whole: Inside::of(periods, *bin, from),
                months: months.iter().flatten().map(in_month).collect(),
            });
        }
        Self {
            periods: bins,
            steps: Steps::Inside(inside),
        }
    }

    /// The bins.
    pub fn periods(&self) -> &[Period] {
        &self.periods
    }

    /// Each bin with the steps that lie in it; nothing of steps that are taken as they are.
    pub fn inside(&self) -> impl Iterator<Item = (Period, &InBin)> {
        let inside: &[InBin] = match &self.steps {
            Steps::Native(_) => &[],
            Steps::Inside(inside) => inside,
        };
        self.periods.iter().copied().zip(inside)
    }

    /// Means over the bins, NaN where half of a bin's time, or of one of its months, holds no data: each step counts by the time of it that
    /// lies in the bin. `values` are one for each step, NaN no data, any unit.
    pub fn means(&self, values: &[f64]) -> Vec<f64> {
        let inside = match &self.steps {
            Steps::Native(line) => return line.spread(values),
            Steps::Inside(inside) => inside,
        };
        let mean = |InBin { whole, months }: &InBin| {
            let (mut sum, mut with_data_s) = (0.0, 0.0);
            for (value, shared_s) in values[whole.from..].iter().zip(&whole.shared_s) {
                if !value.is_nan() {
                    sum += value * shared_s;
                    with_data_s += shared_s;
                }
            }
            let is_held = with_data_s >= whole.least_s;
            if is_held && months.iter().all(|month| month.is_held(values)) {
                sum / with_data_s
            } else {
                f64::NAN
            }
        };
        inside.iter().map(mean).collect()
    }
}

/// What is to be said of bins that hold data, and too little of it for a mean; nothing of steps that are taken as they are.
pub fn left_out(periods: &[Period], values: &[f64], step: TimeStep) -> Option<String> {
    let bins = Bins::over(periods, step);
    let means = bins.means(values);
    let held = bins.inside().zip(&means).filter(|((_, inside), _)| {
        let own = &values[inside.whole.from..][..inside.whole.shared_s.len()];
        own.iter().any(|value| !value.is_nan())
    });
    let (mut all, mut left_out) = (0, 0);
    for (_bin, mean) in held {
        all += 1;
        left_out += usize::from(mean.is_nan());
    }
    (left_out > 0).then(|| {
        format!(
            "{left_out} of {all} means of step {step} are left out: a mean needs data over {}",
            least_in_words(step)
        )
    })
}

/// What steps may be gathered in: bins of the calendar that are no shorter than they are, else steps as they are.
pub fn no_shorter(periods: &[Period], step: TimeStep) -> TimeStep {
    match step.longest_step_s() {
        Some(most_s) if longest_s(periods) > most_s => TimeStep::Native,
        _ => step,
    }
}

/// Whole bins without a gap that some periods lie in, in the order of time; the periods themselves for `Native`.
pub fn bins_over(periods: &[Period], step: TimeStep) -> Vec<Period> {
    match (step, periods.first(), periods.last()) {
        (TimeStep::Native, _, _) | (_, None, _) | (_, _, None) => periods.to_vec(),
        (_, Some(first), Some(last)) => step.whole_bins(Period {
            start: first.start,
            end: last.end,
        }),
    }
}

/// The longest of some periods, s; 0 of none.
pub fn longest_s(periods: &[Period]) -> f64 {
    let lengths = periods.iter().map(|period| period.seconds());
    lengths.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn period(start: &str, end: &str) -> Period {
        Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
    }

    /// By hand: of the eight days from 29 January on three lie in January, five in February.
    #[test]
    fn a_step_across_two_months_counts_in_both_by_its_time() {
        let periods = [
            period("2001-01-01", "2001-01-29"),
            period("2001-01-29", "2001-02-06"),
            period("2001-02-06", "2001-03-01"),
            period("2001-03-01", "2001-03-10"),
            period("2001-05-01", "2001-06-01"),
        ];
        let values = [10.0, 20.0, f64::NAN, 1.0, 3.0];
        let (months, means) = means_over(&periods, &values, TimeStep::Month);
        assert_eq!(months.len(), 5);
        assert_eq!(months[1], Period::month(2001, 2).unwrap());
        assert!((means[0] - (28.0 * 10.0 + 3.0 * 20.0) / 31.0).abs() < 1e-12);
        // 5 of 28 days, 9 of 31, none: no means.
        assert!(means[1..4].iter().all(|mean| mean.is_nan()));
        assert!((means[4] - 3.0).abs() < 1e-12);
        let (years, means) = means_over(&periods, &values, TimeStep::Year);
        assert_eq!((years.len(), means[0].is_nan()), (1, true));
        // Of eleven months a year has no mean: what is missing is a part of its season. Of two days of three it has.
        let year: Vec<Period> = (1..=12)
            .map(|month| Period::month(2001, month).unwrap())
            .collect();
        let eleven: Vec<f64> = (0..12)
            .map(|m| if m == 6 { f64::NAN } else { 1.0 })
            .collect();
        assert!(means_over(&year, &eleven, TimeStep::Year).1[0].is_nan());
        let (seasons, means) = means_over(&year, &eleven, TimeStep::Season);
        assert_eq!(seasons.len(), 5);
        let is_held: Vec<bool> = means.iter().map(|mean| !mean.is_nan()).collect();
        // January and February are two months of a winter, December one of the next.
        assert_eq!(is_held, [false, true, false, true, false]);
        let days: Vec<Period> = TimeStep::Day.whole_bins(Period::year(2001).unwrap());
        let most: Vec<f64> = (0..365)
            .map(|d| if d % 3 == 1 { f64::NAN } else { 1.0 })
            .collect();
        assert!((means_over(&days, &most, TimeStep::Year).1[0] - 1.0).abs() < 1e-12);
        let (as_they_are, _) = means_over(&periods, &values, TimeStep::Native);
        assert_eq!(as_they_are, periods);
        assert_eq!(means_over(&[], &[], TimeStep::Month).0.len(), 0);
    }
}
