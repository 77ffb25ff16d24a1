//! The versions that a question reads: one of each name, looked up when it is first asked for and the same until the question ends.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use contract::manifest::Manifest;
use storage::manifests;
use tokio::sync::OnceCell;

use super::named::Named;
use crate::{ComputeError, Engine};

/// A version, if there is one.
type Found = Option<Arc<Manifest>>;

/// Versions by the names that a question gave them, in tables, functions and masks.
pub(super) struct Pinned {
    engine: Engine,
    found: Mutex<BTreeMap<Named, Arc<OnceCell<Found>>>>,
}

impl Pinned {
    /// Those of a question that begins.
    pub(super) fn new(engine: &Engine) -> Arc<Self> {
        Arc::new(Self {
            engine: engine.clone(),
            found: Mutex::default(),
        })
    }

    /// The version of a name; none if it is not there.
    pub(super) async fn version(&self, named: &Named) -> Result<Found, ComputeError> {
        let own = {
            let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(found.entry(named.clone()).or_default())
        };
        let read = || async {
            let manifest = named.manifest(&self.engine).await;
            manifest.map(|found| found.map(Arc::new))
        };
        own.get_or_try_init(read).await.cloned()
    }

    /// The version that must be there.
    ///
    /// # Errors
    /// `UnknownProduct` if it is not.
    pub(super) async fn required(&self, named: &Named) -> Result<Arc<Manifest>, ComputeError> {
        if let Some(manifest) = self.version(named).await? {
            return Ok(manifest);
        }
        named.check_version(&self.engine).await?;
        Err(ComputeError::UnknownProduct {
            product: named.product.to_string(),
            known: manifests::products(self.engine.store()).await?,
        })
    }
}

#[cfg(test)]
mod tests {
    use contract::digest::Digest;
    use contract::grid::Grid;
    use contract::key::ObjectKey;
    use contract::manifest::MANIFEST_SCHEMA;
    use contract::product::ProductId;
    use contract::quantity::Quantity;
    use storage::Store;

    use super::*;

    async fn publish(store: &Store, number: u64) {
        let product: ProductId = "sst-test".parse().unwrap();
        let manifest = Manifest {
            schema: MANIFEST_SCHEMA,
            number,
            title: format!("Edition {number}"),
            quantity: Quantity::SeaSurfaceTemperature,
            synthetic: true,
            source: String::new(),
            grid: Grid {
                rows: 1,
                cols: 1,
                north_deg: 1.0,
                west_deg: 0.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            steps: vec![],
            domain: ObjectKey::domain(&product, &Digest::of(b"")),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product,
        };
        manifests::commit(store, &manifest).await.unwrap();
    }

    /// Whatever is published while it is worked on, and however it is written.
    #[tokio::test]
    async fn a_name_is_one_version_for_all_of_a_question() {
        let store = Store::memory();
        publish(&store, 1).await;
        let engine = Engine::local(store.clone());
        let of = async |pinned: &Pinned, text: &str| {
            let named = Named::of(text).unwrap();
            pinned.required(&named).await.map(|found| found.number)
        };
        let (question, later) = (Pinned::new(&engine), Pinned::new(&engine));
        assert_eq!(of(&question, "sst_test").await.unwrap(), 1);
        publish(&store, 2).await;
        for text in ["sst_test", "sst-test"] {
            assert_eq!(of(&question, text).await.unwrap(), 1, "{text}");
            assert_eq!(of(&later, text).await.unwrap(), 2, "{text}");
        }
        assert_eq!(of(&question, "sst-test@2").await.unwrap(), 2);
        let unknown = of(&question, "atlantis").await.unwrap_err().to_string();
        assert!(unknown.contains("atlantis"), "{unknown}");
    }
}
