//! A Kafka broker of a test's own, on its own port and folder, that can be killed and started again.

use std::path::{Path, PathBuf};
use std::process::Command;

use rdkafka::ClientConfig;
use rdkafka::consumer::{BaseConsumer, Consumer as _};
use std::time::{Duration, Instant};
use test_data::{Stopper, free_port};

/// Stopped and removed when dropped, and when this process ends.
pub(crate) struct Broker {
    /// Before the folder, which goes after it.
    _stopper: Stopper,
    folder: tempfile::TempDir,
    port: u16,
    controller_port: u16,
}

impl Broker {
    pub(crate) fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let broker = Self {
            _stopper: Stopper::new(&["kafka"], folder.path()).unwrap(),
            folder,
            port: free_port(),
            controller_port: free_port(),
        };
        broker.run("start");
        broker
    }

    pub(crate) fn servers(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    /// Starts it again in its folder and waits until it serves the topics it had.
    pub(crate) fn start_again(&self) {
        self.run("start");
        let mut config = ClientConfig::new();
        let client: BaseConsumer = config
            .set("bootstrap.servers", self.servers())
            .create()
            .unwrap();
        let until = Instant::now() + Duration::from_mins(1);
        while client
            .fetch_metadata(None, Duration::from_secs(2))
            .map_or(0, |found| found.topics().len())
            == 0
        {
            assert!(Instant::now() < until, "the broker does not come back");
        }
    }

    /// As a power cut would: no good-bye.
    pub(crate) fn kill(&self) {
        let pid = std::fs::read_to_string(self.folder.path().join("kafka/pid")).unwrap();
        let killed = Command::new("kill").args(["-9", pid.trim()]).status();
        assert!(killed.unwrap().success());
    }

    fn run(&self, verb: &str) {
        let output = Command::new("bash")
            .arg(script())
            .arg(verb)
            .env("FLUXGLOBE_RUN", self.folder.path())
            .env("FLUXGLOBE_KAFKA_PORT", self.port.to_string())
            .env(
                "FLUXGLOBE_KAFKA_CONTROLLER_PORT",
                self.controller_port.to_string(),
            )
            .env("FLUXGLOBE_KAFKA_HEAP", "256m")
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "kafka.sh {verb}: {said}");
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.run("stop");
        } else if let Ok(pid) = std::fs::read_to_string(self.folder.path().join("kafka/pid")) {
            // The folder goes away under it.
            drop(Command::new("kill").args(["-9", pid.trim()]).status());
        }
    }
}

fn script() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/services/kafka.sh")
}
