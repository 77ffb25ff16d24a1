//! A survey in, a version of the product out: steps read, references durable, then the manifest that names them.

use std::collections::{BTreeMap, BTreeSet};

use contract::chunk::BAND_CELLS;
use contract::event::RejectReason;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use storage::attached::Attachment;
use storage::domain::Cells;
use storage::{StorageError, Store, domain, fields, manifests};

use super::Attached;
use super::kept::{Kept, kept};
use super::reading::Reading;
use super::steps::{self, Put};
use super::survey::Survey;
use crate::commit;
use crate::error::{IngestError, Rejection, Stop};
use crate::pipeline::grids::{left_out, without_values};
use crate::plan::PlannedStep;

/// What the newest version keeps of a survey, once it is known that the product may become it.
async fn kept_of_newest(
    store: &Store,
    survey: &Survey,
    replace: bool,
) -> Result<BTreeMap<u64, Kept>, Stop> {
    let plan = &survey.plan;
    // Before a value is read: what would be refused at the end is refused now.
    let only = (!replace).then_some(&survey.attachment);
    let Some(newest) = newest(store, &plan.target.product, only).await? else {
        return Ok(BTreeMap::new());
    };
    let is_of = (plan.target.quantity, plan.target.synthetic);
    check_fits(&newest, plan.mapping.grid, is_of)?;
    kept(store, &newest, survey).await
}

/// Reads all steps and publishes them as the next version; of a product that is attached to something else only if it may `replace`
/// that.
pub(super) async fn publish(
    store: &Store,
    survey: Survey,
    replace: bool,
    told: &(dyn Fn(usize, usize) + Send + Sync),
) -> Result<Attached, Stop> {
    let product = survey.plan.target.product.clone();
    let kept = kept_of_newest(store, &survey, replace).await?;
    let Survey {
        mut plan,
        attachment,
        place,
        ..
    } = survey;
    let digest = store.put_attachment(&attachment).await;
    let digest = digest.map_err(IngestError::storage("store where the values lie"))?;
    let origin = format!("{place}/{}", attachment.array);
    let put = Put {
        store,
        product: &product,
        attachment: digest,
        origin: &origin,
    };
    let (known, wanted): (Vec<PlannedStep>, Vec<PlannedStep>) = plan
        .steps
        .iter()
        .partition(|step| kept.contains_key(&step.time_index));
    let mut read = steps::read(&mut plan, put, &wanted, told).await?;
    let is_all = kept.is_empty();
    for (planned, kept) in known.iter().zip(kept.into_values()) {
        read.steps
            .push(put.again(planned, plan.mapping.grid, kept).await?);
    }
    if read.steps.is_empty() {
        return Err(without_values(&plan, read.masked).into());
    }
    read.steps.sort_by_key(|step| step.period);
    let told_of_steps = left_out(&plan, &read.steps);
    plan.assumptions.extend(told_of_steps);
    // The way back, before anybody goes it: address, credentials and all that the attachment keeps.
    let first = read_through(store, &read.steps[0].field, &plan.mapping.grid).await;
    first.map_err(IngestError::storage("read an attached step again"))?;
    let next = Next {
        product: &product,
        title: &plan.target.title,
        source: &plan.target.source,
        quantity: over(plan.target.quantity, read.range)?,
        synthetic: plan.target.synthetic,
        grid: plan.mapping.grid,
        only: (!replace).then_some(&attachment),
    };
    let domain = is_all.then_some(&read.domain);
    let (version, is_new) = next_version(store, &next, (&read.steps, domain)).await?;
    Ok(Attached {
        is_new,
        place,
        kind: attachment.kind,
        snapshot: attachment.snapshot.clone(),
        steps: version.steps.len(),
        read: wanted.len(),
        stored_bytes: stored_bytes(store, &version).await?,
        version: version.id(),
        masked: read.masked,
        assumptions: plan.assumptions,
    })
}

/// Reads a field band by band, and compares it with its name.
async fn read_through(store: &Store, field: &ObjectKey, grid: &Grid) -> Result<(), StorageError> {
    let mut bands = fields::bands(store, field, grid, BAND_CELLS).await?;
    while bands.next().await?.is_some() {}
    Ok(())
}

/// The quantity with the range of its values; only open ones keep it.
fn over(quantity: Quantity, range: Option<[f64; 2]>) -> Result<Quantity, Rejection> {
    let Some(range) = range else {
        return Ok(quantity);
    };
    let over = quantity.over(range);
    over.map_err(|e| Rejection::new(RejectReason::NoVariable, "quantity", e.to_string()))
}

/// What the version will say of itself.
struct Next<'a> {
    product: &'a ProductId,
    title: &'a str,
    source: &'a str,
    quantity: Quantity,
    synthetic: bool,
    grid: Grid,
    /// What the version before must be attached to; anything, if absent.
    only: Option<&'a Attachment>,
}

/// The version to follow on, which must be attached to the same as `only`.
async fn newest(
    store: &Store,
    product: &ProductId,
    only: Option<&Attachment>,
) -> Result<Option<Manifest>, Stop> {
    let newest = manifests::latest(store, product).await;
    let newest = newest.map_err(IngestError::storage("read the newest manifest"))?;
    let Some(newest) = newest else {
        return Ok(None);
    };
    let attached = store.attached_to(&newest).await;
    let attached = attached.map_err(IngestError::storage("read what it is attached to"))?;
    let refused = match (&attached, only) {
        (None, _) => Some("it is there, and its values were landed or computed here; attach as another product (--product)".to_owned()),
        (Some(before), Some(now)) => is_another(before, now)?,
        (Some(_), None) => None,
    };
    match refused {
        None => Ok(Some(newest)),
        Some(detail) => Err(IngestError::Attach {
            product: product.to_string(),
            detail,
        }
        .into()),
    }
}

/// Why a product that is attached to one thing is not attached to another unasked; none if it is the same thing.
fn is_another(before: &Attachment, now: &Attachment) -> Result<Option<String>, IngestError> {
    let indexes = |of: &Attachment| {
        let reading = Reading::of(of).map_err(|detail| IngestError::Attach {
            product: of.product.to_string(),
            detail,
        })?;
        Ok::<_, IngestError>(reading.index_words())
    };
    let (was, is) = (indexes(before)?, indexes(now)?);
    if (&before.store, &before.array, &was) == (&now.store, &now.array, &is) {
        return Ok(None);
    }
    Ok(Some(format!(
        "it is attached to {}{was}, and this is {}{is}; attach as another product (--product), or say --replace if its next version is to be this",
        before.place(),
        now.place()
    )))
}

fn check_fits(
    newest: &Manifest,
    grid: Grid,
    (quantity, synthetic): (Quantity, bool),
) -> Result<(), Stop> {
    let differs = if !commit::is_same_grid(&newest.grid, &grid) {
        "lies on another grid"
    } else if newest.quantity.joined(quantity).is_none() {
        "holds another quantity"
    } else if newest.synthetic != synthetic {
        "is measured where it is synthetic, or the other way round"
    } else {
        return Ok(());
    };
    Err(IngestError::Attach {
        product: newest.product.to_string(),
        detail: format!("it {differs}; attach as another product (--product)"),
    }
    .into())
}

/// Publishes the steps, unless the newest version has just these. `domain`: the cells that hold data, if all steps were read.
async fn next_version(
    store: &Store,
    next: &Next<'_>,
    (steps, domain): (&[Step], Option<&Cells>),
) -> Result<(Manifest, bool), Stop> {
    let mut pauses = commit::attempts();
    loop {
        let newest = newest(store, next.product, next.only).await?;
        let (mut grid, mut quantity) = (next.grid, next.quantity);
        if let Some(newest) = &newest {
            check_fits(newest, next.grid, (next.quantity, next.synthetic))?;
            let joined = newest.quantity.joined(quantity).unwrap_or(quantity);
            // It differs by the noise of its axes, or by what was not rounded when they were read before.
            if commit::is_equal_grid(&newest.grid, &grid) {
                grid = newest.grid;
            }
            if newest.steps == steps
                && newest.grid == grid
                && joined.flags() == newest.quantity.flags()
            {
                return Ok((newest.clone(), false));
            }
            // Of what was not read only the version before knows the range.
            if domain.is_none() {
                quantity = joined;
            }
        }
        let domain = match domain {
            Some(cells) => domain::write_cells(store, next.product, cells.clone())
                .await
                .map_err(IngestError::storage("store the domain"))?,
            None => commit::domain(store, next.product, &grid, newest.as_ref(), steps).await?,
        };
        let manifest = Manifest {
            schema: MANIFEST_SCHEMA,
            product: next.product.clone(),
            number: newest.as_ref().map_or(1, |newest| newest.number + 1),
            title: next.title.to_owned(),
            quantity,
            synthetic: next.synthetic,
            source: next.source.to_owned(),
            grid,
            steps: steps.to_vec(),
            domain,
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
        };
        match manifests::commit(store, &manifest).await {
            Ok(version) => {
                cube::keep_up_as(store, &manifest, &version).await;
                return Ok((manifest, true));
            }
            Err(StorageError::Conflict { .. }) => {
                commit::race_lost(next.product, &mut pauses).await?;
            }
            Err(e) => return Err(IngestError::storage("publish a manifest")(e).into()),
        }
    }
}

/// Bytes of what this store holds for a version.
async fn stored_bytes(store: &Store, version: &Manifest) -> Result<u64, Stop> {
    let bare = store.bare();
    let mut keys: Vec<_> = version
        .steps
        .iter()
        .map(|step| step.field.clone())
        .collect();
    let raw = version.steps.iter().map(|step| step.raw_sha256);
    let raw: BTreeSet<_> = raw.collect();
    keys.extend(raw.iter().map(|raw| ObjectKey::raw(&version.product, raw)));
    keys.push(version.domain.clone());
    keys.sort();
    keys.dedup();
    let mut bytes = 0;
    for key in keys {
        let size = bare.size_bytes(&key).await;
        bytes += size.map_err(IngestError::storage("look at what was stored"))?;
    }
    Ok(bytes)
}
