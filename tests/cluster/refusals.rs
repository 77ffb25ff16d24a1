//! Bad input at running services: each is refused in words that say what to do, nothing half done is left, and what is
//! good goes on.

mod ground;
mod messages;
mod setup;
mod sources;
mod tls;

use std::path::Path;
use std::time::{Duration, Instant};

use contract::digest::Digest;
use contract::event::{Body, Event};
use harness::node::Node;
use test_data::free_port;

use ground::Ground;

const LIMIT: Duration = Duration::from_mins(1);
/// What the good granule lands in.
const PRODUCT: &str = "good-flux";
/// Words of each service.
const SERVICES: [&str; 5] = [
    "ingestd",
    "scheduler",
    "executor",
    "render-worker",
    "tile-server",
];

/// A message that must be refused: its bytes, and what the refusal says.
struct Bad {
    content: Vec<u8>,
    reason: &'static str,
    says: &'static str,
}

/// Starts a service with a health address of its own.
fn start(folder: &Path, service: &str, settings: &[(String, String)]) -> Node {
    let address = || format!("127.0.0.1:{}", free_port());
    let (admin, port) = (address(), address());
    // Executors and commands find the scheduler where they are told that it is.
    let told = settings
        .iter()
        .find(|(name, _)| name == "FLUXGLOBE_CLUSTER");
    let scheduler = told.map_or(&*port, |(_, url)| url.trim_start_matches("http://"));
    let words: &[&str] = match service {
        "scheduler" => &[
            "scheduler",
            "--scheduler-listen",
            scheduler,
            "--admin",
            &admin,
        ],
        "executor" => &["executor", "--executor-listen", &port, "--admin", &admin],
        "render-worker" => &["render-worker", "--render-listen", &port, "--admin", &admin],
        "tile-server" => &["tile-server", "--listen", &admin],
        other => &[other, "--admin", &admin],
    };
    Node::start(folder, service, words, &admin, settings).unwrap()
}

fn refused_start(folder: &Path, service: &str, settings: &[(String, String)]) -> String {
    // What an earlier start said is no answer to this one.
    drop(std::fs::remove_file(folder.join(format!("{service}.log"))));
    let mut node = start(folder, service, settings);
    let code = node.wait_until_ended().unwrap();
    let talk = node.talk();
    assert_eq!(code, Some(1), "{service}: {talk}");
    assert!(!talk.contains("panicked"), "{service}: {talk}");
    talk
}

fn until(what: &str, node: &mut Node, mut is_so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(!node.has_ended(), "{} ended: {}", node.name, node.talk());
        assert!(start.elapsed() < LIMIT, "no {what}: {}", node.talk());
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Files of a folder and those below it, relative to it, in order.
fn files_below(folder: &Path) -> Vec<String> {
    fn gather(root: &Path, folder: &Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                gather(root, &path, found);
            } else {
                found.push(path.strip_prefix(root).unwrap().display().to_string());
            }
        }
    }
    let mut found = vec![];
    gather(folder, folder, &mut found);
    found.sort();
    found
}

/// A notice of a path.
fn notice(path: &str) -> Event {
    promised(path, None, None)
}

/// A notice of a path, with what its sender says of the file.
fn promised(path: &str, sha256: Option<Digest>, size_bytes: Option<u64>) -> Event {
    let body = Body::GranuleNotice {
        path: path.to_owned(),
        profile: None,
        product: None,
        variable: None,
        indexes: vec![],
        sha256,
        size_bytes,
        attempt: 1,
    };
    Event::new("bad", body)
}

fn bad(content: impl Into<Vec<u8>>, reason: &'static str, says: &'static str) -> Bad {
    Bad {
        content: content.into(),
        reason,
        says,
    }
}
