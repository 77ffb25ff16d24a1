//! An S3 server of the test's own that is killed and started again under writers: what was acknowledged is there.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use contract::key::ObjectKey;
use storage::Store;
use storage::store::Settings;
use tokio::task::JoinHandle;

use crate::suite::noise;

const WRITERS: u64 = 8;
const OBJECT_BYTES: usize = 100_000;
/// How long the server is gone each time; less than the retry limit of a store.
const AWAY: Duration = Duration::from_secs(1);

/// A server in a folder and on a port of its own; stopped with this value, and with this process.
struct Server {
    /// Before the folder, which goes after it.
    _stopper: test_data::Stopper,
    run: tempfile::TempDir,
    port: u16,
}

impl Server {
    fn start() -> Self {
        let run = tempfile::tempdir().unwrap();
        let server = Self {
            _stopper: test_data::Stopper::new(&["s3"], run.path()).unwrap(),
            run,
            port: test_data::free_port(),
        };
        server.tell("start");
        server
    }

    /// Runs the services' script and gives what it prints.
    fn tell(&self, verb: &str) -> String {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/services/services.sh");
        let told = Command::new(script)
            .args([verb, "s3"])
            .env("FLUXGLOBE_RUN", self.run.path())
            .env("FLUXGLOBE_S3_PORT", self.port.to_string())
            .output()
            .unwrap();
        let complaint = String::from_utf8_lossy(&told.stderr);
        assert!(told.status.success(), "services.sh {verb} s3: {complaint}");
        String::from_utf8(told.stdout).unwrap()
    }

    /// The settings that its script prints as `export NAME=VALUE`.
    fn variables(&self) -> Vec<(String, String)> {
        let said = self.tell("env");
        said.lines()
            .filter_map(|line| line.strip_prefix("export ")?.split_once('='))
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
            .collect()
    }

    fn kill(&self) {
        let pid: PathBuf = self.run.path().join("s3/pid");
        let pid = std::fs::read_to_string(pid).unwrap();
        let killed = Command::new("kill").args(["-9", pid.trim()]).status();
        assert!(killed.unwrap().success(), "there was no server to kill");
    }
}

fn key(writer: u64, number: u64) -> ObjectKey {
    format!("objects/{writer}/{number:06}").parse().unwrap()
}

/// Writes until the end; how many objects were acknowledged, and the longest wait.
fn write(store: &Store, writer: u64, end: Instant) -> JoinHandle<(u64, Duration)> {
    let store = store.clone();
    tokio::spawn(async move {
        let (mut number, mut longest) = (0, Duration::ZERO);
        while Instant::now() < end {
            let begun = Instant::now();
            let content = noise(OBJECT_BYTES, writer * 1_000_000 + number);
            store.put_new(&key(writer, number), content).await.unwrap();
            longest = longest.max(begun.elapsed());
            number += 1;
            // A bounded number of objects, however fast the server is.
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        (number, longest)
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_killed_under_writers_loses_nothing_that_it_acknowledged() {
    let server = tokio::task::spawn_blocking(Server::start).await.unwrap();
    let variables = server.variables();
    let bucket = variables
        .iter()
        .find(|(name, _)| name == "FLUXGLOBE_S3_BUCKET");
    let url = format!("s3://{}/p", bucket.unwrap().1);
    let store = Store::open_with(&url, &Settings::from_variables(variables.clone())).unwrap();
    store.check_writable().await.unwrap();
    let end = Instant::now() + Duration::from_secs(9);
    let writers: Vec<_> = (0..WRITERS)
        .map(|writer| write(&store, writer, end))
        .collect();
    let server = tokio::task::spawn_blocking(move || {
        for pause_ms in [900, 1300, 700] {
            std::thread::sleep(Duration::from_millis(pause_ms));
            server.kill();
            std::thread::sleep(AWAY);
            server.tell("start");
        }
        server
    });
    let server = server.await.unwrap();
    let (mut total, mut longest) = (0, Duration::ZERO);
    for (writer, writing) in (0..WRITERS).zip(writers) {
        let (count, waited) = writing.await.unwrap();
        for number in 0..count {
            let content = noise(OBJECT_BYTES, writer * 1_000_000 + number);
            assert!(store.get(&key(writer, number)).await.unwrap() == content);
        }
        total += count;
        longest = longest.max(waited);
    }
    assert_eq!(store.list("objects").await.unwrap().len() as u64, total);
    assert!(
        longest >= AWAY,
        "no writer met a killed server: this tests nothing"
    );
    println!("{total} objects through 3 kills, the longest wait {longest:?}");
    tokio::task::spawn_blocking(move || drop(server))
        .await
        .unwrap();
}
