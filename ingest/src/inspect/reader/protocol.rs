//! What the reader process and its parent say to each other: JSON lines with a length in front, values as raw float64.

use std::io::{Error, ErrorKind, Read, Write};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::error::Rejection;
use crate::inspect::file::description::{Description, Part};

/// Longest message, bytes: a description of 4096 variables with twenty attributes each fits three times. What is read of
/// it takes some times as much, beside the memory that files wait for.
pub(super) const MAX_MESSAGE_BYTES: u32 = 16 << 20;

/// What the reader says first.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Opened {
    Described(Description),
    Rejected(Rejection),
}

/// What the parent asks for. It may ask for more before it reads an answer; answers come in the order of requests.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Request {
    pub(super) variable: String,
    pub(super) part: Vec<Part>,
}

impl Request {
    pub(super) fn new(variable: &str, part: &[Part]) -> Self {
        Self {
            variable: variable.to_owned(),
            part: part.to_vec(),
        }
    }
}

/// What the reader says to a request; after `Values` follow that many little-endian float64.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Answer {
    Values { count: u64 },
    Rejected(Rejection),
}

/// Bytes of a message with its length in front.
pub(super) fn encode<T: Serialize>(message: &T) -> std::io::Result<Vec<u8>> {
    let json = serde_json::to_vec(message)?;
    let len = u32::try_from(json.len())
        .ok()
        .filter(|len| *len <= MAX_MESSAGE_BYTES);
    let len = len.ok_or_else(|| Error::new(ErrorKind::InvalidData, "message too long"))?;
    Ok([len.to_le_bytes().as_slice(), &json].concat())
}

/// Length of a message from the four bytes before it.
pub(super) fn message_bytes(prefix: [u8; 4]) -> std::io::Result<usize> {
    let len = u32::from_le_bytes(prefix);
    if len > MAX_MESSAGE_BYTES {
        return Err(Error::new(
            ErrorKind::InvalidData,
            format!("a message of {len} bytes"),
        ));
    }
    Ok(len as usize)
}

/// Writes a message.
pub(super) fn write<T: Serialize>(out: &mut impl Write, message: &T) -> std::io::Result<()> {
    out.write_all(&encode(message)?)
}

/// Reads a message; none at the end of the stream.
pub(super) fn read<T: DeserializeOwned>(input: &mut impl Read) -> std::io::Result<Option<T>> {
    let mut prefix = [0; 4];
    match input.read_exact(&mut prefix) {
        Err(e) if e.kind() == ErrorKind::UnexpectedEof => return Ok(None),
        other => other?,
    }
    let mut json = vec![0; message_bytes(prefix)?];
    input.read_exact(&mut json)?;
    Ok(Some(serde_json::from_slice(&json)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_round_trips_and_a_false_length_is_refused() {
        let bytes = encode(&Answer::Values { count: 3 }).unwrap();
        assert!(matches!(
            read(&mut bytes.as_slice()).unwrap(),
            Some(Answer::Values { count: 3 })
        ));
        assert!(read::<Answer>(&mut u32::MAX.to_le_bytes().as_slice()).is_err());
        assert!(read::<Answer>(&mut [].as_slice()).unwrap().is_none());
    }
}
