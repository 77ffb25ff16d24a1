//! One budget by every version that changed what it reads.

use std::collections::BTreeMap;

use contract::ContractError;
use contract::budget::{BudgetHistory, BudgetQuery, StatedRiver, VersionBudget};
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs, TimeStep};
use futures::future::BoxFuture;
use storage::manifests;

use super::query::budget_of;
use crate::derive::accumulated_from;
use crate::{ComputeError, Engine, catalogue};

/// Most versions that are looked at, the newest.
const MOST_VERSIONS: usize = 2000;
/// Most that are summed.
const MOST_SUMMED: usize = 200;

const NOTES: [&str; 2] = [
    "a version is dated by when it was written to this store; one that was copied here, by the copy",
    "a mask of land and errors of a product are those of its newest version in all rows",
];

/// What of a version a question reads.
#[derive(Debug, Clone, PartialEq)]
struct Reads {
    grid: Grid,
    quantity: Quantity,
    /// From when on accumulated carbon is summed; none of a flux.
    since: Option<TimeMs>,
    steps: BTreeMap<Period, ObjectKey>,
}

impl Reads {
    /// Of accumulated carbon that is the flux which it was accumulated from, from where accumulation starts on.
    async fn of(
        engine: &Engine,
        query: &BudgetQuery,
        manifest: &Manifest,
    ) -> Result<Self, ComputeError> {
        let source;
        let (manifest, since) = match accumulated_from(manifest) {
            Some(id) => {
                source = manifests::load(engine.store(), id).await?;
                let start = manifest.extent().map(|own| own.start);
                // The later of both; none is before any.
                (&source, start.max(query.from))
            }
            None => (manifest, None),
        };
        let from = since.or(query.from);
        let is_inside = |period: Period| {
            from.is_none_or(|from| period.end > from) && query.to.is_none_or(|to| period.start < to)
        };
        let steps = manifest.steps.iter().filter(|step| is_inside(step.period));
        Ok(Self {
            grid: manifest.grid,
            quantity: manifest.quantity,
            since,
            steps: steps
                .map(|step| (step.period, step.field.clone()))
                .collect(),
        })
    }

    /// Steps that are new, replaced and gone, and the change in words.
    fn change_from(&self, before: Option<&Self>) -> ([u64; 3], String) {
        let Some(before) = before else {
            let count = self.steps.len();
            return ([0; 3], format!("first version that is kept, {count} steps"));
        };
        let mut counts = [0; 3];
        for (period, field) in &self.steps {
            match before.steps.get(period) {
                None => counts[0] += 1,
                Some(old) => counts[1] += u64::from(old != field),
            }
        }
        let is_gone = |period: &&Period| !self.steps.contains_key(*period);
        counts[2] = before.steps.keys().filter(is_gone).count() as u64;
        let mut words: Vec<String> = counts
            .iter()
            .zip(["added", "replaced", "removed"])
            .filter(|(count, _)| **count > 0)
            .map(|(count, what)| format!("{count} steps {what}"))
            .collect();
        if self.grid != before.grid {
            words.push("another grid".to_owned());
        }
        if self.quantity != before.quantity {
            words.push("another quantity".to_owned());
        }
        if let Some(since) = self.since.filter(|_| self.since != before.since) {
            words.push(format!("accumulated from {since}"));
        }
        (counts, words.join(", "))
    }
}

/// # Errors
/// A line of a history has no place for what is asked.
fn check_one_number(query: &BudgetQuery) -> Result<(), ContractError> {
    if query.step != TimeStep::Total || query.parts.is_some() {
        let reason = "a history is of one number: ask for the total of one region";
        return Err(ContractError::invalid("step", query.step.as_str(), reason));
    }
    if let Some(river) = &query.river {
        let reason = "a history takes no rivers off: leave it out, and ask for the budget of a version, or as of a day, for what is left without them";
        let stated = match &river.stated {
            StatedRiver::Rate { tg_per_year, .. } => tg_per_year.to_string(),
            StatedRiver::Product(product) => product.to_string(),
        };
        return Err(ContractError::invalid("river flux", &stated, reason));
    }
    let draws = query.errors.as_ref().and_then(|own| own.monte_carlo);
    if let Some(own) = draws {
        let reason = "a history draws no errors, its standard errors are sums over pairs: leave it out, and ask for the budget of a version, or as of a day, to have it checked by draws";
        let draws = own.draws.to_string();
        return Err(ContractError::invalid("Monte Carlo", &draws, reason));
    }
    Ok(())
}

/// A version without a number holds nothing of the period; what has no number in any version is no history.
///
/// # Errors
/// `UnknownProduct`; `NotAFlux`; `Contract` for a period that ends before it begins.
async fn check_has_budget(engine: &Engine, query: &BudgetQuery) -> Result<(), ComputeError> {
    let newest = catalogue::product(engine.store(), &query.product).await?;
    if let (Some(from), Some(to)) = (query.from, query.to) {
        Period::new(from, to)?;
    }
    match newest.quantity {
        Quantity::CarbonFlux | Quantity::AccumulatedCarbon => Ok(()),
        quantity => Err(ComputeError::NotAFlux {
            product: newest.product,
            quantity,
        }),
    }
}

/// The budget of a question by the versions of its product, oldest first.
///
/// # Errors
/// `UnknownProduct`; `NotAFlux`; `Contract` for a period that ends before it begins, a question of several rows, of rivers or draws, or more
/// versions than are summed at once.
pub fn history<'a>(
    engine: &'a Engine,
    query: &'a BudgetQuery,
) -> BoxFuture<'a, Result<BudgetHistory, ComputeError>> {
    Box::pin(async move {
        check_one_number(query)?;
        check_has_budget(engine, query).await?;
        let published = manifests::published(engine.store(), &query.product).await?;
        let (version_count, skipped) = (
            published.len(),
            published.len().saturating_sub(MOST_VERSIONS),
        );
        let mut notes = NOTES.map(str::to_owned).to_vec();
        if skipped > 0 {
            notes.push(format!("the {skipped} oldest versions were not looked at"));
        }
        if published.windows(2).any(|pair| pair[1].0 != pair[0].0 + 1) {
            notes.push(
                "versions between those that are kept are gone: what they changed is told with the next one that is kept"
                    .to_owned(),
            );
        }
        let (mut versions, mut before) = (vec![], None);
        for (number, at) in published.into_iter().skip(skipped) {
            // Clean-up may have taken it meanwhile.
            let found = manifests::numbered(engine.store(), &query.product, number).await?;
            let Some(manifest) = found else { continue };
            let reads = Reads::of(engine, query, &manifest).await?;
            if before.as_ref() == Some(&reads) {
                continue;
            }
            if versions.len() >= MOST_SUMMED {
                let reason = format!(
                    "more than {MOST_SUMMED} versions changed it; ask for a period in the past (from, to), which fewer changed"
                );
                let name = query.product.as_str();
                return Err(ContractError::invalid("history", name, reason).into());
            }
            let change = reads.change_from(before.as_ref());
            let last = versions
                .iter()
                .rev()
                .find_map(|own: &VersionBudget| own.budget_tg);
            versions.push(version(engine, query, (&manifest, at), change, last).await?);
            before = Some(reads);
        }
        Ok(BudgetHistory {
            product: query.product.clone(),
            region: query.region_name.clone(),
            unit: "Tg C".to_owned(),
            version_count: version_count as u64,
            notes,
            versions,
        })
    })
}

async fn version(
    engine: &Engine,
    query: &BudgetQuery,
    (manifest, published): (&Manifest, TimeMs),
    ([steps_added, steps_replaced, steps_removed], changed): ([u64; 3], String),
    last_tg: Option<f64>,
) -> Result<VersionBudget, ComputeError> {
    // One that holds nothing of the period is a line without a number.
    let row = match query.steps(manifest) {
        Ok(_) => budget_of(engine, query, manifest).await?.rows.pop(),
        Err(_) => None,
    };
    let row = row.as_ref();
    Ok(VersionBudget {
        manifest: manifest.id(),
        published,
        changed,
        steps_added,
        steps_replaced,
        steps_removed,
        start: row.map(|row| row.start),
        end: row.map(|row| row.end),
        budget_kg: row.map(|row| row.budget_kg.clone()),
        budget_tg: row.map(|row| row.budget_tg),
        sigma_tg: row.and_then(|row| Some(row.uncertainty?.sigma_tg)),
        difference_tg: row.and_then(|row| Some(row.budget_tg - last_tg?)),
        coverage_percent: row.map(|row| row.coverage_percent),
    })
}
