//! Parts of an address as typed values, with the reason as JSON where they are not.

use std::fmt;
use std::str::FromStr;

use axum::extract::{FromRequestParts, Path, Query};
use axum::http::Uri;
use axum::http::request::Parts;
use contract::ContractError;
use contract::time::TimeMs;
use serde::de::{DeserializeOwned, Deserializer, Error as _, IgnoredAny, MapAccess, Visitor};

use crate::error::ServerError;

/// Longest query that is taken apart, bytes: the longest real one is a line of 500 vertices, every sign escaped.
const MAX_QUERY_BYTES: usize = 16 << 10;

/// The parts of the path.
#[derive(Debug)]
pub(crate) struct UrlPath<T>(pub T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for UrlPath<T> {
    type Rejection = ServerError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ServerError> {
        match Path::from_request_parts(parts, state).await {
            Ok(Path(value)) => Ok(Self(value)),
            Err(rejection) => Err(ServerError::Address {
                reason: rejection.body_text(),
            }),
        }
    }
}

/// The parameters after the question mark; every field is an optional text that its route parses.
#[derive(Debug)]
pub(crate) struct UrlQuery<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for UrlQuery<T> {
    type Rejection = ServerError;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Self, ServerError> {
        Self::of(&parts.uri)
    }
}

impl<T: DeserializeOwned> UrlQuery<T> {
    /// Those of an address.
    pub(crate) fn of(uri: &Uri) -> Result<Self, ServerError> {
        if uri
            .query()
            .is_some_and(|query| query.len() > MAX_QUERY_BYTES)
        {
            return Err(ServerError::Address {
                reason: format!("the query is longer than {MAX_QUERY_BYTES} bytes"),
            });
        }
        match Query::try_from_uri(uri) {
            Ok(Query(value)) => Ok(Self(value)),
            Err(rejection) => Err(ServerError::Address {
                reason: rejection.body_text(),
            }),
        }
    }
}

/// What nobody knows of a query, which is refused: what is misspelt would be answered as if it were not there. As the last of
/// the flattened parts of a query, or as all of it where there are no parameters.
#[derive(Debug, Default)]
pub(crate) struct NoOthers;

impl<'de> serde::Deserialize<'de> for NoOthers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Self)
    }
}

impl<'de> Visitor<'de> for NoOthers {
    type Value = Self;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("no other parameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self, A::Error> {
        match map.next_entry::<String, IgnoredAny>()? {
            None => Ok(self),
            Some((name, _value)) => Err(A::Error::custom(format!(
                "unknown parameter `{name}`; /api/openapi.json has those of every address"
            ))),
        }
    }
}

/// # Errors
/// One of some parameters, which say what the request carries, is there too.
pub(crate) fn left_out(are_there: &[(&'static str, bool)]) -> Result<(), ServerError> {
    match are_there.iter().find(|(_name, is_there)| *is_there) {
        None => Ok(()),
        Some((name, _)) => Err(ServerError::Address {
            reason: format!("the geometry is in the body: leave {name} out"),
        }),
    }
}

/// A whole number, decimal digits only.
pub(crate) fn whole_number(
    what: &'static str,
    text: &str,
    valid: &str,
) -> Result<u32, ServerError> {
    let digits = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let number = if digits { text.parse().ok() } else { None };
    number.ok_or_else(|| ServerError::invalid(what, text, valid))
}

/// A finite number.
pub(crate) fn number(what: &'static str, text: &str, valid: &str) -> Result<f64, ServerError> {
    let number = text.parse().ok().filter(|value: &f64| value.is_finite());
    number.ok_or_else(|| ServerError::invalid(what, text, valid))
}

/// A value, if there is one.
pub(crate) fn parsed<T: FromStr<Err = ContractError>>(
    text: Option<&str>,
) -> Result<Option<T>, ServerError> {
    Ok(text.map(str::parse).transpose()?)
}

/// An instant, if there is one.
pub(crate) fn time(text: Option<&str>) -> Result<Option<TimeMs>, ServerError> {
    // An address with a plus sign in it means a space to a query: the offset of an ISO 8601 time suffers from it.
    text.map(|text| text.replace(' ', "+").parse())
        .transpose()
        .map_err(ServerError::Contract)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_digits_are_whole_numbers() {
        assert_eq!(whole_number("size", "256", "").unwrap(), 256);
        for text in ["", "+1", "-1", "1.0", "1e3", " 1", "٣", "99999999999"] {
            assert!(whole_number("size", text, "").is_err(), "{text:?}");
        }
    }

    #[test]
    fn numbers_must_be_finite() {
        assert_eq!(
            number("lon", "-1.5e1", "").unwrap().to_bits(),
            (-15.0_f64).to_bits()
        );
        for text in ["", "nan", "inf", "-infinity", "1e999", "0x10"] {
            assert!(number("lon", text, "").is_err(), "{text:?}");
        }
    }

    #[test]
    fn an_offset_survives_the_query() {
        let instant = time(Some("2000-01-01T02:00:00 02:00")).unwrap().unwrap();
        assert_eq!(instant.to_string(), "2000-01-01T00:00:00Z");
    }
}
