//! A reference in, the values that it refers to out: the way of the landing, from the plan that the attachment keeps.

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use async_trait::async_trait;
use contract::masked::MaskedCells;
use contract::time::Period;
use cube::foreign::{Absent, Foreign, ForeignError, Found};
use quick_cache::sync::Cache;
use storage::attached::{Attachment, Cause, Failure, Reference, Source, StoreKind};

use super::reading::Reading;
use super::{address, bands, moved};
use crate::check::Found as FoundValues;
use crate::decode::{DecodedBand, Slab, converted};
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

    /// How an attachment is read, and the arrays that it is read from.
    async fn opened(
        &self,
        attachment: &Attachment,
        period: Period,
    ) -> Result<(Reading, Arrays), Failure> {
        let reading = Reading::of(attachment);
        let reading = reading.map_err(|reason| refused(attachment, period, reason))?;
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
        Ok((reading, arrays))
    }
}

#[async_trait]
impl Source for ForeignFields {
    async fn bands(
        &self,
        attachment: &Arc<Attachment>,
        reference: &Reference,
    ) -> Result<Vec<Range<u32>>, Failure> {
        let period = reference.period;
        let (reading, arrays) = self.opened(attachment, period).await?;
        let axis = bands::rows_axis(&reading.axes);
        let starts = axis.map(|axis| arrays.chunk_starts(&attachment.array, axis));
        match starts.transpose() {
            Ok(starts) => Ok(bands::of(&reading.mapping, &starts.unwrap_or_default())),
            Err(error) => Err(failed(error, attachment, period).await),
        }
    }

    async fn values(
        &self,
        attachment: &Arc<Attachment>,
        reference: &Reference,
        rows: Range<u32>,
    ) -> Result<Vec<f32>, Failure> {
        let period = reference.period;
        let refused = |reason: String| refused(attachment, period, reason);
        let (reading, arrays) = self.opened(attachment, period).await?;
        let row_count = reading.mapping.file_rows.len();
        if rows.is_empty() || rows.end as usize > row_count {
            let reason = format!(
                "its attachment has {row_count} rows, and {} to {} are asked for",
                rows.start, rows.end
            );
            return Err(refused(reason));
        }
        let step = PlannedStep {
            period,
            time_index: reference.time_index,
            factor: f64::from_bits(reference.conversion[0]),
            offset: f64::from_bits(reference.conversion[1]),
        };
        let slab = Slab::of(&reading.mapping, step, &rows);
        let (parts, cells) = slab.parts(&reading.axes);
        let stored = match arrays.values(&attachment.array, &parts).await {
            Ok(stored) => stored,
            Err(error) => return Err(failed(error, attachment, period).await),
        };
        if cells != stored.len() as u64 || rows.len() as u64 > cells {
            let reason = format!("{} values for {cells} cells", stored.len());
            return Err(refused(reason));
        }
        let made = tokio::task::spawn_blocking(move || made(&reading, (step, rows), &stored));
        made.await.map_err(|e| refused(e.to_string()))
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

/// What is not read of a step though its store answers.
fn refused(attachment: &Attachment, period: Period, reason: String) -> Failure {
    Failure {
        place: format!("{} step {period}", attachment.place()),
        reason,
        cause: Cause::Content,
        folder: attachment.folder().map(str::to_owned),
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

/// Values of some rows of the grid from stored numbers, with what cannot be true masked as it was when they were attached.
fn made(reading: &Reading, of: (PlannedStep, Range<u32>), stored: &[f64]) -> Vec<f32> {
    let Reading {
        axes,
        mapping,
        packing,
        quantity,
        ..
    } = reading;
    let mut masked = MaskedCells::default();
    let packing = Packing::from(packing);
    let decoded = DecodedBand {
        values: converted((axes, mapping), &packing, of, stored, &mut masked),
        masked,
        // They were looked at when the store was attached.
        ends: Ends::default(),
    };
    FoundValues::nothing().band(decoded, *quantity).0
}
