//! A proxy before a server: hands bytes through, or answers every request with 500, or keeps them waiting, as told; and notes
//! which requests passed, and when.

use std::collections::BTreeMap;
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

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
    passing: Arc<Passing>,
}

/// A request that passed, of a client that waits for one answer before it asks again.
#[derive(Debug, Clone)]
pub struct Passed {
    /// Its first line.
    pub line: String,
    /// When its first bytes came.
    pub begun: Instant,
    /// When the first bytes of its answer went out; none yet.
    pub answered: Option<Instant>,
}

/// What all connections share.
#[derive(Default)]
struct Passing {
    delay_ms: AtomicU64,
    passed: Mutex<Vec<Passed>>,
}

impl Passing {
    fn passed(&self) -> MutexGuard<'_, Vec<Passed>> {
        // Changed by single steps: a poisoned list is whole.
        self.passed.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes a request and keeps it waiting; its place among all.
    fn begin(&self, bytes: &[u8]) -> usize {
        let line = bytes.split(|byte| *byte == b'\r').next();
        let line = String::from_utf8_lossy(line.unwrap_or_default()).into_owned();
        let mut passed = self.passed();
        passed.push(Passed {
            line,
            begun: Instant::now(),
            answered: None,
        });
        let place = passed.len() - 1;
        drop(passed);
        let delay = Duration::from_millis(self.delay_ms.load(Ordering::SeqCst));
        std::thread::sleep(delay);
        place
    }
}

/// Requests that waited for one another, at least: the most of them of which none began before the one before it was answered.
pub fn rounds(passed: &[Passed]) -> usize {
    let spans = passed
        .iter()
        .filter_map(|one| Some((one.answered?, one.begun)));
    let mut spans: Vec<(Instant, Instant)> = spans.collect();
    spans.sort();
    let (mut count, mut last) = (0, None);
    for (answered, begun) in spans {
        if last.is_none_or(|last| begun >= last) {
            count += 1;
            last = Some(answered);
        }
    }
    count
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
            passing: Arc::default(),
        };
        let passing = Arc::clone(&proxy.passing);
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
                    let passing = Arc::clone(&passing);
                    std::thread::spawn(move || {
                        join(client, server, &passing);
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

    /// Keeps every request waiting for so long from now on.
    pub fn delay(&self, delay: Duration) {
        let delay_ms = delay.as_millis() as u64;
        self.passing.delay_ms.store(delay_ms, Ordering::SeqCst);
    }

    /// Requests that have passed so far.
    pub fn passed(&self) -> Vec<Passed> {
        self.passing.passed().clone()
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
fn join(client: TcpStream, server: TcpStream, passing: &Arc<Passing>) {
    let (Ok(client_too), Ok(server_too)) = (client.try_clone(), server.try_clone()) else {
        return;
    };
    for stream in [&client, &server] {
        // What is kept waiting is kept so by this proxy alone.
        drop(stream.set_nodelay(true));
    }
    // The request that waits for its answer.
    let open: Arc<Mutex<Option<usize>>> = Arc::default();
    let (open_too, passing_too) = (Arc::clone(&open), Arc::clone(passing));
    let now =
        |open: &Mutex<Option<usize>>| open.lock().unwrap_or_else(PoisonError::into_inner).take();
    let back = std::thread::spawn(move || {
        pump(server, client_too, |_bytes| {
            if let Some(place) = now(&open_too) {
                passing_too.passed()[place].answered = Some(Instant::now());
            }
        });
    });
    pump(client, server_too, |bytes| {
        if bytes.is_empty() {
            return;
        }
        let mut open = open.lock().unwrap_or_else(PoisonError::into_inner);
        if open.is_none() {
            *open = Some(passing.begin(bytes));
        }
    });
    // A pump that panicked has closed its streams too.
    drop(back.join());
}

fn pump(mut from: TcpStream, mut to: TcpStream, mut look: impl FnMut(&[u8])) {
    let mut bytes = vec![0; 256 << 10];
    // Either side closing ends both.
    while let Ok(read) = from.read(&mut bytes) {
        look(&bytes[..read]);
        if read == 0 || to.write_all(&bytes[..read]).is_err() {
            break;
        }
    }
    drop(to.shutdown(Shutdown::Both));
    drop(from.shutdown(Shutdown::Both));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_are_what_one_waits_for_after_the_other() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let passed = |begun, answered| Passed {
            line: String::new(),
            begun: at(begun),
            answered: Some(at(answered)),
        };
        assert_eq!(rounds(&[]), 0);
        // Two at once, then three at once, beside one that takes long.
        let all = [
            passed(0, 25),
            passed(1, 26),
            passed(30, 55),
            passed(30, 56),
            passed(31, 57),
            passed(2, 58),
        ];
        assert_eq!(rounds(&all), 2);
        let last = passed(60, 85);
        assert_eq!(rounds(&[&all[..], &[last]].concat()), 3);
    }
}
