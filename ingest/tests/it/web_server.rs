//! A small HTTP server: a path in, an answer out, as the test wants it.

use std::fmt::Write as _;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};

/// What is answered to a path.
pub(crate) type Answers = dyn Fn(&str) -> Answer + Send + Sync;

/// An answer.
pub(crate) enum Answer {
    /// Status line's number and text, header lines, body.
    Whole(&'static str, Vec<String>, Vec<u8>),
    /// The same, but the connection ends after half of the body.
    Half(Vec<u8>),
    /// A file of a mebibyte, a byte at a time.
    Trickle,
    /// None.
    Silence,
}

/// Between two bytes of a trickle.
const PAUSE: Duration = Duration::from_millis(50);

/// The server; it ends with the runtime.
pub(crate) struct WebServer {
    pub(crate) address: SocketAddr,
    /// Paths that were asked for.
    asked: Arc<Mutex<Vec<String>>>,
}

impl WebServer {
    pub(crate) async fn start(answers: Box<Answers>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let asked = Arc::new(Mutex::new(Vec::new()));
        let (seen, answers) = (Arc::clone(&asked), Arc::new(answers));
        tokio::spawn(async move {
            while let Ok((mut stream, _)) = listener.accept().await {
                let (seen, answers) = (Arc::clone(&seen), Arc::clone(&answers));
                tokio::spawn(async move {
                    let mut head = Vec::new();
                    while !head.ends_with(b"\r\n\r\n") {
                        match stream.read_u8().await {
                            Ok(byte) => head.push(byte),
                            Err(_) => return,
                        }
                    }
                    let text = String::from_utf8_lossy(&head).into_owned();
                    let path = text.split(' ').nth(1).unwrap_or_default().to_owned();
                    seen.lock().unwrap().push(path.clone());
                    match answers(&path) {
                        Answer::Trickle => trickle(stream).await,
                        // Until the other side goes.
                        Answer::Silence => drop(stream.read_u8().await),
                        answer => {
                            stream.write_all(&bytes_of(answer)).await.ok();
                        }
                    }
                });
            }
        });
        Self { address, asked }
    }

    pub(crate) fn asked(&self) -> Vec<String> {
        self.asked.lock().unwrap().clone()
    }

    pub(crate) fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }
}

async fn trickle(mut stream: TcpStream) {
    let head = b"HTTP/1.1 200 OK\r\ncontent-length: 1048576\r\n\r\n";
    let mut sent = stream.write_all(head).await;
    while sent.is_ok() {
        tokio::time::sleep(PAUSE).await;
        sent = stream.write_u8(0).await;
    }
}

fn bytes_of(answer: Answer) -> Vec<u8> {
    let (status, headers, body, shown) = match answer {
        Answer::Whole(status, headers, body) => (status, headers, body.clone(), body.len()),
        Answer::Half(body) => ("200 OK", vec![], body.clone(), body.len() / 2),
        Answer::Trickle | Answer::Silence => unreachable!("these have no bytes of their own"),
    };
    let mut text = format!("HTTP/1.1 {status}\r\nconnection: close\r\n");
    let is_sized = headers
        .iter()
        .any(|line| line.starts_with("transfer-encoding"));
    if !is_sized {
        write!(text, "content-length: {}\r\n", body.len()).unwrap();
    }
    for line in headers {
        write!(text, "{line}\r\n").unwrap();
    }
    let mut bytes = (text + "\r\n").into_bytes();
    bytes.extend_from_slice(&body[..shown]);
    bytes
}
