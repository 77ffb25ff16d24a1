//! `/zarr/{product}/{key}`: a product as Zarr version 3, for xarray and whoever else reads it over HTTP. Chunks are sent as
//! they are stored: who asked decodes them and compares their checksums. `/zarr2/{product}/{key}`: the same as version 2, for GDAL; its
//! chunks have no checksums, so that they are compared here.

use std::ops::Range;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use cube::{Keys, ZarrVersion};

use crate::error::ServerError;
use crate::extract::UrlPath;
use crate::gate::Pass;
use crate::routes::picture::{CACHE_CONTROL, CACHE_CONTROL_PINNED, has_tag};
use crate::state::AppState;

/// A product's cube by keys of Zarr: `zarr.json` of the group describes all arrays.
///
/// `PRODUCT@NUMBER` is a version and never changes; `PRODUCT` is the newest, which may become another one between two
/// requests: who reads for long names a version.
#[utoipa::path(
    get,
    path = "/zarr/{product}/{key}",
    operation_id = "zarr",
    tag = "statistics",
    params(
        ("product" = String, Path, description = "Product, or a version of it, `PRODUCT@NUMBER`"),
        ("key" = String, Path, description = "Key of Zarr version 3, such as `zarr.json` or `time/c/0`"),
    ),
    responses(
        (status = 200, description = "The value of the key", content(("application/octet-stream"))),
        (status = 206, description = "The bytes of it that `Range` asked for; with another tag in `If-Range` all of it is sent", content(("application/octet-stream"))),
        (status = 304, description = "The copy that the client has is right"),
        (status = 404, description = "No such product, version or key, or a chunk without data", body = crate::error::Refusal),
        (status = 416, description = "It has no such bytes", body = crate::error::Refusal),
    ),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    method: Method,
    UrlPath((product, key)): UrlPath<(String, String)>,
    asked: HeaderMap,
) -> Result<Response, ServerError> {
    answer(
        &state,
        (&product, ZarrVersion::Three, &key),
        (&method, &asked),
    )
    .await
}

/// The same arrays by keys of Zarr version 2, for programs that read no other, such as GDAL and QGIS: `.zmetadata` describes all
/// arrays. Coarser levels are left out.
#[utoipa::path(
    get,
    path = "/zarr2/{product}/{key}",
    operation_id = "zarr2",
    tag = "statistics",
    params(
        ("product" = String, Path, description = "Product, or a version of it, `PRODUCT@NUMBER`"),
        ("key" = String, Path, description = "Key of Zarr version 2, such as `.zmetadata` or `time/0`"),
    ),
    responses(
        (status = 200, description = "The value of the key", content(("application/octet-stream"))),
        (status = 206, description = "The bytes of it that `Range` asked for; with another tag in `If-Range` all of it is sent", content(("application/octet-stream"))),
        (status = 304, description = "The copy that the client has is right"),
        (status = 404, description = "No such product, version or key, or a chunk without data", body = crate::error::Refusal),
        (status = 416, description = "It has no such bytes", body = crate::error::Refusal),
    ),
)]
pub(crate) async fn get_2(
    State(state): State<AppState>,
    method: Method,
    UrlPath((product, key)): UrlPath<(String, String)>,
    asked: HeaderMap,
) -> Result<Response, ServerError> {
    answer(
        &state,
        (&product, ZarrVersion::Two, &key),
        (&method, &asked),
    )
    .await
}

async fn answer(
    state: &AppState,
    (product, zarr, key): (&str, ZarrVersion, &str),
    (method, asked): (&Method, &HeaderMap),
) -> Result<Response, ServerError> {
    let (keys, is_pinned) = Box::pin(opened(state, product)).await?;
    let tag = format!("\"{}\"", keys.snapshot());
    let cache_control = if is_pinned {
        CACHE_CONTROL_PINNED
    } else {
        CACHE_CONTROL
    };
    let headers = [
        (header::ETAG, tag.clone()),
        (header::CACHE_CONTROL, cache_control.to_owned()),
        (header::ACCEPT_RANGES, "bytes".to_owned()),
    ];
    let Pass {
        place: _place,
        turn,
    } = state.cubes.reads.enter().await?;
    let length = state.cubes.length(&keys, (zarr, key)).await?;
    let length = length.ok_or(ServerError::UnknownAddress)?;
    if has_tag(asked, &tag) {
        return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
    }
    // To HEAD a range means nothing (RFC 9110, 14.2): it asks for what GET says of all.
    let range = if *method == Method::GET && is_of_same(asked, &tag) {
        part(asked, length)?
    } else {
        None
    };
    let bytes = range.as_ref().map_or(length, |part| part.end - part.start);
    let read = state
        .cubes
        .get(&keys, (zarr, key), (range.clone(), bytes), turn);
    let content = read.await.inspect_err(|error| {
        if matches!(error, ServerError::Busy) {
            state.metrics.refused.inc();
        }
    })?;
    let content = content.ok_or(ServerError::UnknownAddress)?;
    let described = [(header::CONTENT_TYPE, "application/octet-stream")];
    let Some(Range { start, end }) = range else {
        return Ok((headers, described, Body::from(content)).into_response());
    };
    let place = format!("bytes {start}-{}/{length}", end - 1);
    let place = [(header::CONTENT_RANGE, place)];
    let status = StatusCode::PARTIAL_CONTENT;
    Ok((status, headers, described, place, Body::from(content)).into_response())
}

/// The cube that an address names, and whether it names a version.
async fn opened(state: &AppState, product: &str) -> Result<(Arc<Keys>, bool), ServerError> {
    let unknown = || ServerError::UnknownVersion {
        manifest: product.chars().take(80).collect(),
    };
    let (id, is_pinned) = match product.split_once('@') {
        None => (
            Some(state.catalogue.layer(product).await?.id.clone()),
            false,
        ),
        Some((_, version)) if version.contains('-') => (Some(product.parse()?), true),
        Some(_) => (None, true),
    };
    let (name, number) = match (&id, product.split_once('@')) {
        (Some(id), _) => (id.product.clone(), id.number),
        (None, Some((name, text))) => {
            let number: u64 = text.parse().map_err(|_no_number| unknown())?;
            // Another spelling would be another address of what has one.
            if number.to_string() != text {
                return Err(unknown());
            }
            (name.parse()?, number)
        }
        (None, None) => return Err(unknown()),
    };
    let keys = state.cubes.version(&name, number).await?;
    if id.is_some() && keys.description().version != id {
        return Err(unknown());
    }
    Ok((keys, is_pinned))
}

/// Is a range asked for of what is there now? Who gives a tag with `If-Range` has a part of that, and wants the rest of it or all of
/// what came since (RFC 9110, 13.1.5): nothing here has a date, and a weak tag never compares.
fn is_of_same(asked: &HeaderMap, tag: &str) -> bool {
    let of = asked.get(header::IF_RANGE);
    of.is_none_or(|of| of.as_bytes() == tag.as_bytes())
}

/// The one range of bytes that is asked for; none where all are, or several, which may be answered so (RFC 9110, 14.2).
fn part(asked: &HeaderMap, length: u64) -> Result<Option<Range<u64>>, ServerError> {
    let range = asked.get(header::RANGE).and_then(|it| it.to_str().ok());
    let Some((from, to)) = range
        .and_then(|range| range.strip_prefix("bytes="))
        .filter(|range| !range.contains(','))
        .and_then(|range| range.split_once('-'))
    else {
        return Ok(None);
    };
    // Digits and nothing else (RFC 9110, 14.1.1): numbers of the language may have a sign.
    if [from, to]
        .concat()
        .bytes()
        .any(|byte| !byte.is_ascii_digit())
    {
        return Ok(None);
    }
    let (start, end) = match (from.parse::<u64>(), to.parse::<u64>()) {
        (Ok(from), Ok(to)) if from <= to => (from, to.saturating_add(1).min(length)),
        (Ok(from), Err(_)) if to.is_empty() => (from, length),
        (Err(_), Ok(last)) if from.is_empty() => (length.saturating_sub(last), length),
        // No range of the standard's: as if there were none.
        _ => return Ok(None),
    };
    if start < end {
        Ok(Some(start..end))
    } else {
        Err(ServerError::NoRange { length })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(range: &str) -> Result<Option<Range<u64>>, StatusCode> {
        let mut asked = HeaderMap::new();
        asked.insert(header::RANGE, range.parse().unwrap());
        part(&asked, 100).map_err(|error| error.status())
    }

    #[test]
    fn a_range_is_of_what_the_client_has_a_part_of() {
        let of = |if_range: Option<&'static str>| {
            let mut asked = HeaderMap::new();
            if let Some(tag) = if_range {
                asked.insert(header::IF_RANGE, tag.parse().unwrap());
            }
            is_of_same(&asked, "\"a\"")
        };
        assert!(of(None) && of(Some("\"a\"")));
        for other in ["\"b\"", "W/\"a\"", "a", "Sat, 29 Oct 1994 19:43:31 GMT"] {
            assert!(!of(Some(other)), "{other}");
        }
    }

    #[test]
    fn ranges_are_those_of_the_standard() {
        assert_eq!(of("bytes=0-9"), Ok(Some(0..10)));
        assert_eq!(of("bytes=90-"), Ok(Some(90..100)));
        assert_eq!(of("bytes=90-1000"), Ok(Some(90..100)));
        assert_eq!(of("bytes=-20"), Ok(Some(80..100)));
        assert_eq!(of("bytes=-200"), Ok(Some(0..100)));
        for all in [
            "bytes=0-1,5-6",
            "bytes=a-b",
            "lines=1-2",
            "bytes=9-1",
            "bytes=-",
            "bytes=+0-9",
            "bytes=0-+9",
            "bytes=-+9",
        ] {
            assert_eq!(of(all), Ok(None), "{all}");
        }
        for none in ["bytes=100-", "bytes=-0", "bytes=200-300"] {
            assert_eq!(of(none), Err(StatusCode::RANGE_NOT_SATISFIABLE), "{none}");
        }
    }
}
