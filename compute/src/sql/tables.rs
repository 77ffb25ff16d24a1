//! The tables there are: one a product by its name, or one of its versions by `name@12`; `products` and `functions` say what
//! there is. What a question reads of a product is one version, however often it names it.

use std::collections::BTreeMap;
use std::fmt::Formatter;
use std::sync::Arc;

use async_trait::async_trait;
use contract::manifest::Manifest;
use contract::product::ProductId;
use datafusion::catalog::{SchemaProvider, TableProvider};
use datafusion::error::DataFusionError;
use datafusion::logical_expr::TableType;
use storage::manifests;
use tokio::sync::Mutex;

use super::about;
use super::product_table::ProductTable;
use super::version::{Version, external};
use crate::{ComputeError, Engine};

/// Tables of a session.
pub(super) struct Tables {
    engine: Engine,
    products: Vec<ProductId>,
    /// Those that were asked for.
    held: Mutex<BTreeMap<String, Arc<dyn TableProvider>>>,
}

impl std::fmt::Debug for Tables {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} products", self.products.len())
    }
}

impl Tables {
    pub(super) async fn of(engine: &Engine) -> Result<Self, ComputeError> {
        Ok(Self {
            products: manifests::products(engine.store()).await?,
            engine: engine.clone(),
            held: Mutex::default(),
        })
    }

    /// The products, for a message.
    pub(super) fn products(&self) -> &[ProductId] {
        &self.products
    }

    async fn found(&self, name: &str) -> Result<Option<Arc<dyn TableProvider>>, ComputeError> {
        match name {
            about::PRODUCTS => {
                return Ok(Some(about::products(&self.engine, &self.products).await?));
            }
            about::FUNCTIONS => return Ok(Some(about::functions()?)),
            _ => {}
        }
        let Some(named) = Named::of(name) else {
            return Ok(None);
        };
        let manifest = named.manifest(&self.engine).await?;
        let table = |manifest| -> Arc<dyn TableProvider> {
            Arc::new(ProductTable::new(Version::new(&self.engine, manifest)))
        };
        Ok(manifest.map(table))
    }
}

#[async_trait]
impl SchemaProvider for Tables {
    fn table_names(&self) -> Vec<String> {
        let products = self.products.iter().map(ToString::to_string);
        let own = [about::PRODUCTS, about::FUNCTIONS].map(str::to_owned);
        own.into_iter().chain(products).collect()
    }

    async fn table(&self, name: &str) -> Result<Option<Arc<dyn TableProvider>>, DataFusionError> {
        let mut held = self.held.lock().await;
        if let Some(table) = held.get(name) {
            return Ok(Some(Arc::clone(table)));
        }
        let found = self.found(name).await.map_err(external)?;
        if let Some(table) = &found {
            held.insert(name.to_owned(), Arc::clone(table));
        }
        Ok(found)
    }

    async fn table_type(&self, name: &str) -> Result<Option<TableType>, DataFusionError> {
        Ok(self.table_exist(name).then_some(TableType::Base))
    }

    fn table_exist(&self, name: &str) -> bool {
        let own = [about::PRODUCTS, about::FUNCTIONS].contains(&name);
        own || Named::of(name).is_some_and(|named| self.products.contains(&named.product))
    }
}

/// A product, and perhaps one of its versions.
#[derive(Debug, PartialEq)]
pub(super) struct Named {
    pub(super) product: ProductId,
    number: Option<u64>,
    /// The digest that the version must have.
    digest: Option<String>,
}

impl Named {
    /// `name`, `name@12` or `name@12-0a1b2c3d`; `_` stands for `-` in the name, so that it needs no quotes.
    pub(super) fn of(text: &str) -> Option<Self> {
        let (product, version) = match text.split_once('@') {
            Some((product, version)) => (product, Some(version)),
            None => (text, None),
        };
        let (number, digest) = match version {
            Some(version) => match version.split_once('-') {
                Some((number, digest)) => (Some(number), Some(digest.to_owned())),
                None => (Some(version), None),
            },
            None => (None, None),
        };
        Some(Self {
            product: product.replace('_', "-").parse().ok()?,
            number: number.map(str::parse).transpose().ok()?,
            digest,
        })
    }

    pub(super) async fn manifest(&self, engine: &Engine) -> Result<Option<Manifest>, ComputeError> {
        let store = engine.store();
        let manifest = match self.number {
            Some(number) => manifests::numbered(store, &self.product, number).await?,
            None => manifests::latest(store, &self.product).await?,
        };
        let is_it = |manifest: &Manifest| match &self.digest {
            Some(digest) => manifest.id().to_string().ends_with(&format!("-{digest}")),
            None => true,
        };
        Ok(manifest.filter(is_it))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_needs_no_quotes_and_may_say_a_version() {
        let of = |text: &str| {
            let named = Named::of(text)?;
            Some((named.product.to_string(), named.number, named.digest))
        };
        let p = "a-b".to_owned();
        assert_eq!(of("a-b"), Some((p.clone(), None, None)));
        assert_eq!(of("a_b"), Some((p.clone(), None, None)));
        assert_eq!(of("a-b@12"), Some((p.clone(), Some(12), None)));
        let digest = Some("0a1b2c3d".to_owned());
        assert_eq!(of("a-b@12-0a1b2c3d"), Some((p, Some(12), digest)));
        for wrong in ["a-b@", "a-b@x", "../a", "A", ""] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }
}
