//! A budget as it is asked for: that of its region, and what is held against it: rivers, and parts.

use contract::budget::{BudgetAnswer, BudgetQuery};
use contract::manifest::Manifest;

use super::of_region::of_region;
use super::parts;
use super::river;
use crate::{ComputeError, Engine, catalogue};

/// Computes a budget.
pub async fn budget(engine: &Engine, query: &BudgetQuery) -> Result<BudgetAnswer, ComputeError> {
    let manifest = catalogue::product(engine.store(), &query.product).await?;
    budget_of(engine, query, &manifest).await
}

/// Computes a budget of one version of a product. That of accumulated carbon is that of the flux which it was accumulated
/// from, from where accumulation starts on.
pub async fn budget_of(
    engine: &Engine,
    query: &BudgetQuery,
    manifest: &Manifest,
) -> Result<BudgetAnswer, ComputeError> {
    let mut answer = of_region(engine, query, manifest).await?;
    if let Some(asked) = &query.river {
        let river = river::River::of(engine, query, asked, &answer.rows).await?;
        river.take_off(&mut answer.rows);
        answer.river = Some(river.basis);
    }
    if let Some(asked) = &query.parts {
        parts::add(engine, query, manifest, asked, &mut answer).await?;
    }
    Ok(answer)
}
