//! Our budgets beside the published ones: what a demonstration prints and what it is held to.

use contract::product::ProductId;
use contract::region::{Cells, NamedRegion};
use futures::future::{try_join, try_join_all};
use serde::{Deserialize, Serialize};

use crate::published::{ANNUAL, AnnualBudget, MONTHLY_GRID_TG, MONTHLY_TOLERANCE};
use crate::{BudgetQuery, BudgetStep, ComputeError, Engine, budget};
use contract::earth::Earth;

const TG_PER_PG: f64 = 1000.0;
const MONTHS: [&str; 12] = [
    "January",
    "February",
    "March",
    "April",
    "May",
    "June",
    "July",
    "August",
    "September",
    "October",
    "November",
    "December",
];

/// One line of the comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CheckRow {
    /// Region, and the figure of the earth where it is not WGS84.
    pub what: String,
    /// Year or month.
    pub period: String,
    /// As the paper prints it, if it does.
    pub published: Option<f64>,
    /// Integral of the same grid found outside this program: what ours is held to.
    pub expected: f64,
    /// Ours.
    pub ours: f64,
    /// Unit of the values.
    pub unit: String,
    /// Ours less the expected one.
    pub difference: f64,
    /// Largest difference that is taken.
    pub tolerance: f64,
    /// Is it?
    pub within: bool,
}

/// Compares the budgets of a product that holds the Takahashi et al. (2009) fluxes with the published ones.
pub async fn compare(engine: &Engine, product: &ProductId) -> Result<Vec<CheckRow>, ComputeError> {
    let annual = try_join_all(
        ANNUAL
            .iter()
            .map(|entry| annual_row(engine, product, entry)),
    );
    let (mut rows, months) = try_join(annual, monthly_rows(engine, product)).await?;
    rows.extend(months);
    Ok(rows)
}

async fn annual_row(
    engine: &Engine,
    product: &ProductId,
    entry: &AnnualBudget,
) -> Result<CheckRow, ComputeError> {
    let query = query(product, entry.region, BudgetStep::Total, entry.earth)?;
    let answer = budget(engine, &query).await?;
    let [row] = &answer.rows[..] else {
        return Err(unlike_the_published(product, "no single total"));
    };
    let (year, _) = row.start.year_month();
    let name = NamedRegion::find(entry.region).map_or(entry.region, |named| named.title);
    let what = if entry.earth == Earth::Wgs84 {
        name.to_owned()
    } else {
        format!("{name}, {}", entry.earth)
    };
    let line = Line {
        what,
        period: year.to_string(),
        published: Some(entry.published_pg),
        unit: "Pg C",
    };
    Ok(line.row(entry.grid_pg, row.budget_tg / TG_PER_PG, entry.tolerance_pg))
}

async fn monthly_rows(engine: &Engine, product: &ProductId) -> Result<Vec<CheckRow>, ComputeError> {
    let answer = budget(
        engine,
        &query(product, "global", BudgetStep::Month, Earth::Wgs84)?,
    )
    .await?;
    if answer.rows.len() != MONTHLY_GRID_TG.len() {
        return Err(unlike_the_published(
            product,
            "it does not cover twelve months",
        ));
    }
    let month = |(row, (expected, name)): (&crate::BudgetRow, (&f64, &str))| {
        let (year, _) = row.start.year_month();
        let line = Line {
            what: "Global ocean".to_owned(),
            period: format!("{name} {year}"),
            published: None,
            unit: "Tg C",
        };
        line.row(*expected, row.budget_tg, MONTHLY_TOLERANCE * expected.abs())
    };
    Ok(answer
        .rows
        .iter()
        .zip(MONTHLY_GRID_TG.iter().zip(MONTHS))
        .map(month)
        .collect())
}

fn query(
    product: &ProductId,
    name: &str,
    step: BudgetStep,
    earth: Earth,
) -> Result<BudgetQuery, ComputeError> {
    let (product, region, region_name) = (product.clone(), name.parse()?, name.to_owned());
    Ok(BudgetQuery {
        product,
        region,
        region_name,
        from: None,
        to: None,
        step,
        earth,
        // As the authors of the 1-degree grids integrate them: no cell is cut at the coast.
        cells: Cells::Whole,
    })
}

fn unlike_the_published(product: &ProductId, reason: &str) -> ComputeError {
    ComputeError::inconsistent(format!("{product} with the published year"), reason)
}

/// What a line is about.
struct Line {
    what: String,
    period: String,
    published: Option<f64>,
    unit: &'static str,
}

impl Line {
    fn row(self, expected: f64, ours: f64, tolerance: f64) -> CheckRow {
        let difference = ours - expected;
        CheckRow {
            what: self.what,
            period: self.period,
            published: self.published,
            expected,
            ours,
            unit: self.unit.to_owned(),
            difference,
            tolerance,
            within: difference.abs() <= tolerance,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_within_its_tolerance_or_said_not_to_be() {
        let line = || Line {
            what: String::new(),
            period: String::new(),
            published: None,
            unit: "Pg C",
        };
        assert!(line().row(-1.404, -1.4042, 0.0028).within);
        assert!(!line().row(-1.404, -1.398, 0.0028).within);
        assert!(!line().row(-1.404, f64::NAN, 0.0028).within);
    }
}
