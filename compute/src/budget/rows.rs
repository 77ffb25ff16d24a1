//! Calendar rows of a budget: exact sums of steps in, rows with budget and coverage out.

use contract::budget::BudgetRow;
use contract::region::Cells;
use contract::time::{Period, TimeMs};

use super::bands::{BAND_COUNT, BandSum};
use super::fixed::{AREA_DECIMALS, MASS_DECIMALS, decimal_text, share_between};
use super::gaps::gap;

/// Exact sums of one step over a region.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StepSum {
    /// What the step covers.
    pub period: Period,
    /// Mass that left the sea in the whole step, kg in steps of 10⁻⁹.
    pub mass_steps: i128,
    /// Area that holds data, m² in steps of 10⁻⁶.
    pub area_steps: i128,
    /// The same of the sea alone, by bands of latitude that hold any.
    pub sea: Vec<BandSum>,
}

impl StepSum {
    /// Area of the sea that holds data, m² in steps of 10⁻⁶.
    pub fn sea_area_steps(&self) -> i128 {
        self.sea.iter().map(|sum| sum.area_steps).sum()
    }

    /// Mass and area that count.
    fn counted(&self, cells: Cells) -> (i128, i128) {
        match cells {
            Cells::Whole => (self.mass_steps, self.area_steps),
            Cells::OceanShare => (
                self.sea.iter().map(|sum| sum.mass_steps).sum(),
                self.sea_area_steps(),
            ),
        }
    }
}

/// What sums are set against.
#[derive(Debug, Clone, PartialEq)]
pub struct RegionAreas {
    /// Area of the region, land included, m².
    pub region_area_m2: f64,
    /// Area of the sea in it, wherever the grid lies, m².
    pub ocean_area_m2: f64,
    /// Area of its sea on the grid in every band, m² in steps of 10⁻⁶.
    pub sea_steps: [i128; BAND_COUNT],
    /// How cells on the coast count.
    pub cells: Cells,
}

/// Kilograms in a teragram.
pub const KG_PER_TG: f64 = 1e9;

/// One row of each period that some step reaches into.
///
/// A step that lies partly inside counts by the share of its time; rows that follow each other share it out exactly. None if a sum leaves 128 bits.
pub fn rows(periods: &[Period], sums: &[StepSum], asked: &RegionAreas) -> Option<Vec<BudgetRow>> {
    let mut rows = vec![];
    for &period in periods {
        let first = sums.partition_point(|sum| sum.period.end <= period.start);
        let inside = sums[first..]
            .iter()
            .take_while(|sum| sum.period.start < period.end);
        let mut total = Total::default();
        for sum in inside {
            total.add(sum, period, asked)?;
        }
        if total.covered_ms > 0 {
            rows.push(total.row(period, asked));
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
    /// The same of the sea.
    sea_time: i128,
    gap_kg: f64,
    /// Area of gaps with an estimate x time, m² ms.
    gap_time_m2_ms: f64,
    covered_ms: i64,
}

impl Total {
    fn add(&mut self, sum: &StepSum, row: Period, asked: &RegionAreas) -> Option<()> {
        let start = sum.period.start.max(row.start);
        let end = sum.period.end.min(row.end);
        let inside_ms = end.ms() - start.ms();
        let whole_ms = sum.period.end.ms() - sum.period.start.ms();
        let (mass_steps, area_steps) = sum.counted(asked.cells);
        let since_ms = |time: TimeMs| time.ms() - sum.period.start.ms();
        let inside = share_between(mass_steps, since_ms(start), since_ms(end), whole_ms)?;
        self.mass_steps = self.mass_steps.checked_add(inside)?;
        let of_time = |steps: i128| steps.checked_mul(i128::from(inside_ms));
        self.area_time = self.area_time.checked_add(of_time(area_steps)?)?;
        self.sea_time = self.sea_time.checked_add(of_time(sum.sea_area_steps())?)?;
        let gap = gap(&asked.sea_steps, &sum.sea);
        self.gap_kg += gap.mass_kg * (inside_ms as f64 / whole_ms as f64);
        self.gap_time_m2_ms += gap.area_m2 * inside_ms as f64;
        self.covered_ms += inside_ms;
        Some(())
    }

    fn row(&self, period: Period, asked: &RegionAreas) -> BudgetRow {
        let m2_ms = |steps: i128| steps as f64 / 10f64.powi(AREA_DECIMALS as i32);
        let row_ms = (period.end.ms() - period.start.ms()) as f64;
        let covered_ms = self.covered_ms as f64;
        let ocean_with_data_m2 = m2_ms(self.sea_time) / covered_ms;
        let on_grid_m2 =
            asked.sea_steps.iter().sum::<i128>() as f64 / 10f64.powi(AREA_DECIMALS as i32);
        let has_gaps = on_grid_m2 > ocean_with_data_m2 * (1.0 + f64::EPSILON * 8.0);
        BudgetRow {
            start: period.start,
            end: period.end,
            budget_kg: decimal_text(self.mass_steps, MASS_DECIMALS),
            budget_tg: self.mass_steps as f64 / 10f64.powi(MASS_DECIMALS as i32) / KG_PER_TG,
            coverage_percent: coverage_percent(m2_ms(self.sea_time) / row_ms, asked.ocean_area_m2),
            area_m2: m2_ms(self.area_time) / covered_ms,
            region_area_m2: asked.region_area_m2,
            ocean_area_m2: asked.ocean_area_m2,
            ocean_with_data_m2,
            gap_tg: (!has_gaps || self.gap_time_m2_ms > 0.0).then_some(self.gap_kg / KG_PER_TG),
            gap_area_m2: self.gap_time_m2_ms / covered_ms,
            completeness: None,
            uncertainty: None,
            river: None,
        }
    }
}

/// Share of the sea that holds data, percent; 0 where there is no sea. Cells and the whole sea are rounded apart, so that
/// a full region could come out a hair above.
pub fn coverage_percent(with_data_m2: f64, ocean_area_m2: f64) -> f64 {
    if ocean_area_m2 > 0.0 {
        (100.0 * with_data_m2 / ocean_area_m2).min(100.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A region of 200 m², half of it sea in one band.
    fn asked(cells: Cells) -> RegionAreas {
        let mut sea_steps = [0; BAND_COUNT];
        sea_steps[20] = 100_000_000;
        RegionAreas {
            region_area_m2: 200.0,
            ocean_area_m2: 100.0,
            sea_steps,
            cells,
        }
    }

    fn rows(periods: &[Period], sums: &[StepSum]) -> Option<Vec<BudgetRow>> {
        super::rows(periods, sums, &asked(Cells::Whole))
    }

    fn period(start: &str, end: &str) -> Period {
        Period::new(start.parse().unwrap(), end.parse().unwrap()).unwrap()
    }

    fn month(month: u32, mass_kg: i128) -> StepSum {
        let scale = 10i128.pow(MASS_DECIMALS);
        StepSum {
            period: Period::month(2000, month).unwrap(),
            mass_steps: mass_kg * scale,
            area_steps: 60_000_000,
            sea: vec![BandSum {
                band: 20,
                mass_steps: mass_kg * scale / 2,
                area_steps: 50_000_000,
            }],
        }
    }

    #[test]
    fn a_step_partly_inside_counts_by_its_share_of_time() {
        let sums = [month(1, 310), month(2, 290)];
        let rows = rows(&[period("2000-01-31", "2000-02-11")], &sums).unwrap();
        assert_eq!(rows[0].budget_kg, "110.000000000"); // 1 of 31 days of 310 and 10 of 29 days of 290
        assert!((rows[0].area_m2 - 60.0).abs() < 1e-9);
        assert!((rows[0].coverage_percent - 50.0).abs() < 1e-9);
    }

    #[test]
    fn time_without_steps_lowers_the_coverage() {
        let sums = [month(1, 310)];
        let rows = rows(&[period("2000-01-01", "2000-03-03")], &sums).unwrap(); // 31 of 62 days
        assert!((rows[0].coverage_percent - 25.0).abs() < 1e-9);
        assert!((rows[0].area_m2 - 60.0).abs() < 1e-9);
    }

    #[test]
    fn a_period_no_step_reaches_into_has_no_row() {
        let periods = [
            period("1999-01-01", "2000-01-01"),
            period("2000-02-01", "2000-03-01"),
        ];
        assert!(rows(&periods, &[month(1, 1)]).unwrap().is_empty());
    }

    #[test]
    fn shares_of_a_step_make_the_step() {
        let sums = [month(1, 1)];
        let days: Vec<_> = (1..=30)
            .map(|d| period(&format!("2000-01-{d:02}"), &format!("2000-01-{:02}", d + 1)))
            .chain([period("2000-01-31", "2000-02-01")])
            .collect();
        let sum: f64 = rows(&days, &sums)
            .unwrap()
            .iter()
            .map(|row| row.budget_tg)
            .sum();
        assert!((sum * KG_PER_TG - 1.0).abs() < 1e-7);
    }

    #[test]
    fn gaps_are_estimated_apart_and_cells_count_as_asked() {
        let (sums, period) = ([month(1, 310)], period("2000-01-01", "2000-02-01"));
        let of = |cells| {
            super::rows(&[period], &sums, &asked(cells))
                .unwrap()
                .remove(0)
        };
        let (whole, share) = (of(Cells::Whole), of(Cells::OceanShare));
        assert_eq!(whole.budget_kg, "310.000000000");
        assert_eq!(share.budget_kg, "155.000000000");
        assert_eq!((whole.area_m2, share.area_m2), (60.0, 50.0));
        for row in [whole, share] {
            assert_eq!((row.region_area_m2, row.ocean_area_m2), (200.0, 100.0));
            assert_eq!((row.ocean_with_data_m2, row.coverage_percent), (50.0, 50.0));
            // As much sea is missing as holds 155 kg.
            assert!((row.gap_tg.unwrap() * KG_PER_TG - 155.0).abs() < 1e-9);
            assert!((row.gap_area_m2 - 50.0).abs() < 1e-9);
        }
    }

    #[test]
    fn gaps_beside_nothing_have_no_estimate_and_no_gaps_are_nothing() {
        let period = period("2000-01-01", "2000-02-01");
        let row = |sea| {
            let sum = StepSum {
                sea,
                ..month(1, 310)
            };
            rows(&[period], &[sum]).unwrap().remove(0)
        };
        assert_eq!(row(vec![]).gap_tg, None);
        let full = BandSum {
            band: 20,
            mass_steps: 7,
            area_steps: 100_000_000,
        };
        assert_eq!(row(vec![full]).gap_tg, Some(0.0));
    }
}
