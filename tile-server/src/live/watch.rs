//! Looks at the list of products again and again, for a server without an event log: what another process lands is told
//! to viewers here as well.

use std::collections::BTreeMap;
use std::time::Duration;

use contract::product::ProductId;

use crate::live::seen::Seen;
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
            (product, Seen::of(layer))
        });
        let found: BTreeMap<_, _> = found.collect();
        if let Some(before) = &self.seen {
            for (product, now) in &found {
                now.tell(before.get(product), &self.state.news);
            }
        }
        self.seen = Some(found);
    }
}
