//! Calendar rows of a budget: exact sums of steps in, rows with budget and coverage out.

use contract::ContractError;
use contract::time::{Period, TimeMs};
use serde::{Deserialize, Serialize};

use super::accumulated::Completeness;
use super::fixed::{AREA_DECIMALS, MASS_DECIMALS, decimal_text, share};

/// What one row of a budget covers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BudgetStep {
    /// Calendar months.
    Month,
    /// Calendar years.
    #[default]
    Year,
    /// The whole asked period.
    Total,
}

impl std::str::FromStr for BudgetStep {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "month" => Ok(Self::Month),
            "year" => Ok(Self::Year),
            "total" => Ok(Self::Total),
            _ => Err(ContractError::invalid(
                "step",
                s,
                "use month, year or total",
            )),
        }
    }
}

/// Exact sums of one step over a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StepSum {
    /// What the step covers.
    pub period: Period,
    /// Mass that left the sea in the whole step, kg in steps of 10⁻⁹.
    pub mass_steps: i128,
    /// Area that holds data, m² in steps of 10⁻⁶.
    pub area_steps: i128,
}

/// One row of a budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BudgetRow {
    /// First instant.
    pub start: TimeMs,
    /// First instant after it.
    pub end: TimeMs,
    /// Carbon that left the sea, kg, exact, as decimal text; negative where the sea took it up.
    pub budget_kg: String,
    /// The same in Tg (10⁹ kg).
    pub budget_tg: f64,
    /// Share of the region's area and of the row's time that holds data, percent. Land counts as without data.
    pub coverage_percent: f64,
    /// Area that holds data, mean over the time that steps cover, m².
    pub area_m2: f64,
    /// Area of the region, land included, m².
    pub region_area_m2: f64,
    /// How complete the sums of accumulated carbon are; none for fluxes, and in versions that did not count it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub completeness: Option<Completeness>,
}

/// Kilograms in a teragram.
pub const KG_PER_TG: f64 = 1e9;

/// The parts of `window` that rows cover, in the order of time.
pub fn row_periods(window: Period, step: BudgetStep) -> Result<Vec<Period>, ContractError> {
    if step == BudgetStep::Total {
        return Ok(vec![window]);
    }
    let (mut year, mut month) = window.start.year_month();
    let mut periods = vec![];
    loop {
        let calendar = match step {
            BudgetStep::Month => Period::month(year, month)?,
            BudgetStep::Year | BudgetStep::Total => Period::year(year)?,
        };
        periods.push(Period::new(
            calendar.start.max(window.start),
            calendar.end.min(window.end),
        )?);
        if calendar.end >= window.end {
            return Ok(periods);
        }
        (year, month) = calendar.end.year_month();
    }
}

/// One row of each period that some step reaches into.
///
/// A step that lies partly inside counts by the share of its time. None if a sum leaves 128 bits.
pub fn rows(periods: &[Period], sums: &[StepSum], region_area_m2: f64) -> Option<Vec<BudgetRow>> {
    let mut rows = vec![];
    for &period in periods {
        let first = sums.partition_point(|sum| sum.period.end <= period.start);
        let inside = sums[first..]
            .iter()
            .take_while(|sum| sum.period.start < period.end);
        let mut total = Total::default();
        for sum in inside {
            total.add(sum, period)?;
        }
        if total.covered_ms > 0 {
            rows.push(total.row(period, region_area_m2));
        }
    }
    Some(rows)
}

/// Exact sums of one row.
#[derive(Default)]
struct Total {
    mass_steps: i128,
    /// Area x time, 10⁻⁶ m² ms.
    area_time: i128,
    covered_ms: i64,
}

impl Total {
    fn add(&mut self, sum: &StepSum, row: Period) -> Option<()> {
        let start = sum.period.start.max(row.start);
        let end = sum.period.end.min(row.end);
        let inside_ms = end.ms() - start.ms();
        let whole_ms = sum.period.end.ms() - sum.period.start.ms();
        self.mass_steps =
            self.mass_steps
                .checked_add(share(sum.mass_steps, inside_ms, whole_ms)?)?;
        self.area_time = self
            .area_time
            .checked_add(sum.area_steps.checked_mul(i128::from(inside_ms))?)?;
        self.covered_ms += inside_ms;
        Some(())
    }

    fn row(&self, period: Period, region_area_m2: f64) -> BudgetRow {
        let area_time_m2_ms = self.area_time as f64 / 10f64.powi(AREA_DECIMALS as i32);
        let row_ms = (period.end.ms() - period.start.ms()) as f64;
        BudgetRow {
            start: period.start,
            end: period.end,
            budget_kg: decimal_text(self.mass_steps, MASS_DECIMALS),
            budget_tg: self.mass_steps as f64 / 10f64.powi(MASS_DECIMALS as i32) / KG_PER_TG,
            // Cells and the whole region are rounded apart, so a full region could come out a hair above.
            coverage_percent: (100.0 * area_time_m2_ms / (region_area_m2 * row_ms)).min(100.0),
            area_m2: area_time_m2_ms / self.covered_ms as f64,
            region_area_m2,
            completeness: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn period(start: &str, end: &str) -> Period {
        Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
    }

    fn month(month: u32, mass_kg: i128) -> StepSum {
        let scale = 10i128.pow(MASS_DECIMALS);
        StepSum {
            period: Period::month(2000, month).unwrap(),
            mass_steps: mass_kg * scale,
            area_steps: 50_000_000,
        }
    }

    #[test]
    fn months_of_a_window_are_cut_at_its_ends() {
        let periods = row_periods(period("2000-01-16", "2000-03-02"), BudgetStep::Month).unwrap();
        let expected = [
            ("2000-01-16", "2000-02-01"),
            ("2000-02-01", "2000-03-01"),
            ("2000-03-01", "2000-03-02"),
        ];
        assert_eq!(periods, expected.map(|(start, end)| period(start, end)));
        let years = row_periods(period("1999-12-31", "2001-01-01"), BudgetStep::Year).unwrap();
        assert_eq!(
            years,
            [
                period("1999-12-31", "2000-01-01"),
                period("2000-01-01", "2001-01-01")
            ]
        );
    }

    #[test]
    fn a_step_partly_inside_counts_by_its_share_of_time() {
        let sums = [month(1, 310), month(2, 290)];
        let rows = rows(&[period("2000-01-31", "2000-02-11")], &sums, 100.0).unwrap();
        assert_eq!(rows[0].budget_kg, "110.000000000"); // 1 of 31 days of 310 and 10 of 29 days of 290
        assert!((rows[0].area_m2 - 50.0).abs() < 1e-9);
        assert!((rows[0].coverage_percent - 50.0).abs() < 1e-9);
    }

    #[test]
    fn time_without_steps_lowers_the_coverage() {
        let sums = [month(1, 310)];
        let rows = rows(&[period("2000-01-01", "2000-03-03")], &sums, 100.0).unwrap(); // 31 of 62 days
        assert!((rows[0].coverage_percent - 25.0).abs() < 1e-9);
        assert!((rows[0].area_m2 - 50.0).abs() < 1e-9);
    }

    #[test]
    fn a_period_no_step_reaches_into_has_no_row() {
        let periods = [
            period("1999-01-01", "2000-01-01"),
            period("2000-02-01", "2000-03-01"),
        ];
        assert!(rows(&periods, &[month(1, 1)], 1.0).unwrap().is_empty());
    }

    #[test]
    fn shares_of_a_step_make_the_step() {
        let sums = [month(1, 1)];
        let days: Vec<_> = (1..=30)
            .map(|d| period(&format!("2000-01-{d:02}"), &format!("2000-01-{:02}", d + 1)))
            .chain([period("2000-01-31", "2000-02-01")])
            .collect();
        let sum: f64 = rows(&days, &sums, 1.0)
            .unwrap()
            .iter()
            .map(|row| row.budget_tg)
            .sum();
        assert!((sum * KG_PER_TG - 1.0).abs() < 1e-7);
    }
}
