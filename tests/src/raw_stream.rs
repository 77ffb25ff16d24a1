//! A stream on a bare socket, for clients that do what no WebSocket library lets them do.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use serde_json::Value;

/// What asks for a stream (RFC 6455, 4.1).
pub const REQUEST: &str = "GET /stream HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
     Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
const END_OF_HEAD: &[u8] = b"\r\n\r\n";
/// How long one look for bytes takes.
const TURN: Duration = Duration::from_millis(100);

/// A socket that a server switched to WebSocket.
pub struct RawStream {
    socket: TcpStream,
    came: Vec<u8>,
}

/// A frame of a server.
#[derive(Debug, PartialEq)]
pub enum Frame {
    /// Header of a picture.
    Picture(Value),
    /// Text.
    Text(String),
    /// Code and reason.
    Close(u16, String),
    /// Ping or pong.
    Other,
}

/// What a server answered to a request for a stream.
pub struct Opened {
    /// HTTP status.
    pub status: u16,
    /// The head in lower case.
    pub head: String,
    /// The stream, if the status is 101.
    pub stream: Option<RawStream>,
}

/// A socket to a server, `http://HOST:PORT`.
pub fn connect(server: &str) -> Result<TcpStream> {
    let address = server.trim_start_matches("http://");
    let socket = TcpStream::connect(address).with_context(|| address.to_owned())?;
    socket.set_read_timeout(Some(TURN))?;
    Ok(socket)
}

/// Hears what a server says to a [`REQUEST`] that was sent.
pub fn opened(mut socket: TcpStream, limit: Duration) -> Result<Opened> {
    let (begun, mut came) = (Instant::now(), vec![]);
    loop {
        if let Some(end) = came.windows(4).position(|four| four == END_OF_HEAD) {
            let rest = came.split_off(end + END_OF_HEAD.len());
            let head = String::from_utf8_lossy(&came).to_ascii_lowercase();
            let status = head.split(' ').nth(1).context("no status")?.parse()?;
            let stream = (status == 101).then_some(RawStream { socket, came: rest });
            return Ok(Opened {
                status,
                head,
                stream,
            });
        }
        if read(&mut socket, &mut came)? == Some(0) {
            bail!("hung up on after {} bytes", came.len());
        }
        if begun.elapsed() > limit {
            bail!("no answer within {limit:?}");
        }
    }
}

/// Some bytes more; 0 at the end, none if nothing comes.
fn read(socket: &mut TcpStream, came: &mut Vec<u8>) -> Result<Option<usize>> {
    let mut some = [0; 16_384];
    match socket.read(&mut some) {
        Ok(count) => {
            came.extend_from_slice(&some[..count]);
            Ok(Some(count))
        }
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// A text as a client's frame, masked with nothing.
pub fn frame(text: &str) -> Vec<u8> {
    let mut frame = vec![0x81];
    match u8::try_from(text.len()) {
        Ok(short) if short < 126 => frame.push(0x80 | short),
        _ => {
            frame.push(0xfe);
            frame.extend((text.len() as u16).to_be_bytes());
        }
    }
    frame.extend([0; 4]);
    frame.extend(text.as_bytes());
    frame
}

impl RawStream {
    /// Opens a stream that must be granted.
    pub fn open(server: &str) -> Result<Self> {
        let mut socket = connect(server)?;
        socket.write_all(REQUEST.as_bytes())?;
        let opened = opened(socket, Duration::from_secs(20))?;
        opened.stream.with_context(|| opened.head.clone())
    }

    /// Sends bytes as they are.
    pub fn send(&mut self, bytes: &[u8]) -> Result<()> {
        Ok(self.socket.write_all(bytes)?)
    }

    /// The same socket, to be written to by another thread.
    pub fn writer(&self) -> Result<TcpStream> {
        Ok(self.socket.try_clone()?)
    }

    /// The next frame, if one comes soon.
    ///
    /// # Errors
    /// The connection ended.
    pub fn hear(&mut self) -> Result<Option<Frame>> {
        if let Some(frame) = self.whole_frame()? {
            return Ok(Some(frame));
        }
        if read(&mut self.socket, &mut self.came)? == Some(0) {
            bail!("the connection ended");
        }
        self.whole_frame()
    }

    /// Takes a frame off what came, if it is whole. Servers mask nothing (RFC 6455, 5.1).
    fn whole_frame(&mut self) -> Result<Option<Frame>> {
        let [kind, length, ..] = self.came[..] else {
            return Ok(None);
        };
        let more = match length {
            126 => 2,
            127 => 8,
            _ => 0,
        };
        let Some(long) = self.came.get(2..2 + more) else {
            return Ok(None);
        };
        let long = long
            .iter()
            .fold(0usize, |sum, byte| (sum << 8) | usize::from(*byte));
        let length = if more == 0 { usize::from(length) } else { long };
        let end = 2 + more + length;
        if self.came.len() < end {
            return Ok(None);
        }
        let rest = self.came.split_off(end);
        let content = std::mem::replace(&mut self.came, rest).split_off(2 + more);
        Ok(Some(match kind & 0xf {
            1 => Frame::Text(String::from_utf8(content)?),
            2 => Frame::Picture(header(&content)?),
            8 => {
                let code = content
                    .first_chunk()
                    .map_or(1005, |c| u16::from_be_bytes(*c));
                let reason = content.get(2..).unwrap_or_default();
                Frame::Close(code, String::from_utf8_lossy(reason).into_owned())
            }
            _ => Frame::Other,
        }))
    }
}

fn header(content: &[u8]) -> Result<Value> {
    let length = content.first_chunk().context("no header")?;
    let header = content.get(4..4 + u32::from_be_bytes(*length) as usize);
    Ok(serde_json::from_slice(
        header.context("a header cut short")?,
    )?)
}
