//! Products computed from others: a product of fluxes in, a product of the carbon given off since a chosen start out; any
//! product in, a statistic of each of its cells out; two in, how they go together in each cell out.

mod at_cell;
mod carried;
mod derivation;
pub(crate) mod exact;
mod prior;
mod source;
mod statistic;
mod steps;
mod with_data;

use contract::digest::Digest;
use contract::event::Body;
use contract::manifest::{Manifest, ManifestId, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use futures::future::BoxFuture;
use storage::{Store, manifests, verify};

use crate::publish::{IsStillAsked, MADE_AGAIN, check_asked, publish_if};
use crate::summed::check_summed;
use crate::workshop::Workshop;
use crate::{ComputeError, Engine, catalogue};
pub(crate) use at_cell::counts_at_cell;
use derivation::Derivation;
use source::{SourceStep, steps_since};
pub(crate) use statistic::{StatisticRequest, derive_statistics_if};
pub use statistic::{derive_statistic, derive_statistics};

/// The version of a flux that accumulated carbon was summed up from; none of all else, nor of statistics of accumulated carbon, some of
/// which have its quantity.
pub(crate) fn accumulated_from(manifest: &Manifest) -> Option<&ManifestId> {
    let from = manifest.derived_from.as_ref()?;
    let is_sum = from
        .product
        .accumulated()
        .is_ok_and(|name| name == manifest.product);
    (is_sum && manifest.quantity == Quantity::AccumulatedCarbon).then_some(from)
}

/// How far a derivation has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeriveProgress {
    /// Steps stored.
    pub done_steps: usize,
    /// Steps in all.
    pub all_steps: usize,
}

/// Who is told of it.
pub type Progress<'a> = dyn Fn(DeriveProgress) + Send + Sync + 'a;

/// Derives the product of a flux product's accumulated carbon, kg m⁻², from `start` (the product's own if absent) on.
///
/// A step's values hold at its end. A gap in time leaves a cell as it was, and before its first data at 0; a cell without data in any step
/// from `start` on holds none.
/// If the newest version was derived from the same version of the source and the same start, it is returned as it is;
/// else only the steps from the first changed one on are computed.
/// [`derived`] is the event to tell of it, after the manifest.
pub fn derive_accumulated<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    start: Option<TimeMs>,
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Manifest, ComputeError>> {
    Box::pin(async move {
        for _ in 1..MADE_AGAIN {
            match derive_accumulated_if(engine, product, start, None, progress).await {
                // It was brought up to date meanwhile, from the start that it had before.
                Err(ComputeError::AskedOtherwise { .. }) => {}
                derived => return derived,
            }
        }
        derive_accumulated_if(engine, product, start, None, progress).await
    })
}

/// The same, published only if the newest version still asks for it.
///
/// # Errors
/// As there; `AskedOtherwise`, with nothing published.
pub(crate) fn derive_accumulated_if<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    start: Option<TimeMs>,
    is_still_asked: Option<&'a IsStillAsked<'a>>,
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Manifest, ComputeError>> {
    Box::pin(async move {
        let source = flux(engine.store(), product).await?;
        let steps = steps_since(&source, start)?;
        let target = product.accumulated()?;
        let latest = manifests::latest(engine.store(), &target).await?;
        check_asked((&target, latest.as_ref()), is_still_asked)?;
        let latest = match latest {
            Some(latest) => what_is_there(engine.store(), latest).await?,
            None => None,
        };
        let asked = Asked::of(start, &steps);
        if let Some(latest) = latest
            .as_ref()
            .filter(|latest| is_up_to_date(latest, &source, asked))
        {
            progress(of_all(steps.len(), &steps));
            // Whoever published it may have been killed before the cube followed.
            cube::keep_up(engine.store(), latest).await;
            return Ok(latest.clone());
        }
        let of = (&source, asked);
        derive(engine, of, latest.as_ref(), is_still_asked, progress).await
    })
}

/// A version up to the first step whose field or counts are gone; none of one without its domain.
async fn what_is_there(
    store: &Store,
    mut latest: Manifest,
) -> Result<Option<Manifest>, ComputeError> {
    let there = verify::own_there(store, &latest.product).await?;
    let is_there = |step: &Step| {
        let counts = step.contributed.as_ref().map(|of| &of.counts);
        there.contains(&step.field) && counts.is_none_or(|counts| there.contains(counts))
    };
    let count = latest
        .steps
        .iter()
        .take_while(|step| is_there(step))
        .count();
    latest.steps.truncate(count);
    Ok(there.contains(&latest.domain).then_some(latest))
}

/// [`derive_accumulated`] with every step that ends after `from` computed anew, whatever is stored. If what comes out is what is
/// stored, no new version is made of it.
pub fn derive_anew<'a>(
    engine: &'a Engine,
    product: &'a ProductId,
    start: Option<TimeMs>,
    from: TimeMs,
    progress: &'a Progress<'a>,
) -> BoxFuture<'a, Result<Manifest, ComputeError>> {
    Box::pin(async move {
        let source = flux(engine.store(), product).await?;
        let steps = steps_since(&source, start)?;
        let latest = manifests::latest(engine.store(), &product.accumulated()?).await?;
        let trusted = latest.map(|mut latest| {
            latest.steps.retain(|step| step.period.end <= from);
            latest
        });
        let of = (&source, Asked::of(start, &steps));
        derive(engine, of, trusted.as_ref(), None, progress).await
    })
}

/// What is accumulated.
#[derive(Clone, Copy)]
struct Asked<'a> {
    steps: &'a [SourceStep<'a>],
    /// Where it is to begin, if that lies before the first step, in a gap or before all that landed.
    since: Option<TimeMs>,
}

impl<'a> Asked<'a> {
    fn of(start: Option<TimeMs>, steps: &'a [SourceStep<'a>]) -> Self {
        let first = steps.first().map(|step| step.period.start);
        Self {
            steps,
            since: start.filter(|start| first.is_some_and(|first| *start < first)),
        }
    }
}

async fn derive(
    engine: &Engine,
    (source, asked): (&Manifest, Asked<'_>),
    prior: Option<&Manifest>,
    is_still_asked: Option<&IsStillAsked<'_>>,
    progress: &Progress<'_>,
) -> Result<Manifest, ComputeError> {
    let workshop = Workshop::of(engine.store());
    let of = (engine, workshop);
    let mut derived = accumulated(of, source, asked.steps, prior, progress).await?;
    let first = derived.steps.first_mut();
    if let Some(contributed) = first.and_then(|step| step.contributed.as_mut()) {
        contributed.since = asked.since;
    }
    publish_if(engine, derived, None, is_still_asked).await
}

/// Computes and stores everything but the manifest, which is returned with number 0.
async fn accumulated(
    on: (&Engine, Workshop<'_>),
    source: &Manifest,
    steps: &[SourceStep<'_>],
    prior: Option<&Manifest>,
    progress: &Progress<'_>,
) -> Result<Manifest, ComputeError> {
    let target = source.product.accumulated()?;
    let derivation = Derivation::begin(on, source, &target, steps, prior).await?;
    derivation.finish(progress).await
}

/// The newest version of a product that is a flux of carbon.
async fn flux(store: &Store, product: &ProductId) -> Result<Manifest, ComputeError> {
    let source = catalogue::product(store, product).await?;
    if source.quantity == Quantity::CarbonFlux {
        check_summed(store, &source).await?;
        Ok(source)
    } else {
        Err(ComputeError::NotAFlux {
            product: product.clone(),
            quantity: source.quantity,
        })
    }
}

/// The start that somebody chose for a product's accumulated carbon; none if it begins with its source, or is not there.
///
/// A chosen start is one that is not where the source began when it was derived from it. One that lay in a gap stays what it was.
pub fn chosen_start<'a>(
    store: &'a Store,
    product: &'a ProductId,
) -> BoxFuture<'a, Result<Option<TimeMs>, ComputeError>> {
    Box::pin(async move {
        let Some(latest) = manifests::latest(store, &product.accumulated()?).await? else {
            return Ok(None);
        };
        let (Some(first), Some(source)) = (latest.steps.first(), &latest.derived_from) else {
            return Ok(None);
        };
        if let Some(since) = first.contributed.as_ref().and_then(|it| it.since) {
            return Ok(Some(since));
        }
        let source = match manifests::load(store, source).await {
            Ok(source) => source,
            // That version is gone: nobody can tell any more.
            Err(e) if e.is_not_found() => return Ok(None),
            Err(e) => return Err(e.into()),
        };
        let start = first.period.start;
        let is_own = source
            .steps
            .first()
            .is_some_and(|step| step.period.start == start);
        Ok((!is_own).then_some(start))
    })
}

/// Every step of a product's accumulated carbon and the hash of what it would be made of now.
pub(crate) fn made_of(
    source: &Manifest,
    start: Option<TimeMs>,
) -> Result<Vec<(Period, Digest)>, ComputeError> {
    let steps = steps_since(source, start)?;
    Ok(steps
        .iter()
        .map(|step| (step.period, step.made_of))
        .collect())
}

/// What is told of a derived manifest; nothing if it was not derived.
pub fn derived(manifest: &Manifest) -> Option<Body> {
    Some(Body::ProductDerived {
        manifest: manifest.id(),
        derived_from: manifest.derived_from.clone()?,
    })
}

/// Is the newest version derived from this very version of the source, from the same steps and the same start?
fn is_up_to_date(latest: &Manifest, source: &Manifest, asked: Asked<'_>) -> bool {
    let made_of = latest.steps.iter().map(|step| step.raw_sha256);
    let first = asked.steps.first().map(|step| step.period.start);
    latest.derived_from.as_ref() == Some(&source.id())
        && made_of.eq(asked.steps.iter().map(|step| step.made_of))
        && latest.accumulated_since() == asked.since.or(first)
}

fn of_all(done_steps: usize, steps: &[SourceStep<'_>]) -> DeriveProgress {
    DeriveProgress {
        done_steps,
        all_steps: steps.len(),
    }
}

#[cfg(test)]
mod tests;
