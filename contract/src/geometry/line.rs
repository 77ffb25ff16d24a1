//! Lines on the earth: great-circle arcs from vertex to vertex; from GeoJSON, well-known text, or pairs of numbers.

use std::str::FromStr;

use geojson::{GeoJson, GeometryValue, Position};
use serde::Serialize;
use wkt::Wkt;

use crate::ContractError;
use crate::geometry_text::{self, document, within_limit};
use crate::grid::LonLatDeg;

/// Most vertices that the parts of a line may have together.
pub const MAX_VERTICES: usize = 1_000_000;
/// Two places are opposite to one another if they are nearer to half a turn apart than this, radians: 6 m.
const OPPOSITE_RAD: f64 = 1e-6;

/// Parts of a line, each two vertices or more; between two vertices it takes the shorter way along the great circle of the
/// sphere, so that it may cross the date line and pass a pole.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Line(Vec<Vec<LonLatDeg>>);

impl Line {
    /// A line from the vertices of its parts, `[lon, lat]` in degrees.
    ///
    /// # Errors
    /// No part, more than [`MAX_VERTICES`], vertices that are no places, a part without length, or an edge between opposite
    /// places, which does not say which way it goes.
    pub fn new(parts: &[Vec<[f64; 2]>]) -> Result<Self, ContractError> {
        let bad = |reason: String| Err(ContractError::invalid("line", "", reason));
        if parts.is_empty() {
            return bad("it has no part".to_owned());
        }
        let count: usize = parts.iter().map(Vec::len).sum();
        if count > MAX_VERTICES {
            return bad(format!(
                "{count} vertices, at most {MAX_VERTICES} are taken; simplify it"
            ));
        }
        let mut all = Vec::with_capacity(parts.len());
        for part in parts {
            let mut places: Vec<LonLatDeg> = Vec::with_capacity(part.len());
            for &[lon, lat] in part {
                let place = LonLatDeg::new(lon, lat)?;
                // A vertex that is written twice is one.
                if places.last() != Some(&place) {
                    places.push(place);
                }
            }
            if places.len() < 2 {
                return bad("a line has two different places or more".to_owned());
            }
            if let Some(edge) = places.windows(2).find(|edge| is_opposite(edge[0], edge[1])) {
                return bad(format!(
                    "{},{} and {},{} lie opposite to one another: put a vertex between them that says which way it goes",
                    edge[0].lon, edge[0].lat, edge[1].lon, edge[1].lat
                ));
            }
            all.push(places);
        }
        Ok(Self(all))
    }

    /// Vertices of each part.
    pub fn parts(&self) -> &[Vec<LonLatDeg>] {
        &self.0
    }

    /// From vertex to vertex.
    pub fn edges(&self) -> impl Iterator<Item = [LonLatDeg; 2]> + '_ {
        let edges = self.0.iter().flat_map(|part| part.windows(2));
        edges.map(|edge| [edge[0], edge[1]])
    }
}

/// Unit vector of a place.
fn unit(place: LonLatDeg) -> [f64; 3] {
    let (lon, lat) = (place.lon.to_radians(), place.lat.to_radians());
    [lat.cos() * lon.cos(), lat.cos() * lon.sin(), lat.sin()]
}

fn is_opposite(from: LonLatDeg, to: LonLatDeg) -> bool {
    let (a, b) = (unit(from), unit(to));
    let sum = (0..3).map(|i| (a[i] + b[i]).powi(2)).sum::<f64>();
    sum.sqrt() < OPPOSITE_RAD
}

impl FromStr for Line {
    type Err = ContractError;

    /// Parses `LON,LAT;LON,LAT;...`, GeoJSON (`LineString`, `MultiLineString`, a feature or collection of them) or well-known text
    /// (LINESTRING, MULTILINESTRING).
    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let told = |reason: String| ContractError::invalid("line", s, reason);
        let text = within_limit(s).map_err(told)?.trim();
        let parts = if text.starts_with('{') {
            from_geojson(text)
        } else if text.starts_with(|c: char| c.is_ascii_alphabetic()) {
            from_wkt(text)
        } else {
            from_pairs(text)
        };
        Self::new(&parts.map_err(told)?).map_err(|error| match error {
            ContractError::Invalid { what, text, reason } => {
                let text = if text.is_empty() { s } else { &text };
                ContractError::invalid(what, text, reason)
            }
        })
    }
}

/// A line and its name in answers.
#[derive(Debug, Clone, PartialEq)]
pub struct AskedLine {
    /// Its shape.
    pub line: Line,
    /// The text or file that it was asked for with; of a long text its digest.
    pub name: String,
}

impl FromStr for AskedLine {
    type Err = ContractError;

    /// Parses what [`Line`] does.
    fn from_str(s: &str) -> Result<Self, Self::Err> {
        Ok(Self {
            line: s.parse()?,
            name: geometry_text::name(s),
        })
    }
}

type Parts = Vec<Vec<[f64; 2]>>;

fn from_pairs(text: &str) -> Result<Parts, String> {
    let pair = |pair: &str| {
        let (lon, lat) = pair.split_once(',')?;
        Some([lon.trim().parse().ok()?, lat.trim().parse().ok()?])
    };
    let pairs = text.split(';').take(MAX_VERTICES + 1);
    let vertices: Option<Vec<[f64; 2]>> = pairs.map(pair).collect();
    vertices.map(|vertices| vec![vertices]).ok_or_else(|| {
        "LON,LAT;LON,LAT;... in degrees, GeoJSON, LINESTRING or MULTILINESTRING text".to_owned()
    })
}

fn from_geojson(text: &str) -> Result<Parts, String> {
    let mut parts = vec![];
    match &document(text)? {
        GeoJson::Geometry(geometry) => collect(&geometry.value, &mut parts)?,
        GeoJson::Feature(feature) => {
            let mut own = feature.geometry.iter();
            own.try_for_each(|geometry| collect(&geometry.value, &mut parts))?;
        }
        GeoJson::FeatureCollection(collection) => {
            let mut all = collection
                .features
                .iter()
                .filter_map(|f| f.geometry.as_ref());
            all.try_for_each(|geometry| collect(&geometry.value, &mut parts))?;
        }
    }
    Ok(parts)
}

fn collect(value: &GeometryValue, parts: &mut Parts) -> Result<(), String> {
    let vertex = |position: &Position| match position.as_slice() {
        [lon, lat, ..] => Ok([*lon, *lat]),
        _ => Err("a vertex has fewer than two numbers".to_owned()),
    };
    let part = |line: &Vec<Position>| line.iter().map(vertex).collect::<Result<Vec<_>, _>>();
    match value {
        GeometryValue::LineString { coordinates } => parts.push(part(coordinates)?),
        GeometryValue::MultiLineString { coordinates } => {
            for line in coordinates {
                parts.push(part(line)?);
            }
        }
        other => return Err(no_line(other.type_name())),
    }
    Ok(())
}

fn no_line(kind: &str) -> String {
    format!("a {kind} is no line; give LineString or MultiLineString")
}

fn from_wkt(text: &str) -> Result<Parts, String> {
    let word = text.split(|c: char| !c.is_ascii_alphabetic()).next();
    let kind = word.unwrap_or_default().to_ascii_uppercase();
    // The parser goes down a collection as deep as its text has it, and a million fit into one: the stack would overflow.
    if kind.starts_with("GEOMETRYCOLLECTION") {
        return Err(no_line(&kind));
    }
    let parsed: Wkt<f64> = text
        .parse()
        .map_err(|e| format!("it is no well-known text: {e}"))?;
    // The parser would leave out what follows the first geometry.
    let brackets = |c: char| text.matches(c).count();
    let ends = text.ends_with(')') && brackets('(') == brackets(')');
    let lines = match &parsed {
        Wkt::LineString(line) if ends && brackets('(') == 1 => vec![line],
        Wkt::MultiLineString(lines) if ends && brackets('(') == lines.line_strings().len() + 1 => {
            lines.line_strings().iter().collect()
        }
        Wkt::LineString(_) | Wkt::MultiLineString(_) => {
            return Err("it does not end where its first geometry ends".to_owned());
        }
        _ => return Err(no_line(text.split([' ', '(']).next().unwrap_or_default())),
    };
    let part = |line: &&wkt::types::LineString<f64>| {
        let vertices = line.coords().iter();
        vertices.map(|vertex| [vertex.x, vertex.y]).collect()
    };
    Ok(lines.iter().map(part).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(text: &str) -> Line {
        text.parse().unwrap()
    }

    fn reason(text: &str) -> String {
        text.parse::<Line>().unwrap_err().to_string()
    }

    #[test]
    fn the_same_line_is_the_same_however_it_is_written() {
        let own = line("100,0;110.5,-20;190,30");
        for same in [
            "LINESTRING(100 0,110.5 -20,190 30)",
            "linestring z (100 0 5, 110.5 -20 5, -170 30 5)",
            r#"{"type":"LineString","coordinates":[[100,0],[110.5,-20],[-170,30]]}"#,
            r#"{"type":"Feature","properties":{},"geometry":{"type":"LineString","coordinates":[[100,0],[110.5,-20],[190,30]]}}"#,
            "100,0;100,0;110.5,-20;190,30",
        ] {
            assert_eq!(line(same), own, "{same}");
        }
        let two = line("MULTILINESTRING((0 0,1 1),(5 5,6 6,7 7))");
        assert_eq!((two.parts().len(), two.edges().count()), (2, 3));
    }

    #[test]
    fn what_is_no_line_is_refused_with_the_reason() {
        assert!(reason("5,5").contains("two different places"));
        assert!(reason("5,5;5,5").contains("two different places"));
        assert!(reason("365,5;5,5").contains("two different places"));
        assert!(reason("LINESTRING EMPTY").contains("does not end"));
        assert!(reason("MULTILINESTRING((0 0,1 1),(5 5))").contains("two different places"));
        assert!(reason("0,0;180,0").contains("opposite"));
        assert!(reason("0,90;5,-90").contains("opposite"));
        assert!(reason("0,0;1,91").contains("latitude"));
        assert!(reason("0,0;NaN,1").contains("place"));
        assert!(reason("").contains("LON,LAT"));
        assert!(reason("1 2;3 4").contains("LON,LAT"));
        assert!(reason("POLYGON((0 0,1 0,1 1,0 0))").contains("no line"));
        assert!(reason(r#"{"type":"Point","coordinates":[0,0]}"#).contains("no line"));
        assert!(reason(r#"{"type":"FeatureCollection","features":[]}"#).contains("no part"));
        assert!(reason("LINESTRING(0 0,1 1),LINESTRING(5 5,6 6)").contains("does not end"));
        assert!(reason("LINESTRING(0 0,1 1) LINESTRING(5 5,6 6)").contains("does not end"));
        assert!(reason("GEOMETRYCOLLECTION(LINESTRING(0 0,1 1))").contains("no line"));
    }

    #[test]
    fn a_collection_as_deep_as_its_text_is_refused_and_overflows_no_stack() {
        for word in [
            "GEOMETRYCOLLECTION(",
            "GeometryCollection Z (",
            "geometrycollectionzm(",
        ] {
            let told = reason(&word.repeat(1_000_000));
            assert!(told.contains("no line"), "{told}");
        }
    }

    #[test]
    fn a_million_vertices_are_taken_and_one_more_is_refused() {
        let vertices = |count: u32| (0..count).map(|i| [f64::from(i % 300), f64::from(i % 80)]);
        assert!(Line::new(&[vertices(1_000_000).collect()]).is_ok());
        let refused = Line::new(&[vertices(1_000_001).collect()]).unwrap_err();
        assert!(refused.to_string().contains("simplify"), "{refused}");
    }
}
