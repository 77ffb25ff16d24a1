//! Polygons as text: GeoJSON (RFC 7946) and well-known text (OGC 06-103r4) in, corners as they are written out.
//!
//! Left out on purpose: other coordinate systems than longitude and latitude, and lines and points, which have no area.

use geojson::{GeoJson, Geometry, GeometryValue, Position};
use wkt::Wkt;
use wkt::types::{Coord, LineString};

use super::{MAX_CORNERS, Polygon};
use crate::ContractError;
use crate::geometry_text::{document, within_limit};

/// Deepest nesting of geometry collections.
const MAX_DEPTH: usize = 8;
/// Why a polygon without a corner is no region.
const EMPTY: &str = "the polygon is empty";
/// First words of well-known text; those without area are refused by name.
const WKT_WORDS: [&str; 9] = [
    "POLYGON",
    "MULTIPOLYGON",
    "POINT",
    "MULTIPOINT",
    "LINESTRING",
    "LINEARRING",
    "MULTILINESTRING",
    "GEOMETRYCOLLECTION",
    "SRID",
];

/// The polygons of a text; none if it looks neither like GeoJSON nor like well-known text.
pub(super) fn polygons(text: &str) -> Option<Result<Vec<Polygon>, ContractError>> {
    let text = text.trim();
    let word: String = text
        .chars()
        .take_while(char::is_ascii_alphabetic)
        .map(|c| c.to_ascii_uppercase())
        .collect();
    let parsed = if text.starts_with('{') {
        geojson_polygons(text)
    } else if WKT_WORDS.contains(&word.trim_end_matches(['Z', 'M'])) {
        within_limit(text).and_then(|text| wkt_polygons(&word, text))
    } else {
        return None;
    };
    let checked = parsed.and_then(checked);
    Some(checked.map_err(|reason| ContractError::invalid("region", text, reason)))
}

pub(super) fn checked(polygons: Vec<Polygon>) -> Result<Vec<Polygon>, String> {
    if polygons.is_empty() {
        return Err("it holds no Polygon or MultiPolygon".to_owned());
    }
    let rings = |p: &Polygon| p.outer.len() + p.holes.iter().map(Vec::len).sum::<usize>();
    if polygons.iter().map(rings).sum::<usize>() > MAX_CORNERS {
        return Err(format!("more than {MAX_CORNERS} corners; simplify it"));
    }
    Ok(polygons)
}

/// A geometry, a feature or a collection of features: their polygons together.
fn geojson_polygons(text: &str) -> Result<Vec<Polygon>, String> {
    match &document(text)? {
        GeoJson::Geometry(geometry) => collected([geometry]),
        GeoJson::Feature(feature) => collected(&feature.geometry),
        GeoJson::FeatureCollection(collection) => {
            let features = collection.features.iter();
            collected(features.filter_map(|feature| feature.geometry.as_ref()))
        }
    }
}

/// The polygons of some geometries together; none of no geometry.
pub(super) fn collected<'a>(
    geometries: impl IntoIterator<Item = &'a Geometry>,
) -> Result<Vec<Polygon>, String> {
    let (mut polygons, mut count) = (vec![], 0);
    for geometry in geometries {
        collect(geometry, 0, &mut polygons)?;
        count += 1;
    }
    // What has no area is refused: what is left without a polygon are lists of none.
    if polygons.is_empty() && count > 0 {
        return Err(EMPTY.to_owned());
    }
    Ok(polygons)
}

fn collect(geometry: &Geometry, depth: usize, polygons: &mut Vec<Polygon>) -> Result<(), String> {
    match &geometry.value {
        GeometryValue::Polygon { coordinates } => polygons.push(geojson_polygon(coordinates)?),
        GeometryValue::MultiPolygon { coordinates } => {
            for rings in coordinates {
                polygons.push(geojson_polygon(rings)?);
            }
        }
        GeometryValue::GeometryCollection { geometries } if depth < MAX_DEPTH => {
            let mut parts = geometries.iter();
            parts.try_for_each(|part| collect(part, depth + 1, polygons))?;
        }
        GeometryValue::GeometryCollection { .. } => {
            return Err(format!(
                "geometry collections are nested more than {MAX_DEPTH} deep"
            ));
        }
        other => return Err(no_area(other.type_name())),
    }
    Ok(())
}

fn no_area(kind: &str) -> String {
    format!("a {kind} has no area; give Polygon or MultiPolygon")
}

fn geojson_polygon(rings: &[Vec<Position>]) -> Result<Polygon, String> {
    let corner = |position: &Position| match position.as_slice() {
        [lon, lat, ..] => Ok([*lon, *lat]),
        _ => Err("a corner has fewer than two numbers".to_owned()),
    };
    let ring = |ring: &Vec<Position>| ring.iter().map(corner).collect();
    polygon(rings.iter().map(ring).collect::<Result<_, _>>()?)
}

/// The first ring is the outer one.
fn polygon(mut rings: Vec<Vec<[f64; 2]>>) -> Result<Polygon, String> {
    if rings.first().is_none_or(Vec::is_empty) {
        return Err(EMPTY.to_owned());
    }
    let outer = rings.remove(0);
    Ok(Polygon {
        outer,
        holes: rings,
    })
}

fn wkt_polygons(word: &str, text: &str) -> Result<Vec<Polygon>, String> {
    if word == "SRID" {
        return Err(
            "leave SRID=…; away: regions are longitude, latitude in degrees (EPSG:4326)".to_owned(),
        );
    }
    if !word.trim_end_matches(['Z', 'M']).ends_with("POLYGON") {
        return Err(no_area(word));
    }
    if is_empty(text) {
        return Err(EMPTY.to_owned());
    }
    if !is_one_expression(text) {
        return Err(
            "it does not end where its first geometry ends; give one MULTIPOLYGON".to_owned(),
        );
    }
    let parsed: Wkt<f64> = text
        .parse()
        .map_err(|e| format!("it is no well-known text: {e}"))?;
    match parsed {
        Wkt::Polygon(rings) => Ok(vec![wkt_polygon(rings.rings())?]),
        Wkt::MultiPolygon(polygons) => polygons
            .polygons()
            .iter()
            .map(|rings| wkt_polygon(rings.rings()))
            .collect(),
        _ => Err(no_area(word)),
    }
}

fn wkt_polygon(rings: &[LineString<f64>]) -> Result<Polygon, String> {
    let corner = |corner: &Coord<f64>| [corner.x, corner.y];
    let ring = |ring: &LineString<f64>| ring.coords().iter().map(corner).collect();
    polygon(rings.iter().map(ring).collect())
}

/// Does a text say that there is nothing: `POLYGON EMPTY`, `MULTIPOLYGON Z (EMPTY)`?
fn is_empty(text: &str) -> bool {
    let words = text.split(|c: char| c.is_whitespace() || "(,)".contains(c));
    let mut words = words.filter(|word| !word.is_empty()).skip(1).peekable();
    let is_word = |word: &str| ["EMPTY", "Z", "M", "ZM"].contains(&&*word.to_ascii_uppercase());
    words.peek().is_some() && words.all(is_word)
}

/// Is the bracket that is opened first closed at the very end? The parser would leave out what follows.
fn is_one_expression(text: &str) -> bool {
    let mut depth = 0i64;
    let mut closed_at = None;
    for (at, c) in text.char_indices() {
        depth += match c {
            '(' => 1,
            ')' => -1,
            _ => 0,
        };
        if c == ')' && depth == 0 && closed_at.is_none() {
            closed_at = Some(at + 1);
        }
    }
    depth == 0 && closed_at == Some(text.len())
}

#[cfg(test)]
mod tests {
    use crate::region::Region;

    const SQUARE: &str = r#"{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1],[0,1],[0,0]]]}"#;

    fn polygon_count(text: &str) -> usize {
        match text.parse().unwrap() {
            Region::Polygons(polygons) => polygons.len(),
            other => panic!("{other:?}"),
        }
    }

    fn reason(text: &str) -> String {
        text.parse::<Region>().unwrap_err().to_string()
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
    fn well_known_text_is_the_region_of_the_same_geojson() {
        let region = |text: &str| text.parse::<Region>().unwrap();
        for same in [
            "POLYGON((0 0,1 0,1 1,0 1,0 0))",
            "polygon ((0 0, 1 0, 1 1, 0 1, 0 0))",
            " POLYGON Z ((0 0 7, 1 0 7, 1 1 7, 0 1 7, 0 0 7)) ",
            "MULTIPOLYGON(((0 0,1 0,1 1,0 1,0 0)))",
        ] {
            assert_eq!(region(same), region(SQUARE), "{same}");
        }
        let holed = region("POLYGON((0 0,9 0,9 9,0 9,0 0),(1 1,2 1,2 2,1 1))");
        let Region::Polygons(polygons) = holed else {
            panic!("{holed:?}")
        };
        assert_eq!((polygons.len(), polygons[0].holes.len()), (1, 1));
    }

    #[test]
    fn what_is_no_region_is_refused_with_the_reason() {
        assert!(reason("{}").contains("no GeoJSON"));
        assert!(reason(r#"{"type":"Point","coordinates":[0,0]}"#).contains("a Point has no area"));
        assert!(reason(r#"{"type":"FeatureCollection","features":[]}"#).contains("no Polygon"));
        let short = r#"{"type":"Polygon","coordinates":[[[0],[1,0],[2,2]]]}"#;
        assert!(reason(short).contains("fewer than two numbers"));
        assert!(reason("POINT(0 0)").contains("a POINT has no area"));
        assert!(reason("LINESTRING(0 0,1 1)").contains("a LINESTRING has no area"));
        assert!(reason("GEOMETRYCOLLECTION(POLYGON((0 0,1 0,1 1)))").contains("no area"));
        assert!(reason("SRID=3857;POLYGON((0 0,1 0,1 1,0 0))").contains("EPSG:4326"));
        assert!(reason("POLYGON((0 0,1 0").contains("does not end"));
        assert!(reason("POLYGON((0 zero,1 0,1 1,0 0))").contains("no well-known text"));
    }

    #[test]
    fn a_polygon_without_a_corner_is_told_to_be_empty() {
        for text in [
            "POLYGON EMPTY",
            "polygon z empty",
            "MULTIPOLYGON EMPTY",
            " MULTIPOLYGON (EMPTY) ",
            "POLYGON(EMPTY)",
            r#"{"type":"Polygon","coordinates":[]}"#,
            r#"{"type":"Polygon","coordinates":[[]]}"#,
            r#"{"type":"MultiPolygon","coordinates":[]}"#,
            r#"{"type":"MultiPolygon","coordinates":[[[[0,0],[1,0],[1,1],[0,0]]],[]]}"#,
            r#"{"type":"Feature","properties":null,"geometry":{"type":"Polygon","coordinates":[]}}"#,
            r#"{"type":"GeometryCollection","geometries":[]}"#,
        ] {
            let told = reason(text);
            assert!(told.contains("the polygon is empty"), "{text}: {told}");
        }
        let unknown = reason(r#"{"type":"Feature","properties":null,"geometry":null}"#);
        assert!(unknown.contains("no Polygon"), "{unknown}");
        // An empty list beside polygons adds nothing to them.
        let none = r#"{"type":"MultiPolygon","coordinates":[]}"#;
        let beside = format!(r#"{{"type":"GeometryCollection","geometries":[{none},{SQUARE}]}}"#);
        assert_eq!(polygon_count(&beside), 1);
    }

    #[test]
    fn a_second_geometry_in_a_text_is_not_left_out_in_silence() {
        for two in [
            "POLYGON((0 0,1 0,1 1,0 0)), POLYGON((5 5,6 5,6 6,5 5))",
            "POLYGON((0 0,1 0,1 1,0 0)) POLYGON((5 5,6 5,6 6,5 5))",
            "POLYGON((0 0,1 0,1 1,0 0)),((5 5,6 5,6 6,5 5))",
        ] {
            assert!(
                reason(two).contains("one MULTIPOLYGON"),
                "{two}: {}",
                reason(two)
            );
        }
    }

    #[test]
    fn nesting_without_end_is_refused() {
        let deep = (0..200).fold(SQUARE.to_owned(), |inner, _| {
            format!(r#"{{"type":"GeometryCollection","geometries":[{inner}]}}"#)
        });
        assert!(deep.parse::<Region>().is_err());
        let brackets = format!("POLYGON{}{}", "(".repeat(100_000), ")".repeat(100_000));
        assert!(brackets.parse::<Region>().is_err());
    }
}
