//! The plan: what of a product's derived things is missing or stale, from listings and manifests alone.

use std::collections::BTreeSet;

use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{Manifest, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use futures::future::BoxFuture;
use storage::{Store, manifests, verify};

use super::{Item, Plan, Reason, Request, What};
use crate::budget::named::{self, Touching};
use crate::budget::{Measure, sums};
use crate::derive::{chosen_start, made_of};
use crate::summed::check_summed;
use crate::{ComputeError, catalogue};

/// What a request comes to. Nothing is written.
pub fn plan<'a>(
    store: &'a Store,
    request: &'a Request,
) -> BoxFuture<'a, Result<Plan, ComputeError>> {
    Box::pin(async move {
        let manifest = catalogue::product(store, &request.product).await?;
        let (window, _steps) = manifest.steps_inside(request.from, request.to)?;
        let mut plan = Plan {
            manifest: manifest.id(),
            items: vec![],
            fresh_count: 0,
            start: None,
            anew_from: None,
            is_forced: request.is_forced,
        };
        let kinds: BTreeSet<What> = request.what.iter().copied().collect();
        for what in kinds {
            match what {
                What::Fields => fields(store, &manifest, window, request, &mut plan).await?,
                // Their means are made of sums in steps of their own values, which are not stored.
                What::Statistics if matches!(manifest.quantity, Quantity::Open(_)) => {}
                What::Statistics => tables(store, &manifest, what, request, &mut plan).await?,
                What::Budget if manifest.quantity == Quantity::CarbonFlux => {
                    check_summed(store, &manifest).await?;
                    tables(store, &manifest, what, request, &mut plan).await?;
                }
                What::Budget => {
                    return Err(ComputeError::NotAFlux {
                        product: manifest.product,
                        quantity: manifest.quantity,
                    });
                }
            }
        }
        Ok(plan)
    })
}

/// Accumulated fields of the period and, as they follow from these, all after it.
async fn fields(
    store: &Store,
    source: &Manifest,
    window: Period,
    request: &Request,
    plan: &mut Plan,
) -> Result<(), ComputeError> {
    if source.quantity != Quantity::CarbonFlux {
        return Err(ComputeError::NotAFlux {
            product: source.product.clone(),
            quantity: source.quantity,
        });
    }
    check_summed(store, source).await?;
    plan.start = chosen_start(store, &source.product).await?;
    let target = source.product.accumulated()?;
    let latest = manifests::latest(store, &target).await?;
    let there = fields_there(store, latest.as_ref(), &target, request).await?;
    let mut is_broken = false;
    for (index, (period, input)) in made_of(source, plan.start)?.into_iter().enumerate() {
        let stored = latest.as_ref().and_then(|latest| latest.steps.get(index));
        let reason = match stored {
            None => Some(Reason::Missing),
            Some(step) if step.raw_sha256 != input => Some(Reason::Stale),
            Some(step) if !is_whole(step, &there) => Some(Reason::Missing),
            Some(_) if is_broken => Some(Reason::Stale),
            Some(_) if request.is_forced && period.overlaps(window) => Some(Reason::Forced),
            Some(_) => None,
        };
        match reason {
            // What is whole before the asked period is left alone; what comes after a hole is not.
            Some(reason) if is_broken || period.end > window.start => {
                is_broken |= reason != Reason::Forced;
                if stored.is_some() && reason != Reason::Stale {
                    plan.anew_from.get_or_insert(period.start);
                }
                plan.items.push(Item {
                    what: What::Fields,
                    product: target.clone(),
                    region: None,
                    period,
                    reason,
                    input,
                    measure: None,
                });
            }
            _ => plan.fresh_count += 1,
        }
    }
    Ok(())
}

/// Are the objects of an accumulated step there?
fn is_whole(step: &Step, there: &BTreeSet<ObjectKey>) -> bool {
    let counts = step.contributed.as_ref();
    there.contains(&step.field) && counts.is_some_and(|counts| there.contains(&counts.counts))
}

/// Fields, and counts of what contributed to them, that are there, and whole as far as that is asked for. Fields without
/// their domain count as gone: it is made with them.
async fn fields_there(
    store: &Store,
    latest: Option<&Manifest>,
    target: &ProductId,
    request: &Request,
) -> Result<BTreeSet<ObjectKey>, ComputeError> {
    let mut there = verify::own_there(store, target).await?;
    let Some(latest) = latest else {
        return Ok(there);
    };
    if request.is_verified {
        let damaged = verify::damaged(store, verify::own_of(latest).cloned()).await?;
        there.retain(|own| !damaged.contains(own));
    }
    if !there.contains(&latest.domain) {
        for step in &latest.steps {
            there.remove(&step.field);
        }
    }
    Ok(there)
}

/// Stored sums of the named regions that touch the grid.
async fn tables(
    store: &Store,
    manifest: &Manifest,
    what: What,
    request: &Request,
    plan: &mut Plan,
) -> Result<(), ComputeError> {
    let measure = if what == What::Budget {
        Measure::Mass
    } else {
        Measure::Mean
    };
    let Some(period) = manifest.extent() else {
        return Ok(());
    };
    let folder = format!("{}/{}", Kind::Sums.folder(), manifest.product);
    let mut there: BTreeSet<ObjectKey> = store.list(&folder).await?.into_iter().collect();
    let mut damaged = BTreeSet::new();
    if request.is_verified {
        damaged = verify::damaged(store, there.iter().cloned()).await?;
        there.retain(|table| !damaged.contains(table));
    }
    for Touching { name, weights } in named::touching(store, &manifest.grid).await? {
        let key = sums::key(&manifest.id(), &weights, measure);
        let reason = if damaged.contains(&key) {
            Reason::Missing
        } else if !there.contains(&key) {
            // A new version has no sums of its own yet, the first one never had any.
            if manifest.number > 1 && !there.is_empty() {
                Reason::Stale
            } else {
                Reason::Missing
            }
        } else if plan.is_forced {
            Reason::Forced
        } else {
            plan.fresh_count += 1;
            continue;
        };
        plan.items.push(Item {
            what,
            product: manifest.product.clone(),
            region: Some(name.to_owned()),
            period,
            reason,
            input: sums::input(&manifest.id(), &weights, measure),
            measure: Some(measure),
        });
    }
    Ok(())
}
