//! The steps of a generated file: months, or days that are a month's map, stronger and weaker over nine days.

use contract::time::TimeMs;

/// The year of the twelve months.
const YEAR: u16 = 2009;
/// The last year that can be made up.
const LAST_YEAR: u16 = 2100;
/// Months of a year.
const MONTHS: usize = 12;
/// Days over which a daily map comes and goes, and by how much.
const WAX_DAYS: f64 = 9.0;
const WAX: f64 = 0.25;

/// Steps of a generated file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GeneratedSteps {
    /// The months of 2009.
    Months,
    /// So many days from the start of 2009, 1 to 365: the month's map, stronger and weaker over nine days.
    Days(u16),
    /// All days of a year from 2009 on, 2009 as above; eddies and clouds of other years are others.
    Year(u16),
}

impl GeneratedSteps {
    /// Why there can be no such steps.
    pub(super) fn refusal(self) -> Option<String> {
        match self {
            Self::Days(count) if !(1..=365).contains(&count) => {
                Some(format!("{count} days are not 1 to 365"))
            }
            Self::Year(year) if !(YEAR..=LAST_YEAR).contains(&year) => {
                Some(format!("{year} is not {YEAR} to {LAST_YEAR}"))
            }
            _ => None,
        }
    }

    /// Days since the start of 2009 at which steps begin, and at which the last one ends.
    pub(super) fn edges_days(self) -> Vec<f64> {
        match self {
            Self::Months => (0..=MONTHS).map(first_day).collect(),
            Self::Days(count) => (0..=count).map(f64::from).collect(),
            Self::Year(year) => {
                let month = first_month(year);
                let [start, end] = [month, month + MONTHS].map(|at| first_day(at) as u32);
                (start..=end).map(f64::from).collect()
            }
        }
    }

    /// The month that a step lies in, counted from January 2009, and by how much its flux is multiplied.
    pub(super) fn month_and_strength(self, step: usize) -> (usize, f32) {
        let (day, first_month) = match self {
            Self::Months => return (step, 1.0),
            Self::Days(_) => (step as f64, 0),
            Self::Year(year) => {
                let month = first_month(year);
                (first_day(month) + step as f64, month)
            }
        };
        let is_begun = |month: &usize| first_day(first_month + *month) <= day;
        let month = (0..MONTHS).rev().find(is_begun).unwrap_or(0);
        let phase = day / WAX_DAYS * std::f64::consts::TAU;
        (first_month + month, (1.0 + WAX * phase.sin()) as f32)
    }

    /// What a title says of the time that is covered.
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Months | Self::Days(_) => " 2009",
            // Files of several years make one product.
            Self::Year(_) => "",
        }
    }
}

/// January of a year, counted from January 2009.
fn first_month(year: u16) -> usize {
    MONTHS * usize::from(year.saturating_sub(YEAR))
}

/// Days from the start of 2009 to the start of a month, 0 for that January, 12 for the one after.
fn first_day(month: usize) -> f64 {
    let start = |month: usize| {
        let year = i32::from(YEAR) + (month / MONTHS) as i32;
        let start = TimeMs::from_ymd(year, (month % MONTHS) as u32 + 1, 1);
        start.map(|t| t.ms() as f64 / 86_400_000.0)
    };
    start(month)
        .and_then(|day| Ok(day - start(0)?))
        .expect("months of 2009 and later exist")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_lie_in_their_months() {
        let days = GeneratedSteps::Days(365);
        assert_eq!(days.edges_days().len(), 366);
        for (day, month) in [(0, 0), (30, 0), (31, 1), (58, 1), (59, 2), (364, 11)] {
            assert_eq!(days.month_and_strength(day).0, month, "{day}");
        }
        assert_eq!(GeneratedSteps::Months.month_and_strength(7), (7, 1.0));
        assert_eq!(
            GeneratedSteps::Months.edges_days()[12].to_bits(),
            365.0f64.to_bits()
        );
        let leap = GeneratedSteps::Year(2012);
        let edges = leap.edges_days();
        assert_eq!((edges.len(), edges[0] as u32), (367, 3 * 365));
        for (day, month) in [(0, 36), (59, 37), (60, 38), (365, 47)] {
            assert_eq!(leap.month_and_strength(day).0, month, "{day}");
        }
        assert_eq!(GeneratedSteps::Year(2009).edges_days(), days.edges_days());
    }

    #[test]
    fn no_days_and_years_before_the_first_are_refused() {
        let refusal = |steps: GeneratedSteps| steps.refusal().unwrap_or_default();
        assert!(refusal(GeneratedSteps::Days(0)).contains("0 days"));
        assert!(refusal(GeneratedSteps::Year(2008)).contains("2008"));
        assert!(refusal(GeneratedSteps::Year(2101)).contains("2101"));
        assert_eq!(GeneratedSteps::Months.refusal(), None);
    }
}
