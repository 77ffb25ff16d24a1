//! A product as it was seen before and as it is now in; news of the times whose pictures differ out.

use std::sync::Arc;

use contract::manifest::{Manifest, ManifestId};
use contract::time::Period;

use crate::catalogue::Layer;
use crate::live::news::News;
use crate::live::touched;

/// A version by its name, which is costly to compute.
pub(super) type Version = (ManifestId, Arc<Manifest>);

/// What pictures of a product were made of when it was looked at.
pub(super) struct Seen {
    version: Version,
    lift: Option<Version>,
    /// What its particles drift with besides it.
    northward: Option<Version>,
}

impl Seen {
    pub(super) fn of(layer: &Layer) -> Self {
        let version = |id: &ManifestId, manifest| (id.clone(), Arc::clone(manifest));
        Self {
            version: version(&layer.id, &layer.manifest),
            lift: layer
                .accumulated
                .as_ref()
                .map(|lift| version(&lift.id, &lift.manifest)),
            northward: layer
                .northward
                .as_ref()
                .map(|part| version(&part.id, &part.manifest)),
        }
    }

    /// Tells viewers what differs from what was seen `before`.
    pub(super) fn tell(&self, before: Option<&Self>, news: &News) {
        let (id, _) = &self.version;
        for touched in self.differs_from(before) {
            tracing::info!(manifest = %id, periods = touched.len(), "viewers are told of new pictures");
            news.tell(id.clone(), touched);
        }
    }

    /// Times whose pictures differ, for each thing that does: the values, what lifts their particles, and what those drift
    /// with. Of a product that was not there before all that there is.
    fn differs_from(&self, before: Option<&Self>) -> Vec<Vec<Period>> {
        let (id, manifest) = &self.version;
        let version = before.map(|before| &before.version);
        let mut all = vec![];
        if version.is_none_or(|(old, _)| old != id) {
            all.push(touched(version.map(|(_, old)| &**old), manifest));
        }
        let Some(before) = before else {
            return all;
        };
        let others = [
            (&before.lift, &self.lift),
            (&before.northward, &self.northward),
        ];
        for (old, new) in others {
            if let Some((new, manifest)) = new
                && old.as_ref().is_none_or(|(old, _)| old != new)
            {
                all.push(touched(old.as_ref().map(|(_, old)| &**old), manifest));
            }
        }
        all
    }
}
