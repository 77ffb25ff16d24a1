//! What an earlier derivation left that is still right: its first steps, up to the first one whose source changed.

use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{self, Manifest, Step};
use contract::product::ProductId;
use storage::domain::Cells;
use storage::fields::Spooled;
use storage::{Store, contributed, domain, fields};

use super::source::SourceStep;
use crate::ComputeError;
use crate::workshop::Workshop;

/// The reusable part of the newest manifest.
pub(super) struct Prior<'a> {
    manifest: Option<&'a Manifest>,
    /// How many of its first steps are made of what they would be made of now.
    pub(super) step_count: usize,
    /// Its domain where that is another one now.
    other_domain: Option<Cells>,
}

impl<'a> Prior<'a> {
    /// Everything is computed.
    fn nothing() -> Self {
        Self {
            manifest: None,
            step_count: 0,
            other_domain: None,
        }
    }

    /// What of the newest manifest can be kept.
    pub(super) fn of(latest: Option<&'a Manifest>, grid: &Grid, steps: &[SourceStep<'_>]) -> Self {
        let Some(latest) = latest.filter(|latest| latest.grid == *grid) else {
            return Self::nothing();
        };
        let equal = |(old, new): &(&Step, &SourceStep<'_>)| {
            old.raw_sha256 == new.made_of && old.period == new.period && old.contributed.is_some()
        };
        Self {
            manifest: Some(latest),
            step_count: latest.steps.iter().zip(steps).take_while(equal).count(),
            other_domain: None,
        }
    }

    /// Goes on over the domain of now: kept steps of another one are stored anew over it. The same cells under another name, as
    /// they were stored before, are no other one.
    pub(super) async fn over_domain(
        &mut self,
        store: &Store,
        (domain_now, cells_now): (&ObjectKey, &Cells),
    ) -> Result<(), ComputeError> {
        let before = self.manifest.map(|manifest| &manifest.domain);
        if let Some(before) = before.filter(|before| *before != domain_now) {
            let cells = domain::read_cells(store, before).await?;
            if cells.map_count() != cells_now.map_count() {
                return Err(ComputeError::inconsistent(
                    before.to_string(),
                    "it does not fill its product's grid",
                ));
            }
            self.other_domain = (cells != *cells_now).then_some(cells);
        }
        Ok(())
    }

    /// What the sums after the last kept step hold; none before the first step, if none is kept. If the object is
    /// gone, nothing is kept any more.
    pub(super) async fn contributed(
        &mut self,
        store: &Store,
        grid: &Grid,
    ) -> Result<Option<contributed::Reader>, ComputeError> {
        let last = self.step_count.checked_sub(1);
        if let Some(counts) = last.and_then(|last| self.counts(last)) {
            match contributed::Reader::open(store, &counts.counts, grid).await {
                Ok(reader) => return Ok(Some(reader)),
                Err(e) if e.is_not_found() => {
                    let key = &counts.counts;
                    tracing::warn!(%key, "counts of steps are gone; all is accumulated again");
                }
                Err(e) => return Err(e.into()),
            }
        }
        *self = Self::nothing();
        Ok(None)
    }

    /// What the sums after a kept step hold: it does not depend on the domain, for a cell that comes or goes had no data.
    pub(super) fn counts(&self, index: usize) -> Option<&'a manifest::Contributed> {
        let manifest = self.manifest.filter(|_| index < self.step_count)?;
        manifest.steps[index].contributed.as_ref()
    }

    /// A kept step, if its very bytes are right too.
    pub(super) fn step(&self, index: usize) -> Option<&'a Step> {
        let manifest = self.manifest.filter(|_| self.other_domain.is_none())?;
        (index < self.step_count).then(|| &manifest.steps[index])
    }

    /// A kept step as it is over the domain of now: the key of its field, and how many cells hold a value.
    ///
    /// No kept step has data in a cell that only one of the two domains has: if the old one lacks it, no old step had
    /// data there; if the new one lacks it, no step has now. So such a cell has accumulated exactly nothing, or is empty.
    pub(super) async fn over(
        &self,
        workshop: Workshop<'_>,
        target: &ProductId,
        (index, domain_now): (usize, &Cells),
    ) -> Result<(ObjectKey, u64), ComputeError> {
        let manifest = self.manifest.expect("kept steps have a manifest");
        let (step, grid) = (&manifest.steps[index], &manifest.grid);
        let mut field = Spooled::begin(workshop.spool, grid, step.period)?;
        let band_cells = workshop.band_cells;
        let mut bands = fields::bands(workshop.store, &step.field, grid, band_cells).await?;
        while let Some((rows, mut values)) = bands.next().await? {
            if let Some(before) = &self.other_domain {
                let first = rows.start as usize * grid.cols as usize;
                let [is_now, was] =
                    [domain_now, before].map(|cells| cells.flags(first..first + values.len()));
                for ((value, is_now), was) in values.iter_mut().zip(is_now).zip(was) {
                    if !is_now {
                        *value = f32::NAN;
                    } else if !was {
                        *value = 0.0;
                    }
                }
            }
            field.band(&values)?;
        }
        Ok(field.put(workshop.store, target).await?)
    }
}
