//! A proxy before an HTTP server that loses answers, gives wrong ones, is late, and says what it did.
//!
//! It carries one request a connection. A rule names the requests it befalls by method; each is used up in its turn.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};

/// What befalls a request.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Fault {
    /// The server does it; the connection is cut before its answer.
    LoseAnswer,
    /// The server does it; the answer comes so much later.
    Delay(Duration),
    /// The server never sees it and this status is answered.
    Status(u16),
    /// The server does it; of its answer's body so many bytes come before the connection is cut.
    CutBody(usize),
}

struct Rule {
    method: &'static str,
    fault: Fault,
    times: usize,
}

struct Shared {
    upstream: String,
    rules: Mutex<VecDeque<Rule>>,
    fired: AtomicUsize,
    seen: AtomicUsize,
}

/// A running proxy; it ends with this value.
pub(crate) struct FaultProxy {
    address: SocketAddr,
    shared: Arc<Shared>,
    task: tokio::task::JoinHandle<()>,
}

impl FaultProxy {
    /// Starts before `upstream`, an `http://HOST:PORT`.
    pub(crate) async fn start(upstream: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let upstream = upstream.strip_prefix("http://").unwrap();
        let shared = Arc::new(Shared {
            upstream: upstream.trim_end_matches('/').to_owned(),
            rules: Mutex::default(),
            fired: AtomicUsize::new(0),
            seen: AtomicUsize::new(0),
        });
        let serving = Arc::clone(&shared);
        let task = tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let shared = Arc::clone(&serving);
                // A client that goes away in the middle is its own affair.
                tokio::spawn(async move { carry(client, &shared).await.ok() });
            }
        });
        Self {
            address,
            shared,
            task,
        }
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Lets the next `times` requests of a method meet a fault, after the rules given before.
    pub(crate) fn next(&self, method: &'static str, fault: Fault, times: usize) {
        let rule = Rule {
            method,
            fault,
            times,
        };
        self.shared.rules.lock().unwrap().push_back(rule);
    }

    /// Forgets all rules.
    pub(crate) fn heal(&self) {
        self.shared.rules.lock().unwrap().clear();
    }

    /// How many requests met a fault.
    pub(crate) fn fired(&self) -> usize {
        self.shared.fired.load(Ordering::Relaxed)
    }

    /// How many requests came.
    pub(crate) fn seen(&self) -> usize {
        self.shared.seen.load(Ordering::Relaxed)
    }
}

impl Drop for FaultProxy {
    fn drop(&mut self) {
        self.task.abort();
    }
}

impl Shared {
    fn fault_for(&self, method: &str) -> Option<Fault> {
        self.seen.fetch_add(1, Ordering::Relaxed);
        let mut rules = self.rules.lock().unwrap();
        let at = rules.iter().position(|rule| rule.method == method)?;
        let fault = rules[at].fault;
        rules[at].times -= 1;
        if rules[at].times == 0 {
            rules.remove(at);
        }
        self.fired.fetch_add(1, Ordering::Relaxed);
        Some(fault)
    }
}

async fn carry(mut client: TcpStream, shared: &Shared) -> std::io::Result<()> {
    let (head, body_start) = read_head(&mut client).await?;
    let method = head.split(' ').next().unwrap_or_default();
    let fault = shared.fault_for(method);
    let length = header(&head, "content-length").and_then(|text| text.parse().ok());
    let mut body = body_start;
    let begun = body.len();
    body.resize(length.unwrap_or(begun), 0);
    client.read_exact(&mut body[begun..]).await?;
    if let Some(Fault::Status(status)) = fault {
        let answer =
            format!("HTTP/1.1 {status} Told so\r\ncontent-length: 0\r\nconnection: close\r\n\r\n");
        client.write_all(answer.as_bytes()).await?;
        return client.shutdown().await;
    }
    let mut server = TcpStream::connect(&shared.upstream).await?;
    // One request a connection: the end of the answer is the end of the connection.
    let head = head.replacen("\r\n", "\r\nconnection: close\r\n", 1);
    server.write_all(head.as_bytes()).await?;
    server.write_all(&body).await?;
    let mut answer = vec![];
    server.read_to_end(&mut answer).await?;
    match fault {
        Some(Fault::LoseAnswer) => return Ok(()),
        Some(Fault::Delay(wait)) => tokio::time::sleep(wait).await,
        Some(Fault::CutBody(bytes)) => {
            let body_at = answer
                .windows(4)
                .position(|w| w == b"\r\n\r\n")
                .unwrap_or(0)
                + 4;
            answer.truncate(body_at + bytes);
        }
        Some(Fault::Status(_)) | None => {}
    }
    client.write_all(&answer).await?;
    client.shutdown().await
}

/// The head of a request, and what of its body came with it.
async fn read_head(client: &mut TcpStream) -> std::io::Result<(String, Vec<u8>)> {
    const LIMIT_BYTES: usize = 64 << 10;
    let mut read = vec![];
    loop {
        if let Some(end) = read.windows(4).position(|w| w == b"\r\n\r\n") {
            let body = read.split_off(end + 4);
            let head = String::from_utf8(read).map_err(std::io::Error::other)?;
            return Ok((head, body));
        }
        if client.read_buf(&mut read).await? == 0 || read.len() > LIMIT_BYTES {
            return Err(std::io::ErrorKind::UnexpectedEof.into());
        }
    }
}

fn header<'a>(head: &'a str, name: &str) -> Option<&'a str> {
    head.lines()
        .filter_map(|line| line.split_once(':'))
        .find(|(found, _)| found.eq_ignore_ascii_case(name))
        .map(|(_, value)| value.trim())
}
