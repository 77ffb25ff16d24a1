//! Where a question is about, as SQL writes it: a text in, a place, a line or a region out.

use std::str::FromStr;

use contract::ContractError;
use contract::geometry::{AskedGeometry, AskedLine, Sampling};
use contract::geometry_text;
use contract::grid::LonLatDeg;
use contract::region::AskedRegion;

/// A place, a line or a region.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Place {
    Point(LonLatDeg),
    Line(AskedLine),
    Region(AskedRegion),
}

impl FromStr for Place {
    type Err = ContractError;

    /// Parses `LON,LAT`, `LON,LAT;LON,LAT;...`, well-known text and GeoJSON of lines, and what names a region or draws it.
    fn from_str(text: &str) -> Result<Self, ContractError> {
        let start = text.trim_start();
        let word: String = start
            .chars()
            .take_while(char::is_ascii_alphabetic)
            .collect();
        let word = word.to_ascii_uppercase();
        let is_line = match word.trim_end_matches(['Z', 'M']) {
            "LINESTRING" | "MULTILINESTRING" => true,
            "" if start.starts_with('{') => geometry_text::is_line(text),
            "" => text.contains(';'),
            _ => false,
        };
        if is_line {
            return text.parse().map(Self::Line);
        }
        match text.parse() {
            Ok(place) => Ok(Self::Point(place)),
            Err(_no_place) => text.parse().map(Self::Region),
        }
    }
}

impl From<Place> for AskedGeometry {
    fn from(place: Place) -> Self {
        match place {
            Place::Point(place) => Self::point(place, Sampling::default()),
            Place::Line(line) => line.into(),
            Place::Region(region) => region.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_lines_and_regions_are_told_apart() {
        let kind = |text: &str| match text.parse() {
            Ok(Place::Point(_)) => "place",
            Ok(Place::Line(_)) => "line",
            Ok(Place::Region(_)) => "region",
            Err(_) => "nothing",
        };
        let square = r#"{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1],[0,0]]]}"#;
        let track = r#"{"type":"LineString","coordinates":[[0,0],[1,1]]}"#;
        for (text, wanted) in [
            ("-30,40", "place"),
            ("0,0;1,1", "line"),
            ("LINESTRING(0 0,1 1)", "line"),
            (" linestring (0 0, 1 1)", "line"),
            ("MULTILINESTRING((0 0,1 1),(2 2,3 3))", "line"),
            (track, "line"),
            ("global", "region"),
            ("0,0,10,10", "region"),
            ("POLYGON((0 0,1 0,1 1,0 0))", "region"),
            (square, "region"),
            ("0,0;1", "nothing"),
            ("nowhere", "nothing"),
        ] {
            assert_eq!(kind(text), wanted, "{text}");
        }
    }
}
