//! A budget as it is asked for: that of its region, and what is held against it: rivers, and parts.

use contract::budget::{BudgetAnswer, BudgetQuery};
use contract::manifest::Manifest;
use futures::future::BoxFuture;

use super::of_region::of_region;
use super::parts;
use super::river;
use crate::{ComputeError, Engine, catalogue};

/// Computes a budget.
pub fn budget<'a>(
    engine: &'a Engine,
    query: &'a BudgetQuery,
) -> BoxFuture<'a, Result<BudgetAnswer, ComputeError>> {
    Box::pin(async move {
        let manifest = catalogue::product(engine.store(), &query.product).await?;
        budget_of(engine, query, &manifest).await
    })
}

/// Computes a budget of one version of a product. That of accumulated carbon is that of the flux which it was accumulated
/// from, from where accumulation starts on.
pub fn budget_of<'a>(
    engine: &'a Engine,
    query: &'a BudgetQuery,
    manifest: &'a Manifest,
) -> BoxFuture<'a, Result<BudgetAnswer, ComputeError>> {
    Box::pin(async move {
        let mut answer = of_region(engine, query, manifest).await?;
        if let Some(asked) = &query.river {
            let river = river::River::of(engine, query, asked, &answer).await?;
            river.take_off(&mut answer.rows);
            answer.notes.extend(river.notes);
            answer.river = Some(river.basis);
        }
        if let Some(asked) = &query.parts {
            parts::add(engine, query, manifest, asked, &mut answer).await?;
        }
        Ok(answer)
    })
}
