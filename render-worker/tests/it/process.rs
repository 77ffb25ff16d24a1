//! A render worker in a process of its own, which can be killed: this test program, started again.

use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use ::service::Stop;
use prometheus::Registry;
use render::Backend;
use render_worker::Desk;
use render_worker::server::Server;
use storage::Store;

use crate::worker::settings;

/// Folder of the child's store; whoever sets it wants a worker instead of a test.
const STORE: &str = "FLUXGLOBE_TEST_WORKER_STORE";
const ANNOUNCED: &str = "worker listens on ";

/// A child that is killed when dropped.
pub(crate) struct WorkerProcess {
    child: Child,
    /// Its address.
    pub(crate) name: String,
}

impl WorkerProcess {
    /// Starts a worker over a store in a folder and waits until it listens.
    pub(crate) fn start(store: &Path) -> Self {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "process::a_worker_serves_until_its_input_ends",
                "--nocapture",
            ])
            .env(STORE, store)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let found = lines
            .map_while(Result::ok)
            .find_map(|line| line.split_once(ANNOUNCED).map(|(_, name)| name.to_owned()));
        Self {
            child,
            name: found.expect("the child says where it listens"),
        }
    }

    /// `kill -9`.
    pub(crate) fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Stops the process without ending it: connections stay open and nothing answers.
    pub(crate) fn freeze(&self) {
        let id = self.child.id().to_string();
        let frozen = Command::new("kill").args(["-STOP", &id]).status().unwrap();
        assert!(frozen.success());
    }
}

impl Drop for WorkerProcess {
    fn drop(&mut self) {
        // A child that is gone already cannot be killed again.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// The child's side. Run as a test it serves a store in memory for a moment, to see that it ends when it should.
#[test]
fn a_worker_serves_until_its_input_ends() {
    #[expect(
        clippy::disallowed_methods,
        reason = "how the parent test tells its child"
    )]
    let folder = std::env::var(STORE).ok();
    let store = match &folder {
        Some(folder) => Store::open(folder).unwrap(),
        None => Store::memory(),
    };
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let settings = settings(1, 8);
        let limits = settings.limits();
        let desk = Desk::open(store, Backend::Cpu, &limits, &Registry::new()).unwrap();
        let server = Server::bind(desk, &settings).unwrap();
        println!("{ANNOUNCED}{}", server.address());
        let stop = Stop::new();
        if folder.is_none() {
            stop.now();
        } else {
            let stop = stop.clone();
            std::thread::spawn(move || {
                // The parent never writes: its end, in order or not, ends this.
                drop(std::io::stdin().read_to_end(&mut vec![]));
                stop.now();
            });
        }
        server.run(stop).await.unwrap();
    });
}
