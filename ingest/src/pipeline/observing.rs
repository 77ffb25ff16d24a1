//! The way of a file of observations: read, and once it is its turn handed to their store.

use std::sync::Arc;

use contract::digest::Digest;
use contract::event::RejectReason;
use contract::masked::MaskedCells;
use contract::product::ProductId;

use super::{Pipeline, Prepared, Way, ended};
use crate::error::{IngestError, Rejection, Stop, boundary};
use crate::fetch::RawGranule;
use crate::inspect::InspectedGranule;
use crate::notice::{Answer, PendingNotice};
use crate::observation::{self, Found, TextFormat, Waiting};

/// A file of observations that is read: what it holds waits to be stored after those of files that were offered before.
#[derive(Debug, Clone)]
pub(crate) struct ObservedFile {
    pub(crate) notice: Arc<PendingNotice>,
    pub(crate) dataset: ProductId,
    file_name: String,
    raw_sha256: Digest,
    masked: MaskedCells,
    /// What was measured and is not read, in words.
    passed_over: Vec<String>,
    observations: Waiting,
}

impl Pipeline<'_> {
    /// Observations of a text file.
    pub(super) async fn observe_text(
        &self,
        format: TextFormat,
        raw: RawGranule,
        way: Way<'_>,
    ) -> Result<Prepared, Stop> {
        if raw.size_bytes > observation::MAX_TEXT_BYTES {
            let detail = format!(
                "has {} bytes of text, at most {} are read; give it in smaller pieces",
                raw.size_bytes,
                observation::MAX_TEXT_BYTES
            );
            return Err(Rejection::new(RejectReason::TooLarge, "file", detail).into());
        }
        let (content, product) = (raw.bytes().await?, way.order.product.clone());
        let file_name = raw.file_name.clone();
        let read = move || {
            let source = observation::Source {
                file_name: &file_name,
                dataset: product.as_ref(),
            };
            observation::read_text(format, &content, source)
        };
        let found = async { Ok(tokio::task::spawn_blocking(read).await??) };
        let found = self.metrics.timed("decode", found).await?;
        self.observed(found, &raw, way).await
    }

    /// Observations of a NetCDF file.
    pub(super) async fn observe(
        &self,
        inspected: InspectedGranule,
        way: Way<'_>,
    ) -> Result<Prepared, Stop> {
        let InspectedGranule {
            raw,
            mut session,
            description,
        } = inspected;
        let source = observation::Source {
            file_name: &raw.file_name,
            dataset: way.order.product.as_ref(),
        };
        let read = observation::read(&mut session, &description, source);
        let found = self.metrics.timed("decode", read).await?;
        raw.check_unchanged()?;
        self.observed(found, &raw, way).await
    }

    /// Puts by what was found in a file.
    async fn observed(
        &self,
        found: Found,
        raw: &RawGranule,
        way: Way<'_>,
    ) -> Result<Prepared, Stop> {
        let Found {
            observations,
            masked,
            passed_over,
        } = found;
        let Some(first) = observations.first() else {
            unreachable!("a file without observations is refused")
        };
        let dataset = first.dataset.clone();
        if self.observations.is_none() {
            let detail = "holds observations, and there is no place for them here";
            return Err(Rejection::new(RejectReason::NoVariable, "file", detail).into());
        }
        let spool = self.settings.spool.clone();
        let put_by = move || Waiting::of(&spool, &observations);
        Ok(Prepared::ToStore(ObservedFile {
            notice: Arc::clone(way.notice),
            dataset,
            file_name: raw.file_name.clone(),
            raw_sha256: raw.sha256,
            masked,
            passed_over: passed_over.iter().map(ToString::to_string).collect(),
            observations: tokio::task::spawn_blocking(put_by).await??,
        }))
    }

    /// Stores what a file holds, and then notes the file.
    pub(crate) async fn store_observed(&self, file: &ObservedFile) -> Result<Answer, IngestError> {
        let sink = self.observations;
        let sink =
            sink.expect("files of observations are refused where there is no place for them");
        let running = self.metrics.start("put");
        let _memory = self.gates.memory(file.observations.memory_bytes()).await;
        let work = async {
            let (waiting, count) = (file.observations.clone(), file.observations.count());
            let observations = tokio::task::spawn_blocking(move || waiting.read()).await??;
            let stored = sink.put(observations).await;
            let stored = stored.map_err(|source| IngestError::Observations { source })?;
            let told = (file.file_name.as_str(), count as u64, file.masked);
            observation::put_note(self.store, &file.dataset, file.raw_sha256, told).await?;
            Ok::<_, IngestError>(stored)
        };
        let stored = boundary::contained(work).await.flatten();
        running.done(ended(&stored));
        let stored = stored?;
        let dataset = file.dataset.clone();
        let passed_over = file.passed_over.clone();
        Ok(file
            .notice
            .observed(dataset, stored, (file.masked, passed_over)))
    }
}
