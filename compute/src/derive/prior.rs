//! What an earlier derivation left that is still right: its first steps, up to the first one whose source changed.

use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{self, Manifest, Step};
use storage::contributed::{self, Contributed};
use storage::{Store, domain, fields};

use super::source::SourceStep;
use crate::ComputeError;

/// The reusable part of the newest manifest.
pub(super) struct Prior<'a> {
    manifest: Option<&'a Manifest>,
    /// How many of its first steps are made of what they would be made of now.
    pub(super) step_count: usize,
    /// Its domain where that is another one now; `[row, col]`.
    other_domain: Option<Vec<bool>>,
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
    pub(super) async fn of(
        store: &Store,
        latest: Option<&'a Manifest>,
        grid: &Grid,
        steps: &[SourceStep<'_>],
        domain_now: &ObjectKey,
    ) -> Result<Self, ComputeError> {
        let nothing = Self::nothing();
        let Some(latest) = latest.filter(|latest| latest.grid == *grid) else {
            return Ok(nothing);
        };
        let equal = |(old, new): &(&Step, &SourceStep<'_>)| {
            old.raw_sha256 == new.made_of && old.period == new.period && old.contributed.is_some()
        };
        let step_count = latest.steps.iter().zip(steps).take_while(equal).count();
        let other_domain = if latest.domain == *domain_now {
            None
        } else {
            Some(domain::read(store, &latest.domain).await?)
        };
        Ok(Self {
            manifest: Some(latest),
            step_count,
            other_domain,
        })
    }

    /// What the sums after the last kept step hold; nothing before the first step, if none is kept. If the object is
    /// gone, nothing is kept any more.
    pub(super) async fn contributed(
        &mut self,
        store: &Store,
        grid: &Grid,
        steps: &[SourceStep<'_>],
    ) -> Result<Contributed, ComputeError> {
        let last = self.step_count.checked_sub(1);
        if let Some(counts) = last.and_then(|last| self.counts(last)) {
            match contributed::read(store, &counts.counts, grid).await {
                Ok(contributed) => return Ok(contributed),
                Err(e) if e.is_not_found() => {
                    let key = &counts.counts;
                    tracing::warn!(%key, "counts of steps are gone; all is accumulated again");
                }
                Err(e) => return Err(e.into()),
            }
        }
        *self = Self::nothing();
        let start = steps.first().map(|step| step.period.start);
        let start = start.expect("there is a step to accumulate");
        Ok(Contributed::nothing(grid, start))
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

    /// Values of a kept step as they are over the domain of now, `[row, col]`.
    ///
    /// No kept step has data in a cell that only one of the two domains has: if the old one lacks it, no old step had
    /// data there; if the new one lacks it, no step has now. So such a cell has accumulated exactly nothing, or is empty.
    pub(super) async fn column(
        &self,
        store: &Store,
        index: usize,
        domain_now: &[bool],
    ) -> Result<Vec<f32>, ComputeError> {
        let manifest = self.manifest.expect("kept steps have a manifest");
        let mut values = fields::read(store, &manifest.steps[index].field, &manifest.grid).await?;
        if let Some(before) = &self.other_domain {
            for ((value, &now), &before) in values.iter_mut().zip(domain_now).zip(before) {
                if !now {
                    *value = f32::NAN;
                } else if !before {
                    *value = 0.0;
                }
            }
        }
        Ok(values)
    }
}
