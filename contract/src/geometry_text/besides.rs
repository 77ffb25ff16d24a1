//! What a GeoJSON text holds besides coordinates: counted as it is passed over, nothing of it kept.
//!
//! The library that reads GeoJSON has coordinates as numbers, and everything that it does not know as a tree, of which a short text can
//! hold gigabytes.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// Most values besides coordinates: a hundred features, each with a thousand properties.
const MAX_VALUES: usize = 100_000;

/// # Errors
/// More than 100 000 values besides coordinates. What is no JSON is left to who reads it.
pub(super) fn check(text: &str) -> Result<(), String> {
    let mut values = 0;
    let mut json = serde_json::Deserializer::from_str(text);
    let walk = Walk {
        at: Level::Document,
        values: &mut values,
    };
    let walked = walk.deserialize(&mut json);
    if walked.is_err() && values > MAX_VALUES {
        return Err(format!(
            "it holds more than {MAX_VALUES} values besides coordinates: leave properties out"
        ));
    }
    Ok(())
}

/// What members of an object are read as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Level {
    Document,
    Feature,
    Geometry,
    /// What nobody asks for.
    Other,
}

impl Level {
    /// That of a member's value; none of coordinates.
    fn of_member(self, name: &str) -> Option<Self> {
        match (self, name) {
            (Self::Document | Self::Geometry, "coordinates") => None,
            (Self::Document | Self::Feature, "geometry")
            | (Self::Document | Self::Geometry, "geometries") => Some(Self::Geometry),
            (Self::Document, "features") => Some(Self::Feature),
            _ => Some(Self::Other),
        }
    }
}

/// Counts values up to the limit, and ends there.
struct Walk<'a> {
    at: Level,
    values: &'a mut usize,
}

impl Walk<'_> {
    fn count<E: Error>(&mut self) -> Result<(), E> {
        *self.values += 1;
        if *self.values > MAX_VALUES {
            return Err(E::custom("too many values"));
        }
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for Walk<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(mut self, deserializer: D) -> Result<(), D::Error> {
        self.count()?;
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Walk<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any value")
    }

    fn visit_bool<E>(self, _value: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E>(self, _value: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_u64<E>(self, _value: u64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E>(self, _value: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E>(self, _value: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut all: A) -> Result<(), A::Error> {
        let (at, values) = (self.at, self.values);
        while let Some(()) = all.next_element_seed(Walk { at, values })? {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut all: A) -> Result<(), A::Error> {
        let values = self.values;
        while let Some(name) = all.next_key::<std::borrow::Cow<'de, str>>()? {
            match self.at.of_member(&name) {
                None => drop(all.next_value::<IgnoredAny>()?),
                Some(at) => all.next_value_seed(Walk { at, values })?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_not_counted_wherever_they_are_read_as_such() {
        let many = format!("[{}[0,0]]", "[0,0],".repeat(MAX_VALUES));
        let geometry = format!(r#"{{"coordinates":{many},"type":"LineString"}}"#);
        let feature =
            format!(r#"{{"type":"Feature","properties":{{"a":[1]}},"geometry":{geometry}}}"#);
        for text in [
            &geometry,
            &feature,
            &format!(r#"{{"type":"FeatureCollection","features":[{feature},{feature}]}}"#),
            &format!(r#"{{"type":"GeometryCollection","geometries":[{geometry}]}}"#),
        ] {
            assert_eq!(check(text), Ok(()));
        }
        for text in [
            format!(r#"{{"type":"Point","x":{many}}}"#),
            format!(r#"{{"type":"Feature","properties":{{"coordinates":{many}}}}}"#),
            format!(r#"{{"type":"Feature","geometry":{{"geometry":{geometry}}}}}"#),
            format!(r#"{{"features":[{{"coordinates":{many}}}]}}"#),
            format!(
                r#"{{"type":"Point","x":[{}{{}}]}}"#,
                r#"{"":null},"#.repeat(MAX_VALUES)
            ),
        ] {
            let refused = check(&text).unwrap_err();
            assert!(refused.contains("besides coordinates"), "{refused}");
        }
        // What is no JSON is told by who reads it.
        for text in ["", "{", "[[[", "{\"a\":1}}"] {
            assert_eq!(check(text), Ok(()));
        }
    }
}
