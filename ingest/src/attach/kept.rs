//! Steps of the version before that need not be read again: nothing of them changed in the store that they lie in.

use std::collections::BTreeMap;
use std::ops::Range;

use contract::digest::Digest;
use contract::kind::Vouched;
use contract::manifest::{Manifest, Step};
use cube::foreign::Foreign;
use storage::Store;
use storage::attached::{Attachment, Reference};

use super::reading::Reading;
use super::survey::Survey;
use crate::decode::Slab;
use crate::error::{IngestError, Stop};
use crate::inspect::arrays::{self, Arrays};
use crate::plan::PlannedStep;

/// What is kept of a step: all but where it lies, which may be another state of the repository now.
pub(super) struct Kept {
    pub(super) step: Step,
    pub(super) values_sha256: Digest,
}

/// Steps of the plan that are in the version before and whose chunks did not change since, by their index along time. None where
/// that cannot be told without reading: of plain Zarr, and where anything but the number of steps is other than it was.
pub(super) async fn kept(
    store: &Store,
    newest: &Manifest,
    survey: &Survey,
) -> Result<BTreeMap<u64, Kept>, Stop> {
    let mut all = BTreeMap::new();
    let failed = IngestError::storage("read what it is attached to");
    let before = store.attached_to(newest).await.map_err(failed)?;
    let Some(before) = before.filter(|before| is_alike(before, &survey.attachment)) else {
        return Ok(all);
    };
    let (foreign, array) = (&survey.foreign, &survey.attachment.array);
    let Some(snapshot) = &before.snapshot else {
        return Ok(all);
    };
    let Some(changed) = foreign.changed_since(snapshot, array).await else {
        return Ok(all);
    };
    for planned in &survey.plan.steps {
        let Some(index) = newest.step_of(planned.period) else {
            continue;
        };
        let step = &newest.steps[index];
        let reference = store.reference(&step.field).await;
        let reference = reference.map_err(IngestError::storage("read a reference"))?;
        let is_same = reference.is_some_and(|own| is_of(&own, planned, step.raw_sha256));
        let Vouched::Values(values_sha256) = step.field.vouches() else {
            continue;
        };
        let part = ranges(foreign, survey, *planned)?;
        let is_unchanged = foreign.is_unchanged(array, &part, &changed);
        if is_same && is_unchanged.map_err(arrays::stopped)? {
            let step = step.clone();
            all.insert(
                planned.time_index,
                Kept {
                    step,
                    values_sha256,
                },
            );
        }
    }
    Ok(all)
}

/// The cells of a step in the array.
fn ranges(foreign: &Foreign, survey: &Survey, step: PlannedStep) -> Result<Vec<Range<u64>>, Stop> {
    let array = foreign.array(&survey.attachment.array);
    let array = array.map_err(arrays::stopped)?;
    let plan = &survey.plan;
    let slab = Slab::of(&plan.mapping, step, &(0..plan.mapping.grid.rows));
    let parts: Vec<_> = plan.axes.iter().map(|axis| slab.part(axis)).collect();
    Ok(Arrays::ranges(array, &survey.indexes, &parts))
}

/// Is it read as it was, but for how many steps there are, and what is said of the quantity?
fn is_alike(before: &Attachment, now: &Attachment) -> bool {
    let alike = |attachment: &Attachment| {
        let mut reading = Reading::of(attachment).ok()?;
        reading.without_length_of_time();
        Some(reading)
    };
    (&before.store, before.kind, &before.array) == (&now.store, now.kind, &now.array)
        && alike(before).zip(alike(now)).is_some_and(|(before, now)| {
            let is_same_kind = before.quantity.is_same_kind(now.quantity);
            let before = Reading {
                quantity: now.quantity,
                ..before
            };
            is_same_kind && before == now
        })
}

fn is_of(reference: &Reference, planned: &PlannedStep, attachment: Digest) -> bool {
    let conversion = [planned.factor.to_bits(), planned.offset.to_bits()];
    let own = (reference.time_index, reference.period, reference.conversion);
    own == (planned.time_index, planned.period, conversion) && reference.attachment == attachment
}
