//! Several regions with names out of one text: a GeoJSON feature collection, a region a feature.

use std::collections::BTreeSet;

use geojson::feature::Id;
use geojson::{Feature, GeoJson};

use super::text::{checked, collected};
use super::{AskedRegion, Region};
use crate::ContractError;
use crate::geometry_text::document;

/// Most regions that are asked for at once.
pub const MAX_REGIONS: usize = 100;
/// Properties that a name is looked for in, in this order; then the feature's `id`.
const NAMES: [&str; 4] = ["name", "Name", "NAME", "title"];
/// Longest name, bytes.
const MAX_NAME_BYTES: usize = 100;

/// The regions of a feature collection, each called by its property `name`.
///
/// # Errors
/// No feature collection; no features or too many; one without a name or a polygon; two of one name.
pub fn named_regions(text: &str) -> Result<Vec<AskedRegion>, ContractError> {
    read(text.trim()).map_err(|reason| ContractError::invalid("regions", text, reason))
}

fn read(text: &str) -> Result<Vec<AskedRegion>, String> {
    let GeoJson::FeatureCollection(collection) = document(text)? else {
        return Err("a FeatureCollection is wanted, a region a feature; one region alone is given as `region`".to_owned());
    };
    let count = collection.features.len();
    if !(1..=MAX_REGIONS).contains(&count) {
        return Err(format!(
            "it holds {count} features: 1 to {MAX_REGIONS} are taken"
        ));
    }
    let mut names = BTreeSet::new();
    let mut regions = vec![];
    for (number, feature) in (1..).zip(&collection.features) {
        let name = name(feature).ok_or_else(|| {
            format!("feature {number} has no name: give it a property \"name\", of at most {MAX_NAME_BYTES} bytes")
        })?;
        if !names.insert(name.clone()) {
            return Err(format!("two features are called {name:?}"));
        }
        let polygons =
            collected(&feature.geometry).map_err(|reason| format!("{name:?}: {reason}"))?;
        let polygons = checked(polygons).map_err(|reason| format!("{name:?}: {reason}"))?;
        regions.push(AskedRegion {
            region: Region::Polygons(polygons),
            name,
        });
    }
    Ok(regions)
}

fn name(feature: &Feature) -> Option<String> {
    let of_property = || {
        let properties = feature.properties.as_ref()?;
        let mut found = NAMES
            .iter()
            .filter_map(|name| properties.get(*name)?.as_str());
        found.next().map(str::to_owned)
    };
    let of_id = || match feature.id.as_ref()? {
        Id::String(id) => Some(id.clone()),
        Id::Number(id) => Some(id.to_string()),
    };
    let name = of_property().or_else(of_id)?;
    let name = name.trim();
    let is_one_line = !name.is_empty() && !name.chars().any(char::is_control);
    (is_one_line && name.len() <= MAX_NAME_BYTES).then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = r#"{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1],[0,1],[0,0]]]}"#;

    fn feature(more: &str, geometry: &str) -> String {
        format!(r#"{{"type":"Feature",{more},"geometry":{geometry}}}"#)
    }

    fn collection(features: &[String]) -> String {
        let features = features.join(",");
        format!(r#"{{"type":"FeatureCollection","features":[{features}]}}"#)
    }

    #[test]
    fn a_feature_is_a_region_by_its_name() {
        let named = feature(r#""properties":{"name":" North "}"#, SQUARE);
        let numbered = feature(r#""id":7,"properties":null"#, SQUARE);
        let found = named_regions(&collection(&[named, numbered])).unwrap();
        let names: Vec<_> = found.iter().map(|one| one.name.as_str()).collect();
        assert_eq!(names, ["North", "7"]);
        assert_eq!(found[0].region, SQUARE.parse().unwrap());
    }

    #[test]
    fn what_is_no_list_of_regions_is_refused() {
        let named = |name: &str, geometry: &str| {
            feature(&format!(r#""properties":{{"name":"{name}"}}"#), geometry)
        };
        let many: Vec<_> = (0..=MAX_REGIONS)
            .map(|i| named(&i.to_string(), SQUARE))
            .collect();
        for (text, wanted) in [
            (SQUARE.to_owned(), "FeatureCollection is wanted"),
            ("POLYGON((0 0,1 0,1 1,0 0))".to_owned(), "no GeoJSON"),
            (collection(&[]), "0 features"),
            (collection(&many), "101 features"),
            (
                collection(&[feature(r#""properties":{}"#, SQUARE)]),
                "feature 1 has no name",
            ),
            (collection(&[named(&"x".repeat(101), SQUARE)]), "no name"),
            (collection(&[named("a", "null")]), "holds no Polygon"),
            (
                collection(&[named("a", r#"{"type":"Point","coordinates":[0,0]}"#)]),
                "a Point has no area",
            ),
            (
                collection(&[named("a", SQUARE), named("a", SQUARE)]),
                "two features",
            ),
        ] {
            let refused = named_regions(&text).unwrap_err().to_string();
            assert!(refused.contains(wanted), "{text}: {refused}");
        }
    }
}
