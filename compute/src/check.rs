//! Our budgets beside the published ones: what a demonstration prints and what it is held to.

use contract::budget::{BudgetQuery, BudgetRow};
use contract::check::{AgainstPaper, CheckRow, Stated, Verdict};
use contract::earth::Earth;
use contract::product::ProductId;
use contract::region::{Cells, NamedRegion};
use contract::time::TimeStep;
use futures::future::BoxFuture;
use futures::future::{try_join, try_join_all};

use crate::published::{ANNUAL, Annual, INTEGRALS};
use crate::{ComputeError, Engine, budget};

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

/// How far our integral of a grid may be from the independent one, as a share: what rounding of its kept digits and of
/// stored fluxes (f32) to either side leaves open.
const AGREEMENT: f64 = 1e-6;

fn against(stated: Stated, ours: f64) -> AgainstPaper {
    let difference = ours - stated.value;
    let verdict = match stated.uncertainty {
        None => Verdict::NoUncertaintyStated,
        Some(uncertainty) if difference.abs() <= uncertainty => Verdict::Within,
        Some(_) => Verdict::Outside,
    };
    AgainstPaper {
        stated,
        difference,
        verdict,
    }
}

/// Compares the budgets of a product that holds the Takahashi et al. (2009) fluxes with the published ones.
pub fn compare<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
) -> BoxFuture<'a, Result<Vec<CheckRow>, ComputeError>> {
    Box::pin(async move {
        let annual = try_join_all(
            ANNUAL
                .iter()
                .map(|entry| annual_row(engine, product, entry)),
        );
        let (mut rows, months) = try_join(annual, monthly_rows(engine, product)).await?;
        rows.extend(months);
        Ok(rows)
    })
}

async fn annual_row(
    engine: &Engine,
    product: &ProductId,
    entry: &Annual,
) -> Result<CheckRow, ComputeError> {
    let query = query(product, entry.region, TimeStep::Total, entry.earth)?;
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
    let independent = INTEGRALS
        .year_pg(entry.region, entry.earth)
        .expect("every printed value has its integral");
    let line = Line {
        what,
        period: year.to_string(),
        paper: Some(entry.paper),
        unit: "Pg C",
    };
    Ok(line.row(independent, row.budget_tg / TG_PER_PG))
}

async fn monthly_rows(engine: &Engine, product: &ProductId) -> Result<Vec<CheckRow>, ComputeError> {
    let answer = budget(
        engine,
        &query(product, "global", TimeStep::Month, Earth::Wgs84)?,
    )
    .await?;
    if answer.rows.len() != MONTHS.len() {
        return Err(unlike_the_published(
            product,
            "it does not cover twelve months",
        ));
    }
    let month = |(row, (independent, name)): (&BudgetRow, (&f64, &str))| {
        let (year, _) = row.start.year_month();
        let line = Line {
            what: "Global ocean".to_owned(),
            period: format!("{name} {year}"),
            paper: None,
            unit: "Tg C",
        };
        line.row(*independent, row.budget_tg)
    };
    Ok(answer
        .rows
        .iter()
        .zip(INTEGRALS.months_tg.iter().zip(MONTHS))
        .map(month)
        .collect())
}

fn query(
    product: &ProductId,
    name: &str,
    step: TimeStep,
    earth: Earth,
) -> Result<BudgetQuery, ComputeError> {
    Ok(BudgetQuery {
        step,
        earth,
        // As the authors of the 1-degree grids integrate them: no cell is cut at the coast.
        cells: Cells::Whole,
        ..BudgetQuery::new(product.clone(), name.parse()?)
    })
}

fn unlike_the_published(product: &ProductId, reason: &str) -> ComputeError {
    ComputeError::inconsistent(format!("{product} with the published year"), reason)
}

/// What a line is about.
struct Line {
    what: String,
    period: String,
    paper: Option<Stated>,
    unit: &'static str,
}

impl Line {
    fn row(self, independent: f64, ours: f64) -> CheckRow {
        let difference = ours - independent;
        CheckRow {
            what: self.what,
            period: self.period,
            unit: self.unit.to_owned(),
            paper: self.paper.map(|stated| against(stated, ours)),
            independent,
            ours,
            difference,
            agrees: difference.abs() <= AGREEMENT * independent.abs(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(uncertainty: Option<f64>, ours: f64) -> CheckRow {
        let stated = Stated {
            value: -1.4,
            decimals: 1,
            uncertainty,
        };
        let line = Line {
            what: String::new(),
            period: String::new(),
            paper: Some(stated),
            unit: "Pg C",
        };
        line.row(-1.404272, ours)
    }

    #[test]
    fn ours_agrees_with_the_independent_integral_or_is_said_not_to() {
        assert!(row(None, -1.404273).agrees);
        assert!(!row(None, -1.40428).agrees);
        assert!(!row(None, f64::NAN).agrees);
    }

    #[test]
    fn only_a_stated_uncertainty_says_that_a_value_lies_within() {
        let verdict = |uncertainty, ours| row(uncertainty, ours).paper.unwrap().verdict;
        assert_eq!(verdict(Some(0.7), -1.404), Verdict::Within);
        assert_eq!(verdict(Some(0.7), -2.3), Verdict::Outside);
        assert_eq!(verdict(Some(0.7), f64::NAN), Verdict::Outside);
        assert_eq!(verdict(None, -1.4), Verdict::NoUncertaintyStated);
    }
}
