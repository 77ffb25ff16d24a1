//! A gate before an HTTP server: hands requests through one by one, notes each, and answers those itself that it is told to.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::Result;

/// What the gate answers instead of the server.
#[derive(Debug, Clone)]
pub struct Refusal {
    /// Such as `403 Forbidden`.
    pub status: &'static str,
    /// Left out where HEAD asked.
    pub body: String,
}

/// A request: its method, the path with what is behind `?`, and all header lines.
#[derive(Debug, Clone)]
pub struct Request {
    pub method: String,
    pub path: String,
    pub headers: String,
}

type Rule = Box<dyn FnMut(&Request) -> Option<Refusal> + Send>;

#[derive(Default)]
struct Shared {
    rule: Mutex<Option<Rule>>,
    passed: Mutex<Vec<Request>>,
    refused: Mutex<Vec<Request>>,
}

/// A running gate; its threads end with the process.
pub struct Gate {
    address: SocketAddr,
    shared: Arc<Shared>,
}

impl Gate {
    /// Before `upstream`, an `http://HOST:PORT`.
    pub fn start(upstream: &str) -> Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let address = listener.local_addr()?;
        let upstream = upstream.trim_start_matches("http://").to_owned();
        let shared = Arc::<Shared>::default();
        let serving = Arc::clone(&shared);
        std::thread::spawn(move || {
            for client in listener.incoming().filter_map(Result::ok) {
                let (upstream, shared) = (upstream.clone(), Arc::clone(&serving));
                // A client that goes away in the middle is its own affair.
                std::thread::spawn(move || drop(carry(client, &upstream, &shared)));
            }
        });
        Ok(Self { address, shared })
    }

    /// Where it listens.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Answers from now on what the rule gives an answer for; hands the rest through.
    pub fn refuse(&self, rule: impl FnMut(&Request) -> Option<Refusal> + Send + 'static) {
        *lock(&self.shared.rule) = Some(Box::new(rule));
    }

    /// Hands everything through from now on.
    pub fn open(&self) {
        *lock(&self.shared.rule) = None;
    }

    /// Requests that were handed through so far.
    pub fn passed(&self) -> Vec<Request> {
        lock(&self.shared.passed).clone()
    }

    /// Requests that the gate itself answered so far.
    pub fn refused(&self) -> Vec<Request> {
        lock(&self.shared.refused).clone()
    }
}

fn lock<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    // Changed by single steps: what a panic left is whole.
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Carries one request, without a body, and its answer.
fn carry(mut client: TcpStream, upstream: &str, shared: &Shared) -> std::io::Result<()> {
    let (mut head, mut some) = (vec![], [0; 4096]);
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        let read = client.read(&mut some)?;
        if read == 0 {
            return Ok(());
        }
        head.extend_from_slice(&some[..read]);
    }
    let head = String::from_utf8_lossy(&head).into_owned();
    let (first, headers) = head.split_once("\r\n").unwrap_or_default();
    let mut words = first.split(' ').map(str::to_owned);
    let request = Request {
        method: words.next().unwrap_or_default(),
        path: words.next().unwrap_or_default(),
        headers: headers.to_owned(),
    };
    let refusal = lock(&shared.rule).as_mut().and_then(|rule| rule(&request));
    if let Some(Refusal { status, body }) = refusal {
        let is_head = request.method == "HEAD";
        lock(&shared.refused).push(request);
        let sent = if is_head { "" } else { &body };
        write!(
            client,
            "HTTP/1.1 {status}\r\nContent-Type: application/xml\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{sent}",
            body.len()
        )?;
        return client.shutdown(Shutdown::Write);
    }
    lock(&shared.passed).push(request);
    let mut server = TcpStream::connect(upstream)?;
    // One request a connection; this header is none of those that are signed.
    write!(server, "{first}\r\nConnection: close\r\n{headers}")?;
    std::io::copy(&mut server, &mut client)?;
    client.shutdown(Shutdown::Write)
}
