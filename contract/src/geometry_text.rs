//! Texts of lines and regions: how large they may be, the document of one that is GeoJSON, and what answers call it.
//!
//! The library that reads GeoJSON holds what it knows nothing of as a tree; what a text may hold is counted before it is read.

mod besides;

use std::fmt;

use geojson::GeoJson;
use serde::Deserialize;
use serde::de::{Deserializer, IgnoredAny, SeqAccess, Visitor};

use crate::digest::Digest;

/// Longest text of a line or region, bytes: a million vertices written with 17 digits each.
pub const MAX_TEXT_BYTES: usize = 64 << 20;
/// Most commas, colons and opening brackets in GeoJSON: those of a million vertices of four numbers each, and of what is around them.
const MAX_MARKS: usize = 6_000_000;
/// Longest text that a line or region is called by, bytes: as much as an address holds.
const MAX_NAME_BYTES: usize = 16 << 10;

/// A text that is not too long.
pub(crate) fn within_limit(text: &str) -> Result<&str, String> {
    if text.len() > MAX_TEXT_BYTES {
        let bytes = text.len();
        return Err(format!(
            "{bytes} bytes, at most {MAX_TEXT_BYTES} are taken; simplify it"
        ));
    }
    Ok(text)
}

/// The document of a GeoJSON text.
pub(crate) fn document(text: &str) -> Result<GeoJson, String> {
    let is_mark = |byte: &u8| matches!(byte, b',' | b':' | b'[' | b'{');
    let marks = within_limit(text)?.bytes().filter(|byte| is_mark(byte));
    if marks.count() > MAX_MARKS {
        return Err(format!(
            "it holds more than {MAX_MARKS} numbers, words and lists; simplify it, or leave properties out"
        ));
    }
    besides::check(text)?;
    text.parse()
        .map_err(|e: geojson::Error| format!("it is no GeoJSON: {}", first_line(&e)))
}

fn first_line(error: &dyn fmt::Display) -> String {
    let text = error.to_string();
    let line = text.lines().next().unwrap_or_default();
    line.chars().take(200).collect()
}

/// What answers call a line or region by: its text, or the digest of one that no answer has room for.
pub(crate) fn name(text: &str) -> String {
    if text.len() <= MAX_NAME_BYTES {
        return text.to_owned();
    }
    let digest = Digest::of(text.as_bytes());
    format!("text of {} bytes, sha256 {digest}", text.len())
}

/// Is a GeoJSON text a line, or a feature or collection whose first geometry is one? Of what is no GeoJSON it is false.
pub fn is_line(text: &str) -> bool {
    let outline: Option<Outline> = serde_json::from_str(text).ok();
    let kind = outline.as_ref().and_then(Outline::geometry_kind);
    kind.is_some_and(|kind| kind.ends_with("LineString"))
}

/// Is a GeoJSON text a feature collection? Of what is no GeoJSON it is false.
pub fn is_collection(text: &str) -> bool {
    let outline: Option<Outline> = serde_json::from_str(text).ok();
    outline.and_then(|outline| outline.kind).as_deref() == Some("FeatureCollection")
}

/// Words of a GeoJSON text, without a number of it.
#[derive(Debug, Default, Deserialize)]
struct Outline {
    #[serde(rename = "type")]
    kind: Option<String>,
    geometry: Option<Box<Outline>>,
    #[serde(default)]
    features: First,
}

impl Outline {
    /// That of the first geometry.
    fn geometry_kind(&self) -> Option<&str> {
        match self.kind.as_deref()? {
            "Feature" => self.geometry.as_ref()?.geometry_kind(),
            "FeatureCollection" => self.features.0.as_ref()?.geometry_kind(),
            kind => Some(kind),
        }
    }
}

/// The first of a list that has a geometry.
#[derive(Debug, Default)]
struct First(Option<Box<Outline>>);

impl<'de> Deserialize<'de> for First {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Self(None))
    }
}

impl<'de> Visitor<'de> for First {
    type Value = Self;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of features")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut all: A) -> Result<Self, A::Error> {
        while let Some(one) = all.next_element::<Outline>()? {
            if one.geometry_kind().is_some() {
                self.0 = Some(Box::new(one));
                break;
            }
        }
        while all.next_element::<IgnoredAny>()?.is_some() {}
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_collections_are_told_by_their_words() {
        let line = r#"{"coordinates":[[0,0],[1,1]],"type":"LineString"}"#;
        let square = r#"{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1],[0,0]]]}"#;
        let feature = |geometry: &str| {
            format!(
                r#"{{"type":"Feature","properties":{{"type":"LineString"}},"geometry":{geometry}}}"#
            )
        };
        let collection = |features: &[String]| {
            format!(
                r#"{{"type":"FeatureCollection","features":[{}]}}"#,
                features.join(",")
            )
        };
        let empty = feature("null");
        let lines = collection(&[empty.clone(), feature(line), feature(square)]);
        for text in [
            line,
            &feature(line),
            &lines,
            r#"{"type":"MultiLineString"}"#,
        ] {
            assert!(is_line(text), "{text}");
        }
        let squares = collection(&[feature(square), feature(line)]);
        for text in [
            square,
            &feature(square),
            &squares,
            &empty,
            "",
            "{",
            "LINESTRING(0 0,1 1)",
        ] {
            assert!(!is_line(text), "{text}");
        }
        assert!(is_collection(&lines) && is_collection(&collection(&[])));
        assert!(!is_collection(line) && !is_collection(&feature(line)) && !is_collection("{}"));
    }

    #[test]
    fn what_would_take_much_memory_is_refused_before_it_is_read() {
        let many = |one: &str| format!(r#"{{"type":"Point","x":[{}0]}}"#, one.repeat(3_000_000));
        for text in [many("0,0,"), many("[],"), many(r#"{"":0},"#)] {
            let refused = document(&text).unwrap_err();
            assert!(refused.contains("more than 6000000"), "{refused}");
        }
        // Few marks, and a tree that takes a hundred times the text.
        let tree = format!(
            r#"{{"type":"Point","coordinates":[0,0],"x":[{}0]}}"#,
            r#"{"":0},"#.repeat(1_700_000)
        );
        let refused = document(&tree).unwrap_err();
        assert!(refused.contains("besides coordinates"), "{refused}");
        let long = format!(r#"{{"type":"Point"{}}}"#, " ".repeat(MAX_TEXT_BYTES));
        assert!(document(&long).unwrap_err().contains("at most 67108864"));
    }

    #[test]
    fn a_name_is_its_text_as_long_as_an_answer_has_room_for_it() {
        let longest = "x".repeat(MAX_NAME_BYTES);
        assert_eq!(name(&longest), longest);
        let (a, b) = (name(&format!("{longest}a")), name(&format!("{longest}b")));
        assert!(a.starts_with("text of 16385 bytes, sha256 ") && a.len() < 100 && a != b);
    }
}
