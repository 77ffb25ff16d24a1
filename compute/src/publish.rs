//! A version that was made of others in; published under the next free number, its cube brought there.

use std::sync::Arc;

use contract::computed::{Computed, ComputedInput};
use contract::manifest::Manifest;
use contract::product::ProductId;
use cube::AtHand;
use storage::{StorageError, manifests};

use crate::made_from::is_from_newer;
use crate::{ComputeError, Engine};

/// How often it is tried again when another writer takes the number.
const ATTEMPTS: u32 = 5;

/// Does the newest version of a product, if there is one, still ask for what is about to be published? Of who makes a product again
/// because of what it is made of; whoever asks himself decides how it is made.
pub(crate) type IsStillAsked<'a> = dyn Fn(Option<&Manifest>) -> bool + Send + Sync + 'a;

/// How often something is made again that was asked for otherwise while it was made.
pub(crate) const MADE_AGAIN: usize = 5;

/// Publishes a version, unless another writer published the same meanwhile, or one of newer versions of what it is made from. `at_hand` are its values,
/// of which its cube is then made.
///
/// # Errors
/// `AskedOtherwise`, with nothing published: it is not asked for any more; or what is there is of newer versions and made in another way, so that
/// neither can take the other's place, and it is to be made again of those.
pub(crate) async fn publish_if(
    engine: &Engine,
    mut made: Manifest,
    at_hand: Option<Arc<dyn AtHand>>,
    is_still_asked: Option<&IsStillAsked<'_>>,
) -> Result<Manifest, ComputeError> {
    let mut attempt = 1;
    loop {
        let latest = manifests::latest(engine.store(), &made.product).await?;
        check_asked((&made.product, latest.as_ref()), is_still_asked)?;
        if let Some(latest) = &latest {
            manifests::settle(engine.store(), latest, &mut made).await?;
        }
        let number = latest.as_ref().map_or(1, |latest| latest.number + 1);
        if let Some(latest) = latest {
            let is_newer = is_from_newer(&latest, &made);
            if is_newer && !is_asked_alike(&latest, &made) {
                return Err(asked_otherwise(&made.product));
            }
            if is_newer || is_same(&latest, &made) {
                cube::keep_up(engine.store(), &latest).await;
                return Ok(latest);
            }
        }
        let manifest = Manifest {
            number,
            ..made.clone()
        };
        match manifests::commit(engine.store(), &manifest).await {
            Ok(version) => {
                cube::keep_up_with(engine.store(), &manifest, &version, at_hand).await;
                return Ok(manifest);
            }
            Err(StorageError::Conflict { .. }) if attempt < ATTEMPTS => attempt += 1,
            Err(e) => return Err(e.into()),
        }
    }
}

/// # Errors
/// `AskedOtherwise` where the newest version of a product asks for something else, or is gone.
pub(crate) fn check_asked(
    (product, latest): (&ProductId, Option<&Manifest>),
    is_still_asked: Option<&IsStillAsked<'_>>,
) -> Result<(), ComputeError> {
    if is_still_asked.is_none_or(|is_still_asked| is_still_asked(latest)) {
        return Ok(());
    }
    Err(asked_otherwise(product))
}

fn asked_otherwise(product: &ProductId) -> ComputeError {
    ComputeError::AskedOtherwise {
        product: product.clone(),
    }
}

/// Is it what was made?
fn is_same(latest: &Manifest, made: &Manifest) -> bool {
    let same = Manifest {
        number: latest.number,
        schema: latest.schema,
        ..made.clone()
    };
    *latest == same
}

/// Are two made in the same way, whichever the versions are that they are made of?
fn is_asked_alike(one: &Manifest, other: &Manifest) -> bool {
    match (&one.computed, &other.computed) {
        // Carbon is accumulated from a start on.
        (None, None) => one.accumulated_since() == other.accumulated_since(),
        (Some(own), Some(others)) => {
            let inputs = |of: &Computed| {
                let named = |it: &ComputedInput| {
                    (it.name.clone(), it.manifest.product.clone(), it.matching)
                };
                of.inputs.iter().map(named).collect::<Vec<_>>()
            };
            own.how == others.how
                && (own.from, own.to) == (others.from, others.to)
                && own.map == others.map
                && inputs(own) == inputs(others)
                && (!own.how.is_by_step() || is_same_thing(one, other))
        }
        _ => false,
    }
}

/// What is computed step by step is asked for with a title and a quantity, which statistics have of their sources.
fn is_same_thing(one: &Manifest, other: &Manifest) -> bool {
    one.title == other.title && one.quantity.is_same_kind(other.quantity)
}
