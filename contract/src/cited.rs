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

    /// What the values are and their unit, for people: `Salinity`, `Wind speed at 10 m in m s⁻¹`.
    pub fn titled(&self) -> String {
        let title = self.quantity.title();
        match self.unit.as_str() {
            "" | "1" => title.to_owned(),
            unit => format!("{title} in {unit}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_without_a_unit_is_in_none() {
        let of = |quantity: Quantity, unit: &str| Cited {
            product: "p".parse().unwrap(),
            manifest: "p@1-0a1b2c3d".parse().unwrap(),
            title: String::new(),
            source: String::new(),
            synthetic: false,
            quantity,
            unit: unit.to_owned(),
        };
        assert_eq!(of(Quantity::Salinity, "").titled(), "Salinity");
        assert_eq!(of(Quantity::Salinity, "1").titled(), "Salinity");
        assert_eq!(of(Quantity::IceFraction, "%").titled(), "Sea ice in %");
    }
}
