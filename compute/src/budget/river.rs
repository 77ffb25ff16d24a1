//! The budget less what rivers bring: outgassing of their carbon, as a number a year or summed from a product.

use contract::ContractError;
use contract::budget::{
    AskedRiver, BudgetAnswer, BudgetQuery, BudgetRow, RiverFlux, RowRiver, StatedRiver,
};
use contract::manifest::Manifest;
use contract::quantity::{Quantity, SECONDS_PER_YEAR};
use contract::time::Period;

use super::measure::Measure;
use super::over_region::{AskedArea, over_region};
use super::rows::{RegionAreas, rows};
use crate::summed::check_summed;
use crate::{ComputeError, Engine};

const MEANING: &str = "anthropogenic_tg is the budget less river_tg, the outgassing of carbon that rivers bring, positive out of the \
                       sea, over all of a row's time, also where the budget has gaps";

/// From where on a coverage is shown as all of it, percent: of one decimal.
const ALL_PERCENT: f64 = 99.95;

/// What is taken off each row.
pub(super) struct River {
    pub(super) basis: RiverFlux,
    /// What of it may surprise, and is not said of the budget.
    pub(super) notes: Vec<String>,
    /// Of each row, Tg.
    of_rows: Vec<f64>,
    /// Standard error of each, Tg; none if none was stated.
    sigmas: Option<Vec<f64>>,
}

impl River {
    /// The river flux of a budget's rows.
    ///
    /// # Errors
    /// A product that is no flux, or does not cover the time of a row.
    pub(super) async fn of(
        engine: &Engine,
        query: &BudgetQuery,
        asked: &AskedRiver,
        budget: &BudgetAnswer,
    ) -> Result<Self, ComputeError> {
        let rows = &budget.rows;
        match (&asked.stated, &asked.of_product) {
            (
                StatedRiver::Rate {
                    tg_per_year,
                    sigma_tg_per_year,
                },
                _,
            ) => Ok(Self::of_rate(asked, *tg_per_year, *sigma_tg_per_year, rows)),
            (StatedRiver::Product(_), Some(manifest)) => {
                Self::of_product(engine, query, manifest, budget).await
            }
            (StatedRiver::Product(product), None) => Err(ComputeError::inconsistent(
                product.as_str(),
                "no version of the river flux was looked up",
            )),
        }
    }

    fn of_rate(asked: &AskedRiver, rate: f64, sigma: Option<f64>, rows: &[BudgetRow]) -> Self {
        let years =
            |row: &BudgetRow| (row.end.ms() - row.start.ms()) as f64 / 1000.0 / SECONDS_PER_YEAR;
        Self {
            basis: RiverFlux {
                source: asked.source.clone().unwrap_or_default(),
                tg_per_year: Some(rate),
                sigma_tg_per_year: sigma,
                manifest: None,
                meaning: MEANING.to_owned(),
            },
            notes: vec![],
            of_rows: rows.iter().map(|row| rate * years(row)).collect(),
            sigmas: sigma.map(|sigma| rows.iter().map(|row| sigma * years(row)).collect()),
        }
    }

    async fn of_product(
        engine: &Engine,
        query: &BudgetQuery,
        manifest: &Manifest,
        budget: &BudgetAnswer,
    ) -> Result<Self, ComputeError> {
        if manifest.quantity != Quantity::CarbonFlux {
            return Err(ComputeError::NotAFlux {
                product: manifest.product.clone(),
                quantity: manifest.quantity,
            });
        }
        check_summed(engine.store(), manifest).await?;
        let of_budget = &budget.rows;
        let (Some(first), Some(last)) = (of_budget.first(), of_budget.last()) else {
            return Err(ComputeError::inconsistent(
                manifest.product.as_str(),
                "no row",
            ));
        };
        if let Some(row) = of_budget.iter().find(|row| !covers(manifest, row)) {
            let covered = manifest
                .extent()
                .map_or("nothing".to_owned(), |own| own.to_string());
            let reason = format!(
                "it does not cover all of {}/{}: it covers {covered}; ask for a period that both have",
                row.start, row.end
            );
            let product = manifest.product.as_str();
            return Err(ContractError::invalid("river flux", product, reason).into());
        }
        let (_, steps) = manifest.steps_inside(Some(first.start), Some(last.end))?;
        let area = AskedArea::of(query);
        let over = over_region(engine, manifest, &steps, area, Measure::Mass).await?;
        let asked = RegionAreas {
            region_area_m2: over.extent.area_m2,
            ocean_area_m2: over.extent.ocean_m2,
            sea_steps: over.sums.sea_steps,
            cells: query.cells,
        };
        // Of the very periods of the budget's rows: native ones are steps of its product, not of this one.
        let periods: Vec<Period> = of_budget.iter().map(period).collect();
        let own = rows(&periods, &over.sums.steps, &asked)
            .filter(|own| own.len() == periods.len())
            .ok_or_else(|| {
                let what = manifest.id().to_string();
                ComputeError::inconsistent(what, "its sums exceed 128 bits")
            })?;
        let mut notes = over.extent.notes;
        // What is said of the region is said once.
        notes.retain(|note| !budget.notes.contains(note));
        notes.extend(beside_data(&own));
        let named = |note: String| format!("river flux {}: {note}", manifest.product);
        Ok(Self {
            of_rows: own.iter().map(|row| row.budget_tg).collect(),
            basis: RiverFlux {
                source: manifest.source.clone(),
                tg_per_year: None,
                sigma_tg_per_year: None,
                manifest: Some(manifest.id()),
                meaning: MEANING.to_owned(),
            },
            notes: notes.into_iter().map(named).collect(),
            sigmas: None,
        })
    }

    /// Takes it off rows.
    pub(super) fn take_off(&self, rows: &mut [BudgetRow]) {
        for (at, row) in rows.iter_mut().enumerate() {
            let river_tg = self.of_rows[at];
            let own = self.sigmas.as_ref().map_or(0.0, |sigmas| sigmas[at]);
            row.river = Some(RowRiver {
                river_tg,
                anthropogenic_tg: row.budget_tg - river_tg,
                sigma_tg: row
                    .uncertainty
                    .map(|of_budget| of_budget.sigma_tg.hypot(own)),
            });
        }
    }
}

fn period(row: &BudgetRow) -> Period {
    Period {
        start: row.start,
        end: row.end,
    }
}

/// What is to be said of rows that do not hold data over all of the region's sea.
fn beside_data(rows: &[BudgetRow]) -> Option<String> {
    let of_sea = rows.iter().filter(|row| row.ocean_area_m2 > 0.0);
    let percents = of_sea.map(|row| row.coverage_percent);
    let (least, most) = (
        percents.clone().reduce(f64::min)?,
        percents.reduce(f64::max)?,
    );
    let (from, to) = (format!("{least:.1}"), format!("{most:.1}"));
    let share = if from == to {
        from
    } else {
        format!("{from} to {to}")
    };
    (least < ALL_PERCENT).then(|| {
        format!(
            "its data cover {share} % of the region's sea: river_tg is of that part, and nothing is taken off for the rest"
        )
    })
}

/// Do steps lie in all of a row's time?
fn covers(manifest: &Manifest, row: &BudgetRow) -> bool {
    let period = period(row);
    let mut until = row.start;
    for step in manifest
        .steps
        .iter()
        .filter(|step| step.period.overlaps(period))
    {
        if step.period.start > until {
            return false;
        }
        until = until.max(step.period.end);
    }
    until >= row.end
}
