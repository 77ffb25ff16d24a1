//! Objects of a store of others behind `http:` or `https:`: by name below an address, whole or in part. Nothing can be listed.
//!
//! The host that the user names is asked, wherever it is; where a redirect leads must be a public address, as for files that a
//! notice names ([`super::http`]).

use std::time::Duration;

use async_trait::async_trait;
use bytes::{Bytes, BytesMut};
use cube::foreign::{ForeignError, Objects};
use object_store::GetRange;
use reqwest::header::{CONTENT_LENGTH, CONTENT_RANGE};
use reqwest::{Method, Response, StatusCode};
use retry::Backoff;
use url::Url;

use super::http::{AllowedHost, Web, away, miss};
use super::location::shown;
use super::retry::Miss;
use crate::error::Stop;

/// How long a server that does not answer, or is out of order, is asked again: somebody waits.
const AWAY_LIMIT: Duration = Duration::from_secs(20);

/// Objects below an address.
#[derive(Debug)]
pub(crate) struct WebObjects {
    base: Url,
    web: Web,
}

impl WebObjects {
    /// Objects below an address.
    ///
    /// # Errors
    /// It is no address, or holds what may be secret: it is stored and shown.
    pub(crate) fn new(address: &str) -> Result<Self, ForeignError> {
        let refused = |reason: &str| ForeignError::refused("the address", reason);
        let base = Url::parse(address).map_err(|e| refused(&format!("is no URL: {e}")))?;
        if !base.username().is_empty() || base.password().is_some() {
            return Err(refused(
                "holds a name or a password: it is stored and shown, give it without",
            ));
        }
        if base.query().is_some() || base.fragment().is_some() {
            return Err(refused(
                "has something behind ? or #, which is stored and shown: give it without",
            ));
        }
        let host = AllowedHost::of(&base).ok_or_else(|| refused("has no host"))?;
        let web = Web::new(vec![host]).map_err(|e| refused(&e.to_string()))?;
        Ok(Self { base, web })
    }

    fn url(&self, name: &str) -> Url {
        let mut url = self.base.clone();
        if let Ok(mut parts) = url.path_segments_mut() {
            parts.pop_if_empty().extend(name.split('/'));
        }
        url
    }

    /// The answer for an object, after as many tries as the server needs; none if it is not there.
    async fn answer(
        &self,
        name: &str,
        method: Method,
        range: Option<&str>,
    ) -> Result<Option<Response>, ForeignError> {
        let url = self.url(name);
        let mut pauses = Backoff::within(AWAY_LIMIT).pauses();
        loop {
            let answer = self.web.answer(&url, method.clone(), range).await;
            let failure = match answer {
                Ok(answer) => match answer.status() {
                    StatusCode::OK | StatusCode::PARTIAL_CONTENT => return Ok(Some(answer)),
                    StatusCode::NOT_FOUND => return Ok(None),
                    StatusCode::GONE if method == Method::HEAD => return Ok(None),
                    // What was taken away was written once.
                    StatusCode::GONE => {
                        let reason = "the server answered 410 Gone: it was there and was taken away; have it put back, or write it again";
                        return Err(ForeignError::absent(shown(&url), reason));
                    }
                    status => miss(status),
                },
                Err(failure) => failure,
            };
            let error = failed(&url, failure);
            let pause = pauses.next().filter(|_| error.is_retryable());
            let Some(pause) = pause else {
                return Err(error);
            };
            tokio::time::sleep(pause).await;
        }
    }
}

fn failed(url: &Url, failure: Miss) -> ForeignError {
    let place = shown(url);
    match failure {
        Miss::Away(reason) => ForeignError::away(place, reason),
        Miss::Absent(reason) => ForeignError::denied(
            place,
            format!(
                "{reason}: it is not given to whoever asks, and this program sends no credentials over HTTP"
            ),
        ),
        Miss::Stop(Stop::Rejected(rejection)) => {
            // What a service may be told to allow is not for whoever names an address.
            let reason = rejection.detail.split("; allow it").next();
            ForeignError::refused(place, reason.unwrap_or_default())
        }
        Miss::Stop(Stop::Failed(error)) => ForeignError::away(place, error.to_string()),
    }
}

/// The header that asks for a part.
fn header(part: &GetRange) -> String {
    match part {
        GetRange::Bounded(range) => {
            format!("bytes={}-{}", range.start, range.end.saturating_sub(1))
        }
        GetRange::Offset(start) => format!("bytes={start}-"),
        GetRange::Suffix(length) => format!("bytes=-{length}"),
    }
}

/// Is a part that came the one that was asked for? `said` is its `Content-Range`, `came_bytes` its length; what is asked for without a part
/// is all from the first byte on.
///
/// # Errors
/// What came in its place.
fn check_part(said: Option<&str>, asked: Option<&GetRange>, came_bytes: u64) -> Result<(), String> {
    let whole = GetRange::Offset(0);
    let asked = asked.unwrap_or(&whole);
    let said = said.unwrap_or("a part, and not which one");
    // The end is the byte behind the last one.
    let is_asked = span(said).is_some_and(|(start, end, total)| {
        let is_to_end = total.is_none_or(|total| total == end);
        let is_of_asked = match asked {
            GetRange::Bounded(range) => {
                start == range.start && (end == range.end || end < range.end && is_to_end)
            }
            GetRange::Offset(from) => start == *from && is_to_end,
            GetRange::Suffix(length) => {
                let from = total.unwrap_or(end).saturating_sub(*length);
                start == from && is_to_end
            }
        };
        is_of_asked && end - start == came_bytes
    });
    if is_asked {
        return Ok(());
    }
    Err(format!(
        "the server was asked for {} and answered {said} with {came_bytes} bytes: it, or a proxy before it, gives parts that are not those \
         asked for; have it mended, or copy the store",
        header(asked)
    ))
}

/// The first byte, the one behind the last, and how many there are of the whole, where `bytes 5-8/100` or `bytes 5-8/*` is said.
fn span(said: &str) -> Option<(u64, u64, Option<u64>)> {
    let (unit, said) = said.trim().split_once(' ')?;
    let (part, total) = said.trim().split_once('/')?;
    let (first, last) = part.split_once('-')?;
    let (start, last): (u64, u64) = (first.parse().ok()?, last.parse().ok()?);
    let total = match total {
        "*" => None,
        total => Some(total.parse().ok()?),
    };
    let end = last.checked_add(1).filter(|end| *end > start)?;
    unit.eq_ignore_ascii_case("bytes")
        .then_some((start, end, total))
}

/// The content of an answer, which may say another length than it has.
async fn content(
    mut answer: Response,
    place: &str,
    most_bytes: u64,
) -> Result<Bytes, ForeignError> {
    let too_large = |bytes: u64| {
        let reason = format!("has {bytes} bytes, at most {most_bytes} are read");
        ForeignError::refused(place, reason)
    };
    if let Some(bytes) = answer.content_length().filter(|bytes| *bytes > most_bytes) {
        return Err(too_large(bytes));
    }
    let mut content = BytesMut::new();
    loop {
        let piece = answer.chunk().await;
        let piece = piece.map_err(|e| match away(e) {
            Miss::Away(reason) | Miss::Absent(reason) => ForeignError::away(place, reason),
            Miss::Stop(_) => ForeignError::away(place, "broke off"),
        })?;
        let Some(piece) = piece else {
            return Ok(content.freeze());
        };
        content.extend_from_slice(&piece);
        if content.len() as u64 > most_bytes {
            return Err(too_large(content.len() as u64));
        }
    }
}

#[async_trait]
impl Objects for WebObjects {
    fn place(&self) -> String {
        shown(&self.base).trim_end_matches('/').to_owned()
    }

    async fn get(
        &self,
        name: &str,
        part: Option<GetRange>,
        most_bytes: u64,
    ) -> Result<Option<Bytes>, ForeignError> {
        let range = part.as_ref().map(header);
        let answer = self.answer(name, Method::GET, range.as_deref()).await?;
        let Some(answer) = answer else {
            return Ok(None);
        };
        let place = shown(&self.url(name));
        let is_part = answer.status() == StatusCode::PARTIAL_CONTENT;
        let said = answer.headers().get(CONTENT_RANGE);
        let said = said.and_then(|said| said.to_str().ok().map(str::to_owned));
        let content = content(answer, &place, most_bytes).await?;
        if is_part {
            let checked = check_part(said.as_deref(), part.as_ref(), content.len() as u64);
            checked.map_err(|reason| ForeignError::refused(place, reason))?;
            return Ok(Some(content));
        }
        let Some(part) = part else {
            return Ok(Some(content));
        };
        // A server that knows no parts sends all.
        let range = part.as_range(content.len() as u64);
        let range = range.map_err(|e| ForeignError::refused(place, e.to_string()))?;
        Ok(Some(
            content.slice(range.start as usize..range.end as usize),
        ))
    }

    async fn size(&self, name: &str) -> Result<Option<u64>, ForeignError> {
        let Some(answer) = self.answer(name, Method::HEAD, None).await? else {
            return Ok(None);
        };
        let length = answer.headers().get(CONTENT_LENGTH);
        let length = length.and_then(|length| length.to_str().ok()?.parse().ok());
        Ok(Some(length.unwrap_or_default()))
    }

    async fn folders(&self, _folder: &str) -> Result<Option<Vec<String>>, ForeignError> {
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_asked_for_with_both_ends_in_them() {
        assert_eq!(header(&GetRange::Bounded(5..9)), "bytes=5-8");
        assert_eq!(header(&GetRange::Offset(7)), "bytes=7-");
        assert_eq!(header(&GetRange::Suffix(196)), "bytes=-196");
    }

    #[test]
    fn a_part_that_is_not_the_one_asked_for_is_refused() {
        let is_taken = |said: &str, asked: GetRange, came_bytes: u64| {
            check_part(Some(said), Some(&asked), came_bytes).is_ok()
        };
        let (five, from, last) = (
            || GetRange::Bounded(10..15),
            || GetRange::Offset(90),
            || GetRange::Suffix(4),
        );
        assert!(is_taken("bytes 10-14/100", five(), 5));
        assert!(is_taken("Bytes 10-14/*", five(), 5));
        // Of what ends earlier.
        assert!(is_taken("bytes 10-12/13", five(), 3));
        assert!(is_taken("bytes 90-99/100", from(), 10));
        assert!(is_taken("bytes 96-99/100", last(), 4));
        assert!(is_taken("bytes 0-2/3", last(), 3));
        for (said, asked, came_bytes) in [
            ("bytes 0-4/100", five(), 5),
            ("bytes 10-12/100", five(), 3),
            ("bytes 10-14/100", five(), 4),
            ("bytes 10-19/100", five(), 10),
            ("bytes 90-94/100", from(), 5),
            ("bytes 0-3/100", last(), 4),
            ("bytes 98-99/100", last(), 2),
            ("bytes 14-10/100", five(), 5),
            ("bytes */100", five(), 5),
            ("items 10-14/100", five(), 5),
            ("", five(), 5),
        ] {
            let refused = check_part(Some(said), Some(&asked), came_bytes).unwrap_err();
            assert!(refused.contains(&header(&asked)), "{said}: {refused}");
        }
        assert!(check_part(None, Some(&five()), 5).is_err());
        // The whole was asked for.
        assert!(check_part(Some("bytes 0-9/10"), None, 10).is_ok());
        assert!(check_part(Some("bytes 0-9/99"), None, 10).is_err());
    }
}
