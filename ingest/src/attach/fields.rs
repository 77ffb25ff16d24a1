//! A reference in, the values that it refers to out: the way of the landing, from the plan that the attachment keeps.

use std::sync::Arc;
use std::time::{Duration, Instant};

use async_trait::async_trait;
use contract::masked::MaskedCells;
use contract::time::Period;
use cube::foreign::{Absent, Foreign, ForeignError, Found};
use quick_cache::sync::Cache;
use storage::attached::{Attachment, Cause, Failure, Reference, Source, StoreKind};

use super::reading::Reading;
use super::{address, moved};
use crate::check::Found as FoundValues;
use crate::decode::{DecodedBand, Slab, converted, is_plane};
use crate::inspect::arrays::Arrays;
use crate::limits::Limits;
use crate::plan::PlannedStep;
use crate::plan::cf::packing::Packing;
use crate::plan::cf::unmarked::Ends;

/// Stores of others that are kept open: each may hold a hundred megabytes of chunks.
const KEPT_STORES: usize = 4;
/// How long what was read of a store is taken for what it holds, whatever is found: one that has changed, and was not attached anew, is
/// not opened more often.
const JUST_READ: Duration = Duration::from_secs(1);

/// What tells arrays of stores apart.
type Name = (String, StoreKind, Option<String>, String);

/// Reads fields of attached products from where they lie, with the credentials of this process' environment.
#[derive(Debug)]
pub struct ForeignFields {
    /// With when each was opened.
    open: Cache<Name, (Arc<Foreign>, Instant)>,
}

impl Default for ForeignFields {
    fn default() -> Self {
        Self {
            open: Cache::new(KEPT_STORES),
        }
    }
}

fn name(attachment: &Attachment) -> Name {
    let Attachment {
        store,
        kind,
        snapshot,
        array,
        ..
    } = attachment;
    (store.clone(), *kind, snapshot.clone(), array.clone())
}

impl ForeignFields {
    async fn foreign(&self, attachment: &Attachment) -> Result<Arc<Foreign>, ForeignError> {
        let Attachment {
            store,
            kind,
            snapshot,
            array,
            ..
        } = attachment;
        let open = async {
            let now = Instant::now();
            let found = Found {
                kind: *kind,
                snapshot: snapshot.clone(),
            };
            let opened = Foreign::open_one(address::open(store)?, found, array).await?;
            Ok((Arc::new(opened), now))
        };
        let name = name(attachment);
        let opened = self.open.get_or_insert_async(&name, open).await;
        opened.map(|(foreign, _since)| foreign)
    }
}

#[async_trait]
impl Source for ForeignFields {
    async fn values(
        &self,
        attachment: &Arc<Attachment>,
        reference: &Reference,
    ) -> Result<Vec<f32>, Failure> {
        let period = reference.period;
        let place = || format!("{} step {period}", attachment.place());
        let refused = |reason: String| Failure {
            place: place(),
            reason,
            cause: Cause::Content,
            folder: attachment.folder().map(str::to_owned),
        };
        let reading = Reading::of(attachment).map_err(refused)?;
        let foreign = match self.foreign(attachment).await {
            Ok(foreign) => foreign,
            Err(error) => return Err(failed(error, attachment, period).await),
        };
        let absent = if reading.absent_is_no_data {
            Absent::Fill
        } else {
            Absent::Refused
        };
        let plane_cells = Limits::default().plane_cells;
        let own = (attachment.array.clone(), absent);
        let arrays = Arrays::new(foreign, reading.indexes.clone(), own, plane_cells);
        let step = PlannedStep {
            period,
            time_index: reference.time_index,
            factor: f64::from_bits(reference.conversion[0]),
            offset: f64::from_bits(reference.conversion[1]),
        };
        let rows = 0..reading.mapping.file_rows.len() as u32;
        let slab = Slab::of(&reading.mapping, step, &rows);
        let parts: Vec<_> = reading.axes.iter().map(|axis| slab.part(axis)).collect();
        let stored = match arrays.values(&attachment.array, &parts).await {
            Ok(stored) => stored,
            Err(error) => return Err(failed(error, attachment, period).await),
        };
        let made = tokio::task::spawn_blocking(move || made(&reading, step, &stored));
        made.await
            .map_err(|e| refused(e.to_string()))?
            .map_err(refused)
    }

    async fn gone(&self, attachment: &Attachment, reference: &Reference) -> Option<Failure> {
        let gone = moved::gone(attachment).await?;
        Some(of_step(gone, attachment, reference.period))
    }

    fn let_go(&self, attachment: &Attachment) -> bool {
        let name = name(attachment);
        let opened = self.open.get(&name);
        let is_old = opened.is_some_and(|(_foreign, since)| since.elapsed() > JUST_READ);
        is_old && self.open.remove(&name).is_some()
    }
}

/// What failed of a step, and what to do.
async fn failed(error: ForeignError, attachment: &Attachment, period: Period) -> Failure {
    let may_be_gone = error.cause == Cause::Content || error.is_absent;
    if may_be_gone && let Some(gone) = moved::gone(attachment).await {
        return of_step(gone, attachment, period);
    }
    let advice = match error.cause {
        Cause::Content => format!(
            "; if the store has changed since it was attached, run `fluxglobe attach --refresh {}`",
            attachment.product
        ),
        Cause::Access | Cause::Away => String::new(),
    };
    let reason = format!("{}{advice}", error.reason);
    of_step(ForeignError { reason, ..error }, attachment, period)
}

/// An error as that of a step.
fn of_step(error: ForeignError, attachment: &Attachment, period: Period) -> Failure {
    // What is wrong with the store is wrong with the array.
    let array = if error.place.contains(" array ") {
        String::new()
    } else {
        format!(" array {}", attachment.array)
    };
    Failure {
        place: format!("step {period}, {}{array}", error.place),
        reason: error.reason,
        cause: error.cause,
        folder: attachment.folder().map(str::to_owned),
    }
}

/// Values of the grid from stored numbers, with what cannot be true masked as it was when they were attached.
fn made(reading: &Reading, step: PlannedStep, stored: &[f64]) -> Result<Vec<f32>, String> {
    let Reading {
        axes,
        mapping,
        packing,
        quantity,
        ..
    } = reading;
    let plane = axes.iter().filter(|axis| is_plane(axis));
    let cells: u64 = plane.map(|axis| axis.len).product();
    let rows = mapping.file_rows.len() as u64;
    if cells != stored.len() as u64 || rows > cells {
        return Err(format!("{} values for {cells} cells", stored.len()));
    }
    let mut masked = MaskedCells::default();
    let packing = Packing::from(packing);
    let rows = 0..rows as u32;
    let values = converted((axes, mapping), &packing, (step, rows), stored, &mut masked);
    let decoded = DecodedBand {
        values,
        masked,
        // They were looked at when the store was attached.
        ends: Ends::default(),
    };
    Ok(FoundValues::nothing().band(decoded, *quantity).0)
}
