//! What a cube is of: the product as attributes of its group, for people by the conventions' names, for this program whole.

use std::sync::Arc;

use contract::analysis::MapStatistic;
use contract::grid::Grid;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use contract::quantity::Quantity;
use futures::future::BoxFuture;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use storage::{Store, manifests};
use zarrs::group::Group;
use zarrs::storage::AsyncReadableStorageTraits;

use crate::CubeError;

/// Version of the layout of cubes, as it is written and read.
const SCHEMA: u32 = 1;
/// Attribute of the group that holds what this program reads.
const ATTRIBUTE: &str = "fluxglobe";

/// A product, without its steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Product.
    pub product: ProductId,
    /// Title for people.
    pub title: String,
    /// Quantity; values are in its unit.
    pub quantity: Quantity,
    /// Made up by a program rather than measured.
    pub synthetic: bool,
    /// Where the data come from, as a citation.
    pub source: String,
    /// The one grid of all steps.
    pub grid: Grid,
    /// The version that the cube is a copy of, if it is one.
    pub version: Option<ManifestId>,
    /// What its values are over time of what it was made of, by [`storage::manifests::over_time`]; none of a product that is no statistic of
    /// another, and in cubes of before it was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub statistic: Option<MapStatistic>,
}

impl Description {
    /// The attribute of the group, or of an exported file, that holds it.
    pub const ATTRIBUTE: &'static str = ATTRIBUTE;

    /// The description of a version of a product in a store.
    ///
    /// # Errors
    /// A version that it was made of and that cannot be read.
    pub fn of<'a>(
        store: &'a Store,
        manifest: &'a Manifest,
    ) -> BoxFuture<'a, Result<Self, CubeError>> {
        Box::pin(async move { Self::named(store, manifest, manifest.id()).await })
    }

    /// The same for who knows the version's name, which takes longer to compute the more steps there are.
    pub(crate) async fn named(
        store: &Store,
        manifest: &Manifest,
        version: ManifestId,
    ) -> Result<Self, CubeError> {
        let over_time = manifests::over_time(store, manifest).await?;
        Ok(Self {
            product: manifest.product.clone(),
            title: manifest.title.clone(),
            quantity: manifest.quantity,
            synthetic: manifest.synthetic,
            source: manifest.source.clone(),
            grid: manifest.grid,
            version: Some(version),
            statistic: over_time.map(|it| it.statistic),
        })
    }

    /// Do its values add up since the first step, and not only begin where their step does? Accumulated carbon does, a statistic of it does not.
    pub fn is_sum(&self) -> bool {
        self.quantity == Quantity::AccumulatedCarbon && self.statistic.is_none()
    }

    /// Attributes of the group.
    pub fn attributes(&self) -> Map<String, Value> {
        let written = json!({ "schema": SCHEMA, "of": self });
        let mut attributes = Map::new();
        let mut put = |name: &str, value: Value| attributes.insert(name.to_owned(), value);
        put("Conventions", "CF-1.11".into());
        put("title", self.title.as_str().into());
        put("references", self.source.as_str().into());
        if let Some(version) = &self.version {
            put("id", version.to_string().into());
        }
        if self.synthetic {
            put(
                "comment",
                "Synthetic: made up by a program, not measured.".into(),
            );
        }
        put(ATTRIBUTE, written);
        attributes
    }

    /// Reads that of the group in a store of arrays.
    pub(crate) async fn of_group<S>(store: &Arc<S>, place: &str) -> Result<Self, CubeError>
    where
        S: AsyncReadableStorageTraits + 'static,
    {
        let group = Group::async_open(Arc::clone(store), "/").await;
        let group = group.map_err(|e| CubeError::foreign(place, "the group".to_owned(), e))?;
        Self::read(group.attributes(), place)
    }

    /// Reads the attributes of a group.
    ///
    /// # Errors
    /// `Foreign` if they are not those of a cube, are of a layout to come, or describe no valid grid.
    pub fn read(attributes: &Map<String, Value>, place: &str) -> Result<Self, CubeError> {
        let foreign = |reason: String| CubeError::Foreign {
            place: place.to_owned(),
            array: "the group".to_owned(),
            reason,
        };
        let value = attributes
            .get(ATTRIBUTE)
            .ok_or_else(|| foreign(format!("it has no attribute {ATTRIBUTE:?}")))?;
        let schema = &value["schema"];
        if *schema != SCHEMA {
            return Err(foreign(format!(
                "layout {schema} is unknown, this program reads {SCHEMA}"
            )));
        }
        let description: Self =
            serde_json::from_value(value["of"].clone()).map_err(|e| foreign(e.to_string()))?;
        description
            .grid
            .validate()
            .map_err(|e| foreign(e.to_string()))?;
        Ok(description)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn description() -> Description {
        Description {
            product: "p".parse().unwrap(),
            title: "P".to_owned(),
            quantity: Quantity::CarbonFlux,
            synthetic: true,
            source: "S".to_owned(),
            grid: Grid {
                rows: 2,
                cols: 3,
                north_deg: 1.0 / 3.0,
                west_deg: 0.1,
                dlat_deg: 0.1,
                dlon_deg: 1.0 / 60.0,
            },
            version: Some("p@3-0a1b2c3d".parse().unwrap()),
            statistic: Some(MapStatistic::Max),
        }
    }

    #[test]
    fn a_description_comes_back_to_the_last_bit() {
        let text = serde_json::to_string(&description().attributes()).unwrap();
        let read = Description::read(&serde_json::from_str(&text).unwrap(), "x").unwrap();
        assert_eq!(read, description());
        assert!(text.contains("Synthetic"), "{text}");
    }

    #[test]
    fn what_is_no_description_is_refused_with_its_place() {
        let with = |change: fn(&mut Value)| {
            let mut attributes = description().attributes();
            change(&mut attributes[ATTRIBUTE]);
            Description::read(&attributes, "s3://b/p")
                .unwrap_err()
                .to_string()
        };
        let newer = with(|value| value["schema"] = 2.into());
        assert!(
            newer.contains("layout 2 is unknown") && newer.contains("s3://b/p"),
            "{newer}"
        );
        let huge = with(|value| value["of"]["grid"]["rows"] = u32::MAX.into());
        assert!(huge.contains("grid"), "{huge}");
        let none = Description::read(&Map::new(), "x").unwrap_err().to_string();
        assert!(none.contains("no attribute"), "{none}");
    }
}
