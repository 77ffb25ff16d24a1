//! Region files: GeoJSON text in, polygons out.
//!
//! Left out on purpose: other coordinate systems than longitude and latitude (RFC 7946 knows no others), and lines and
//! points, which have no area.

use std::path::Path;

use contract::region::{MAX_CORNERS, Polygon, Region};
use geojson::{GeoJson, Geometry, GeometryValue, Position};

use super::rings::rings;
use crate::ComputeError;

/// Largest region file, bytes: a million corners written with 17 digits each.
pub const MAX_FILE_BYTES: u64 = 64 << 20;
/// Deepest nesting of geometry collections.
const MAX_DEPTH: usize = 8;

/// Reads a region file.
pub fn read(path: &Path) -> Result<Region, ComputeError> {
    let failed = |reason: String| ComputeError::RegionFile {
        file: path.display().to_string(),
        reason,
    };
    let meta = std::fs::metadata(path).map_err(|e| failed(e.to_string()))?;
    if !meta.is_file() {
        return Err(failed("it is no file".to_owned()));
    }
    if meta.len() > MAX_FILE_BYTES {
        return Err(failed(format!(
            "{} bytes, at most {MAX_FILE_BYTES} are taken; simplify it",
            meta.len()
        )));
    }
    let text = std::fs::read_to_string(path).map_err(|e| failed(e.to_string()))?;
    parse(&text).map_err(|e| match e {
        ComputeError::Region { reason } => failed(reason),
        other => other,
    })
}

/// Parses GeoJSON text: a geometry, a feature or a collection of features; their polygons together are the region.
pub fn parse(text: &str) -> Result<Region, ComputeError> {
    let bad = |reason: String| ComputeError::Region { reason };
    if text.len() as u64 > MAX_FILE_BYTES {
        return Err(bad(format!(
            "{} bytes of GeoJSON, at most {MAX_FILE_BYTES} are taken",
            text.len()
        )));
    }
    let document: GeoJson = text
        .parse()
        .map_err(|e| bad(format!("it is no GeoJSON: {}", first_line(&e))))?;
    let mut polygons = vec![];
    match &document {
        GeoJson::Geometry(geometry) => collect(geometry, 0, &mut polygons)?,
        GeoJson::Feature(feature) => {
            feature
                .geometry
                .iter()
                .try_for_each(|geometry| collect(geometry, 0, &mut polygons))?;
        }
        GeoJson::FeatureCollection(collection) => {
            let mut geometries = collection
                .features
                .iter()
                .filter_map(|feature| feature.geometry.as_ref());
            geometries.try_for_each(|geometry| collect(geometry, 0, &mut polygons))?;
        }
    }
    if polygons.is_empty() {
        return Err(bad("it holds no Polygon or MultiPolygon".to_owned()));
    }
    // What is wrong with a ring is best said while its file is at hand.
    rings(&polygons)?;
    Ok(Region::Polygons(polygons))
}

fn first_line(error: &dyn std::fmt::Display) -> String {
    error
        .to_string()
        .lines()
        .next()
        .unwrap_or_default()
        .chars()
        .take(200)
        .collect()
}

fn collect(
    geometry: &Geometry,
    depth: usize,
    polygons: &mut Vec<Polygon>,
) -> Result<(), ComputeError> {
    let bad = |reason: String| Err(ComputeError::Region { reason });
    match &geometry.value {
        GeometryValue::Polygon { coordinates } => polygons.push(polygon(coordinates)?),
        GeometryValue::MultiPolygon { coordinates } => {
            for rings in coordinates {
                polygons.push(polygon(rings)?);
            }
        }
        GeometryValue::GeometryCollection { geometries } if depth < MAX_DEPTH => {
            geometries
                .iter()
                .try_for_each(|part| collect(part, depth + 1, polygons))?;
        }
        GeometryValue::GeometryCollection { .. } => {
            return bad(format!(
                "geometry collections are nested more than {MAX_DEPTH} deep"
            ));
        }
        other => {
            return bad(format!(
                "a {} has no area; give Polygon or MultiPolygon",
                other.type_name()
            ));
        }
    }
    let corners: usize = polygons
        .iter()
        .map(|p| p.outer.len() + p.holes.iter().map(Vec::len).sum::<usize>())
        .sum();
    if corners > MAX_CORNERS {
        return bad(format!("more than {MAX_CORNERS} corners; simplify it"));
    }
    Ok(())
}

fn polygon(rings: &[Vec<Position>]) -> Result<Polygon, ComputeError> {
    let corners = |ring: &Vec<Position>| ring.iter().map(corner).collect::<Result<Vec<_>, _>>();
    match rings.split_first() {
        Some((outer, holes)) => Ok(Polygon {
            outer: corners(outer)?,
            holes: holes.iter().map(corners).collect::<Result<_, _>>()?,
        }),
        None => Err(ComputeError::Region {
            reason: "a polygon has no ring".to_owned(),
        }),
    }
}

fn corner(position: &Position) -> Result<[f64; 2], ComputeError> {
    match position.as_slice() {
        [lon, lat, ..] => Ok([*lon, *lat]),
        _ => Err(ComputeError::Region {
            reason: "a corner has fewer than two numbers".to_owned(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = r#"{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1],[0,1],[0,0]]]}"#;

    fn polygon_count(text: &str) -> usize {
        match parse(text).unwrap() {
            Region::Polygons(polygons) => polygons.len(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn geometries_features_and_collections_are_regions() {
        assert_eq!(polygon_count(SQUARE), 1);
        let feature =
            format!(r#"{{"type":"Feature","properties":{{"name":"x"}},"geometry":{SQUARE}}}"#);
        assert_eq!(polygon_count(&feature), 1);
        let empty = r#"{"type":"Feature","properties":null,"geometry":null}"#;
        let collection =
            format!(r#"{{"type":"FeatureCollection","features":[{feature},{empty}]}}"#);
        assert_eq!(polygon_count(&collection), 1);
        let multi = r#"{"type":"MultiPolygon","coordinates":[[[[0,0,5],[1,0,5],[1,1,5]]],[[[2,2],[3,2],[3,3],[2,2]]]]}"#;
        assert_eq!(polygon_count(multi), 2);
        let nested = format!(r#"{{"type":"GeometryCollection","geometries":[{SQUARE}]}}"#);
        assert_eq!(polygon_count(&nested), 1);
    }

    #[test]
    fn what_is_no_region_is_refused_with_the_reason() {
        let reason = |text: &str| parse(text).unwrap_err().to_string();
        assert!(reason("").contains("no GeoJSON"));
        assert!(reason("{}").contains("no GeoJSON"));
        assert!(reason(r#"{"type":"Point","coordinates":[0,0]}"#).contains("a Point has no area"));
        assert!(reason(r#"{"type":"FeatureCollection","features":[]}"#).contains("no Polygon"));
        assert!(reason(r#"{"type":"Polygon","coordinates":[]}"#).contains("no ring"));
        assert!(
            reason(r#"{"type":"Polygon","coordinates":[[[0,0],[1,0]]]}"#)
                .contains("fewer than three")
        );
        assert!(
            reason(r#"{"type":"Polygon","coordinates":[[[0],[1,0],[2,2]]]}"#)
                .contains("fewer than two numbers")
        );
        assert!(reason(&SQUARE.replace("[1,1]", "[1,91]")).contains("no longitude, latitude"));
        assert!(
            reason(&SQUARE.replace("[1,1]", "[500000,4000000]")).contains("no longitude, latitude")
        );
    }

    #[test]
    fn nesting_without_end_is_refused() {
        let deep = (0..200).fold(SQUARE.to_owned(), |inner, _| {
            format!(r#"{{"type":"GeometryCollection","geometries":[{inner}]}}"#)
        });
        assert!(parse(&deep).is_err());
    }

    #[test]
    fn a_file_that_is_none_is_named_in_the_refusal() {
        let error = read(Path::new("/nowhere/region.geojson"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("/nowhere/region.geojson"), "{error}");
        let folder = tempfile::tempdir().unwrap();
        assert!(
            read(folder.path())
                .unwrap_err()
                .to_string()
                .contains("no file")
        );
    }
}
