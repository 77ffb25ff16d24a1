//! The tables there are: one a product by its name, or one of its versions by `name@12`; `products` and `functions` say what
//! there is. What a question reads of a product is one version, however often it names it.

use std::collections::BTreeMap;
use std::fmt::Formatter;
use std::sync::Arc;

use async_trait::async_trait;
use contract::product::ProductId;
use cube::Description;
use datafusion::catalog::{SchemaProvider, TableProvider};
use datafusion::error::DataFusionError;
use datafusion::logical_expr::TableType;
use storage::manifests;
use tokio::sync::Mutex;

use super::about;
use super::named::Named;
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
        let Some(manifest) = named.manifest(&self.engine).await? else {
            named.check_version(&self.engine).await?;
            return Ok(None);
        };
        let description = Description::of(self.engine.store(), &manifest).await?;
        let version = Version::new(&self.engine, manifest);
        Ok(Some(Arc::new(ProductTable::new(version, &description))))
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
