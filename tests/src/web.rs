//! A web server of a test's own: gives everybody the same answer, and counts who came.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::Result;

/// A running server; its thread ends with the process.
pub struct Web {
    /// Where it listens.
    pub address: SocketAddr,
    came: Arc<AtomicU64>,
}

impl Web {
    /// Answers with an empty body.
    pub fn empty() -> Result<Self> {
        Self::answering(
            "HTTP/1.1 200 OK\r\nContent-Length: 0\r\nConnection: close\r\n\r\n".to_owned(),
        )
    }

    /// Sends everybody elsewhere.
    pub fn redirecting(target: &str) -> Result<Self> {
        Self::answering(format!(
            "HTTP/1.1 302 Found\r\nLocation: {target}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
        ))
    }

    /// How many connections were made.
    pub fn came(&self) -> u64 {
        self.came.load(Ordering::SeqCst)
    }

    fn answering(answer: String) -> Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let web = Self {
            address: listener.local_addr()?,
            came: Arc::default(),
        };
        let came = Arc::clone(&web.came);
        std::thread::spawn(move || {
            for client in listener.incoming().filter_map(Result::ok) {
                came.fetch_add(1, Ordering::SeqCst);
                give(client, answer.as_bytes());
            }
        });
        Ok(web)
    }
}

/// Reads one request's head and answers.
fn give(mut client: TcpStream, answer: &[u8]) {
    let (mut head, mut some) = (vec![], [0; 4096]);
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        match client.read(&mut some) {
            Ok(0) | Err(_) => return,
            Ok(read) => head.extend_from_slice(&some[..read]),
        }
    }
    // A client that went away needs no answer.
    drop(client.write_all(answer));
    drop(client.shutdown(Shutdown::Write));
}
