//! A proxy before a server: hands bytes through, or answers every request with 500, as told.

use std::collections::BTreeMap;
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use anyhow::Result;

const FAILURE: &[u8] =
    b"HTTP/1.1 500 Internal Server Error\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";

/// A running proxy; its threads end with the process.
pub struct Proxy {
    /// Where it listens.
    pub address: SocketAddr,
    is_failing: Arc<AtomicBool>,
    refused: Arc<AtomicU64>,
    open: Arc<Mutex<BTreeMap<u64, TcpStream>>>,
}

impl Proxy {
    /// Hands through to `target`.
    pub fn start(target: SocketAddr) -> Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let proxy = Self {
            address: listener.local_addr()?,
            is_failing: Arc::default(),
            refused: Arc::default(),
            open: Arc::default(),
        };
        let (is_failing, refused, open) = (
            Arc::clone(&proxy.is_failing),
            Arc::clone(&proxy.refused),
            Arc::clone(&proxy.open),
        );
        std::thread::spawn(move || {
            // An accept that failed (a client gone at once) is no reason to serve nobody any more.
            for (number, client) in (0..).zip(listener.incoming().filter_map(Result::ok)) {
                if is_failing.load(Ordering::SeqCst) {
                    refused.fetch_add(1, Ordering::SeqCst);
                    std::thread::spawn(move || refuse(client));
                } else if let Ok(server) = TcpStream::connect(target) {
                    let open = Arc::clone(&open);
                    if let Ok(client) = client.try_clone() {
                        lock(&open).insert(number, client);
                    }
                    std::thread::spawn(move || {
                        join(client, server);
                        lock(&open).remove(&number);
                    });
                }
            }
        });
        Ok(proxy)
    }

    /// Answers every request with 500 from now on, those on open connections included, or hands through again.
    pub fn fail(&self, failing: bool) {
        self.is_failing.store(failing, Ordering::SeqCst);
        if failing {
            for stream in std::mem::take(&mut *lock(&self.open)).values() {
                // A connection that is gone already needs no closing.
                drop(stream.shutdown(Shutdown::Both));
            }
        }
    }

    /// Requests answered with 500.
    pub fn refused(&self) -> u64 {
        self.refused.load(Ordering::SeqCst)
    }
}

fn lock(open: &Mutex<BTreeMap<u64, TcpStream>>) -> MutexGuard<'_, BTreeMap<u64, TcpStream>> {
    open.lock().expect("nobody panics while holding it")
}

/// Reads what comes until the head is there, answers, and closes.
fn refuse(mut client: TcpStream) {
    let (mut head, mut some) = (vec![], [0; 4096]);
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        match client.read(&mut some) {
            Ok(0) | Err(_) => return,
            Ok(read) => head.extend_from_slice(&some[..read]),
        }
    }
    // A client that went away needs no answer.
    drop(client.write_all(FAILURE));
    drop(client.shutdown(Shutdown::Write));
}

/// Hands bytes through both ways until either side closes.
fn join(client: TcpStream, server: TcpStream) {
    let (Ok(client_too), Ok(server_too)) = (client.try_clone(), server.try_clone()) else {
        return;
    };
    let back = std::thread::spawn(move || pump(server, client_too));
    pump(client, server_too);
    // A pump that panicked has closed its streams too.
    drop(back.join());
}

fn pump(mut from: TcpStream, mut to: TcpStream) {
    // Either side closing ends both.
    drop(std::io::copy(&mut from, &mut to));
    drop(to.shutdown(Shutdown::Both));
    drop(from.shutdown(Shutdown::Both));
}
