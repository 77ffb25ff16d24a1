//! The budget less what rivers bring: outgassing of their carbon, as a number a year or summed from a product.

use contract::budget::{AskedRiver, BudgetQuery, BudgetRow, RiverFlux, RowRiver, StatedRiver};
use contract::manifest::Manifest;
use contract::quantity::{Quantity, SECONDS_PER_YEAR};
use contract::time::Period;

use super::of_region::of_region;
use crate::summed::check_summed;
use crate::{ComputeError, Engine};

const MEANING: &str = "anthropogenic_tg is the budget less river_tg, the outgassing of carbon that rivers bring, positive out of the \
                       sea, over all of a row's time, also where the budget has gaps";

/// What is taken off each row.
pub(super) struct River {
    pub(super) basis: RiverFlux,
    /// Of each row, Tg.
    of_rows: Vec<f64>,
    /// Standard error of each, Tg; none if none was stated.
    sigmas: Option<Vec<f64>>,
}

impl River {
    /// The river flux of some rows.
    ///
    /// # Errors
    /// A product that is no flux, or does not cover the time of a row.
    pub(super) async fn of(
        engine: &Engine,
        query: &BudgetQuery,
        asked: &AskedRiver,
        rows: &[BudgetRow],
    ) -> Result<Self, ComputeError> {
        match (&asked.stated, &asked.of_product) {
            (
                StatedRiver::Rate {
                    tg_per_year,
                    sigma_tg_per_year,
                },
                _,
            ) => Ok(Self::of_rate(asked, *tg_per_year, *sigma_tg_per_year, rows)),
            (StatedRiver::Product(_), Some(manifest)) => {
                Self::of_product(engine, query, manifest, rows).await
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
            of_rows: rows.iter().map(|row| rate * years(row)).collect(),
            sigmas: sigma.map(|sigma| rows.iter().map(|row| sigma * years(row)).collect()),
        }
    }

    async fn of_product(
        engine: &Engine,
        query: &BudgetQuery,
        manifest: &Manifest,
        rows: &[BudgetRow],
    ) -> Result<Self, ComputeError> {
        if manifest.quantity != Quantity::CarbonFlux {
            return Err(ComputeError::NotAFlux {
                product: manifest.product.clone(),
                quantity: manifest.quantity,
            });
        }
        check_summed(engine.store(), manifest).await?;
        let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
            return Err(ComputeError::inconsistent(
                manifest.product.as_str(),
                "no row",
            ));
        };
        for row in rows {
            if !covers(manifest, row) {
                let covered = manifest
                    .extent()
                    .map_or("nothing".to_owned(), |own| own.to_string());
                return Err(ComputeError::Uncertainty {
                    reason: format!(
                        "the river flux {} does not cover all of {}/{}: it covers {covered}; ask for a period that both have",
                        manifest.product, row.start, row.end
                    ),
                });
            }
        }
        let of_rivers = BudgetQuery {
            product: manifest.product.clone(),
            from: Some(first.start),
            to: Some(last.end),
            errors: None,
            river: None,
            parts: None,
            ..query.clone()
        };
        let answer = of_region(engine, &of_rivers, manifest).await?;
        let same = |row: &BudgetRow| {
            let mut own = answer.rows.iter();
            own.find(|own| (own.start, own.end) == (row.start, row.end))
                .map(|own| own.budget_tg)
        };
        let of_rows: Option<Vec<f64>> = rows.iter().map(same).collect();
        Ok(Self {
            of_rows: of_rows.ok_or_else(|| {
                ComputeError::inconsistent(
                    manifest.product.as_str(),
                    "its rows are of other periods",
                )
            })?,
            basis: RiverFlux {
                source: manifest.source.clone(),
                tg_per_year: None,
                sigma_tg_per_year: None,
                manifest: Some(answer.manifest),
                meaning: MEANING.to_owned(),
            },
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

/// Do steps lie in all of a row's time?
fn covers(manifest: &Manifest, row: &BudgetRow) -> bool {
    let period = Period {
        start: row.start,
        end: row.end,
    };
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
