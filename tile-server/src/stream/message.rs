//! What travels over a stream: states and receipts in, pictures and errors out.

use axum::extract::ws::Message;
use bytes::{BufMut as _, Bytes, BytesMut};
use contract::time::TimeMs;
use serde::{Deserialize, Serialize};

use crate::error::ServerError;

/// Longest message of a client, bytes.
pub(crate) const MOST_MESSAGE_BYTES: usize = 8 << 10;

/// What a client says.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub(super) enum Said {
    /// Its camera sees this.
    State(State),
    /// A picture is on its screen.
    Seen {
        /// Of the state that the picture shows.
        seen: u64,
    },
}

/// What a client's camera sees.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    /// Number, rising.
    pub(super) id: u64,
    /// Address of the picture.
    pub(super) view: String,
}

/// As what a picture is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Kind {
    /// Of the size and quality that can be had in time.
    Moving,
    /// As its address says.
    Full,
}

impl Kind {
    pub(super) fn as_str(self) -> &'static str {
        match self {
            Self::Moving => "moving",
            Self::Full => "full",
        }
    }
}

/// What comes before a picture's bytes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Header {
    pub(super) id: u64,
    pub(super) kind: Kind,
    pub(super) format: &'static str,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) full_width: u32,
    pub(super) full_height: u32,
    pub(super) view: String,
    /// The instant that is shown, where it is not the one that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) time: Option<TimeMs>,
    pub(super) took_ms: f64,
}

/// A picture on its way.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Picture {
    pub(super) header: Header,
    pub(super) bytes: Bytes,
}

impl Picture {
    /// Length of the header, header, bytes.
    pub(super) fn message(&self) -> Message {
        let header = serde_json::to_vec(&self.header).expect("a header has string keys only");
        let mut message = BytesMut::with_capacity(4 + header.len() + self.bytes.len());
        message.put_u32(header.len() as u32);
        message.put_slice(&header);
        message.put_slice(&self.bytes);
        Message::Binary(message.freeze())
    }
}

/// Why a state has no picture.
#[derive(Debug, Serialize)]
struct Refused {
    id: u64,
    error: String,
    status: u16,
}

/// The refusal of a state.
pub(super) fn refusal(id: u64, error: &ServerError) -> Message {
    let refused = Refused {
        id,
        error: error.text(),
        status: error.status().as_u16(),
    };
    let text = serde_json::to_string(&refused).expect("a refusal has string keys only");
    Message::Text(text.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_and_receipts_are_told_apart_and_nothing_else_is_taken() {
        let said = |text| serde_json::from_str::<Said>(text);
        let state = State {
            id: 7,
            view: "/globe/a/map.png".to_owned(),
        };
        assert_eq!(
            said(r#"{"id": 7, "view": "/globe/a/map.png"}"#).unwrap(),
            Said::State(state)
        );
        assert_eq!(said(r#"{"seen": 7}"#).unwrap(), Said::Seen { seen: 7 });
        for wrong in [
            "",
            "7",
            "{}",
            r#"{"id": 7}"#,
            r#"{"id": -1, "view": "/"}"#,
            r#"{"id": 1.5, "view": "/"}"#,
            r#"{"id": 7, "view": "/", "x": 1}"#,
            r#"{"seen": "7"}"#,
        ] {
            assert!(said(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_picture_is_led_by_the_length_of_its_header() {
        let header = Header {
            id: 7,
            kind: Kind::Full,
            format: "image/png",
            width: 1,
            height: 2,
            full_width: 1,
            full_height: 2,
            view: "/globe/a/map.png".to_owned(),
            time: None,
            took_ms: 1.5,
        };
        let picture = Picture {
            header,
            bytes: Bytes::from_static(b"picture"),
        };
        let Message::Binary(bytes) = picture.message() else {
            panic!("binary");
        };
        let length = u32::from_be_bytes(bytes[..4].try_into().unwrap()) as usize;
        let header: serde_json::Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
        assert_eq!(header["kind"], "full");
        assert!(header.get("time").is_none());
        assert_eq!(&bytes[4 + length..], b"picture");
    }
}
