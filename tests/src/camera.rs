//! A camera that a server follows over its stream: states in, pictures out.

use std::net::TcpStream;
use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::stream::MaybeTlsStream;
use tokio_tungstenite::tungstenite::{Error, Message, WebSocket, connect};

/// How long one look for a message takes.
const TURN: Duration = Duration::from_millis(100);

/// An open stream.
pub struct Camera {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    id: u64,
}

/// What came for a camera.
#[derive(Debug)]
pub enum Came {
    /// Header and bytes of a picture.
    Picture(Value, Vec<u8>),
    /// Why a state has none.
    Refused(Value),
    /// Nothing yet.
    Nothing,
}

impl Camera {
    /// Opens a stream of a server, `http://HOST:PORT`.
    pub fn connect(server: &str) -> Result<Self> {
        let address = server.replacen("http", "ws", 1);
        let (socket, _answer) = connect(format!("{address}/stream"))?;
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(TURN))?;
        }
        Ok(Self { socket, id: 0 })
    }

    /// Says what it sees; the number of that state.
    pub fn look(&mut self, view: &str) -> Result<u64> {
        self.id += 1;
        let state = json!({"id": self.id, "view": view});
        self.socket.send(Message::text(state.to_string()))?;
        Ok(self.id)
    }

    /// The next message, if one comes soon.
    ///
    /// # Errors
    /// The end of the stream, with its reason.
    pub fn hear(&mut self) -> Result<Came> {
        match self.socket.read() {
            Ok(Message::Binary(bytes)) => {
                let length = bytes.first_chunk().context("a picture without a header")?;
                let (header, picture) = bytes[4..]
                    .split_at_checked(u32::from_be_bytes(*length) as usize)
                    .context("a header that is cut short")?;
                let header: Value = serde_json::from_slice(header)?;
                let seen = json!({"seen": header["id"]});
                self.socket.send(Message::text(seen.to_string()))?;
                Ok(Came::Picture(header, picture.to_vec()))
            }
            Ok(Message::Text(text)) => Ok(Came::Refused(serde_json::from_str(&text)?)),
            Ok(Message::Close(frame)) => bail!("the stream was closed: {frame:?}"),
            Ok(_ping) => Ok(Came::Nothing),
            Err(Error::Io(error)) if is_timeout(&error) => Ok(Came::Nothing),
            Err(error) => bail!("the stream ended: {error}"),
        }
    }
}

fn is_timeout(error: &std::io::Error) -> bool {
    use std::io::ErrorKind;
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}
