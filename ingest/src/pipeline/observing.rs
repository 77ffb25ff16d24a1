//! The way of a file of observations: read, and handed to their store.

use contract::event::RejectReason;

use super::{Pipeline, Prepared, Way};
use crate::error::{IngestError, Rejection, Stop};
use crate::fetch::RawGranule;
use crate::inspect::InspectedGranule;
use crate::observation::{self, Found, TextFormat};

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
        self.store_observations(found, &raw, way).await
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
        self.store_observations(found, &raw, way).await
    }

    /// Stores what was found in a file, and then notes the file.
    async fn store_observations(
        &self,
        found: Found,
        raw: &RawGranule,
        way: Way<'_>,
    ) -> Result<Prepared, Stop> {
        let Found {
            observations,
            masked,
        } = found;
        let (Some(first), count) = (observations.first(), observations.len() as u64) else {
            unreachable!("a file without observations is refused")
        };
        let dataset = first.dataset.clone();
        let Some(sink) = self.observations else {
            let detail = "holds observations, and there is no place for them here";
            return Err(Rejection::new(RejectReason::NoVariable, "file", detail).into());
        };
        let put = async {
            let stored = sink.put(observations).await;
            let stored = stored.map_err(|source| IngestError::Observations { source })?;
            let told = (raw.file_name.as_str(), count, masked);
            observation::put_note(self.store, &dataset, raw.sha256, told).await?;
            Ok(stored)
        };
        let stored = self.metrics.timed("put", put).await?;
        let answer = way.notice.observed(dataset, stored, masked);
        Ok(Prepared::Answered(answer))
    }
}
