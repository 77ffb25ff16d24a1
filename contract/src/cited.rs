//! What every answer about a product says of it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::manifest::{Manifest, ManifestId};
use crate::product::ProductId;
use crate::quantity::Quantity;

/// What an answer is to be cited with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Cited {
    /// Product.
    pub product: ProductId,
    /// The version of the product that was read.
    #[schema(value_type = String)]
    pub manifest: ManifestId,
    /// Title of the product.
    pub title: String,
    /// Citation of the product.
    pub source: String,
    /// Made up by a program rather than measured.
    pub synthetic: bool,
    /// What the values are.
    pub quantity: Quantity,
    /// Unit of the values, the one that people read.
    pub unit: String,
}

impl Cited {
    /// That of a version of a product; `id` is its name, which is costly to compute.
    pub fn of(manifest: &Manifest, id: ManifestId) -> Self {
        Self {
            product: manifest.product.clone(),
            manifest: id,
            title: manifest.title.clone(),
            source: manifest.source.clone(),
            synthetic: manifest.synthetic,
            quantity: manifest.quantity,
            unit: manifest.quantity.display().unit.to_owned(),
        }
    }
}
