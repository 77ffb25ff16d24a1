//! Looks at the list of products again and again, for a server without an event log: what another process lands is told
//! to viewers here as well.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;

use crate::catalogue::Layer;
use crate::live::touched;
use crate::state::AppState;

/// Shortest pause between two looks: a look lists the manifests of all products.
const PAUSE: Duration = Duration::from_secs(2);

/// Keeps the viewers of one server up with what lands.
pub struct Watch {
    state: AppState,
    pause: Duration,
    /// What was there at the look before; none before the first one.
    seen: Option<BTreeMap<ProductId, Seen>>,
}

struct Seen {
    version: Version,
    lift: Option<Version>,
    /// What its particles drift with besides it.
    northward: Option<Version>,
}

type Version = (ManifestId, Arc<Manifest>);

impl Watch {
    pub(crate) fn new(state: AppState) -> Self {
        let max_age = Duration::from_millis(state.settings.catalogue_age_ms);
        Self {
            state,
            pause: max_age.max(PAUSE),
            seen: None,
        }
    }

    /// The same with another pause, for tests.
    #[must_use]
    pub fn every(self, pause: Duration) -> Self {
        Self { pause, ..self }
    }

    /// Looks until viewers are told no more.
    pub async fn run(mut self) {
        while !self.state.news.is_closed() {
            self.look().await;
            tokio::time::sleep(self.pause).await;
        }
    }

    async fn look(&mut self) {
        // A store that does not answer is asked again at the next look, and the log says so.
        let Ok(layers) = self.state.catalogue.layers().await else {
            return;
        };
        let found = layers.iter().map(|layer| {
            let product = layer.manifest.product.clone();
            (product, seen(layer))
        });
        let found: BTreeMap<_, _> = found.collect();
        if let Some(before) = &self.seen {
            for (product, now) in &found {
                self.compare(before.get(product), now);
            }
        }
        self.seen = Some(found);
    }

    /// Tells what differs: the values, what lifts their particles, and what those drift with.
    fn compare(&self, before: Option<&Seen>, now: &Seen) {
        let (id, manifest) = &now.version;
        let version = before.map(|before| &before.version);
        if version.is_none_or(|(old, _)| old != id) {
            let touched = touched(version.map(|(_, old)| &**old), manifest);
            tracing::info!(manifest = %id, periods = touched.len(), "a new version is shown");
            self.state.news.tell(id.clone(), touched);
        }
        let Some(before) = before else {
            return;
        };
        let others = [
            (&before.lift, &now.lift),
            (&before.northward, &now.northward),
        ];
        for (old, new) in others {
            if let Some((new, manifest)) = new
                && old.as_ref().is_none_or(|(old, _)| old != new)
            {
                let touched = touched(old.as_ref().map(|(_, old)| &**old), manifest);
                self.state.news.tell(id.clone(), touched);
            }
        }
    }
}

fn seen(layer: &Layer) -> Seen {
    let version = |id: &ManifestId, manifest| (id.clone(), Arc::clone(manifest));
    Seen {
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
