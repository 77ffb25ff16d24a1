//! Geometries that are sent along with a question: a request's body in, its text out, within a limit of bytes for all of them.

use std::sync::Arc;

use axum::body::Body;
use axum::http::{HeaderMap, header};
use contract::geometry_text::MAX_TEXT_BYTES;
use futures::StreamExt as _;
use prometheus::IntGauge;
use tokio::sync::Semaphore;

use crate::client::Client;
use crate::error::ServerError;
use crate::rooms::{Room, Rooms};

/// Bytes of one body.
pub(crate) const BODY_BYTES: u64 = MAX_TEXT_BYTES as u64;
/// Bytes of all bodies whose questions are under way: four of the longest, two of one client.
const HELD_BYTES: u64 = 4 * BODY_BYTES;
/// Media types of GeoJSON (RFC 7946, section 12).
const GEOJSON: [&str; 2] = ["application/geo+json", "application/json"];

/// Bounds what bodies take. Clones are the same bounds.
#[derive(Debug, Clone)]
pub(crate) struct Bodies {
    held: Rooms,
    /// Reading takes several times the size of a text: one is read at a time.
    reading: Arc<Semaphore>,
}

/// A body that arrived whole.
#[derive(Debug)]
pub(crate) struct Sent {
    text: String,
    room: Room,
    reading: Arc<Semaphore>,
}

impl Bodies {
    /// No bodies; `bytes` shows how many there are.
    pub(crate) fn new(bytes: IntGauge) -> Self {
        Self {
            held: Rooms::new(HELD_BYTES, bytes),
            reading: Arc::new(Semaphore::new(1)),
        }
    }

    /// A body of GeoJSON, read as far as the limit and no further.
    pub(crate) async fn take(&self, headers: &HeaderMap, body: Body) -> Result<Sent, ServerError> {
        check_type(headers)?;
        let too_large = ServerError::BodyTooLarge {
            limit_bytes: BODY_BYTES,
        };
        // How much comes in pieces of unknown number is known at the end.
        let limit = announced(headers).unwrap_or(BODY_BYTES);
        if limit > BODY_BYTES {
            return Err(too_large);
        }
        let mut room = self.room(limit)?;
        let mut bytes = Vec::with_capacity(limit as usize);
        let mut pieces = body.into_data_stream();
        while let Some(piece) = pieces.next().await {
            let piece = piece.map_err(|cut| ServerError::Body {
                reason: format!("it did not arrive whole: {cut}"),
            })?;
            if (bytes.len() + piece.len()) as u64 > limit {
                return Err(too_large);
            }
            bytes.extend_from_slice(&piece);
        }
        bytes.shrink_to_fit();
        room.shrink_to(bytes.len() as u64);
        let text = String::from_utf8(bytes).map_err(|no_text| ServerError::Body {
            reason: format!("it is no text of UTF-8: {}", no_text.utf8_error()),
        })?;
        if !text.trim_start().starts_with('{') {
            return Err(ServerError::Body {
                reason: "it is no GeoJSON: send a geometry, a feature or a collection of features"
                    .to_owned(),
            });
        }
        Ok(Sent {
            text,
            room,
            reading: Arc::clone(&self.reading),
        })
    }

    /// Room for what is made of an address of the client that asks.
    pub(crate) fn room(&self, bytes: u64) -> Result<Room, ServerError> {
        self.held.enter(Client::asking(), bytes)
    }
}

impl Sent {
    /// What a text means, read beside other requests. Its room is to be kept as long as something is made of it.
    pub(crate) async fn read<T: Send + 'static>(
        self,
        read: impl FnOnce(String) -> Result<T, ServerError> + Send + 'static,
    ) -> Result<(T, Room), ServerError> {
        let turn = self.reading.acquire_owned().await;
        let turn = turn.map_err(|_closed| ServerError::Stopping)?;
        let (text, room) = (self.text, self.room);
        // Who goes away meanwhile leaves the room in use until the text is read.
        let reading = tokio::task::spawn_blocking(move || {
            let read = read(text);
            drop(turn);
            read.map(|meant| (meant, room))
        });
        reading.await.map_err(|e| ServerError::Defect {
            what: format!("a geometry was not read: {e}"),
        })?
    }
}

/// # Errors
/// No GeoJSON by what the request says of it.
fn check_type(headers: &HeaderMap) -> Result<(), ServerError> {
    let told = |name: header::HeaderName| {
        let value = headers.get(name)?.to_str().ok()?;
        Some(value.split(';').next().unwrap_or_default().trim())
    };
    let media_type = told(header::CONTENT_TYPE).unwrap_or_default();
    let encoding = told(header::CONTENT_ENCODING).unwrap_or("identity");
    let is_geojson = GEOJSON
        .iter()
        .any(|own| own.eq_ignore_ascii_case(media_type));
    if !is_geojson || !encoding.eq_ignore_ascii_case("identity") {
        return Err(ServerError::NoGeoJson);
    }
    Ok(())
}

/// Bytes that a request says it carries.
pub(crate) fn announced(headers: &HeaderMap) -> Option<u64> {
    let length = headers.get(header::CONTENT_LENGTH);
    length.and_then(|length| length.to_str().ok()?.parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bodies() -> Bodies {
        Bodies::new(IntGauge::new("body_bytes", "Bytes of bodies.").unwrap())
    }

    #[tokio::test]
    async fn room_is_free_again_whatever_becomes_of_a_body() {
        let bodies = bodies();
        let mut headers = HeaderMap::new();
        headers.insert(
            header::CONTENT_TYPE,
            "Application/Geo+JSON; x=y".parse().unwrap(),
        );
        for (body, is_taken) in [(&b"{}"[..], true), (b"global", false), (b"{\xff}", false)] {
            let taken = bodies.take(&headers, Body::from(body)).await;
            assert_eq!(taken.is_ok(), is_taken, "{body:?}");
            if let Ok(sent) = taken {
                assert_eq!(bodies.held.held_bytes(), body.len() as u64);
                let read = sent.read(|text| Ok(text.len())).await;
                assert_eq!(read.unwrap().0, body.len());
            }
            assert_eq!(bodies.held.held_bytes(), 0, "{body:?}");
        }
        // A body that never ends is given up at the limit.
        let mebibyte = vec![b' '; 1 << 20];
        let endless = futures::stream::repeat_with(move || {
            Ok::<_, std::convert::Infallible>(bytes::Bytes::from(mebibyte.clone()))
        });
        let taken = bodies.take(&headers, Body::from_stream(endless)).await;
        assert!(matches!(taken, Err(ServerError::BodyTooLarge { .. })));
        assert_eq!(bodies.held.held_bytes(), 0);
        headers.insert(header::CONTENT_ENCODING, "gzip".parse().unwrap());
        let taken = bodies.take(&headers, Body::from("{}")).await;
        assert!(matches!(taken, Err(ServerError::NoGeoJson)));
    }
}
