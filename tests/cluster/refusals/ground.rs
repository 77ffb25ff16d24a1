//! What a test of refusals stands on: topics of one partition, a store and an inbox of its own.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, RwLockReadGuard, Weak};
use std::time::{Duration, Instant};

use contract::topic::Topic;
use harness::node::Node;
use harness::servers::Servers;
use harness::{granule, program};
use kafka_log::{KafkaLog, KafkaSettings};
use serde_json::Value;
use storage::log::EventLog as _;
use tempfile::TempDir;
use test_data::free_port;

use super::{Bad, LIMIT, PRODUCT, files_below, refused_start, start, until};
use crate::together;

/// Topics, store and inbox of a test's own, over a Kafka that tests share.
pub(super) struct Ground {
    settings: Vec<(String, String)>,
    kafka: KafkaSettings,
    folder: TempDir,
    _servers: Arc<Servers>,
    _together: RwLockReadGuard<'static, ()>,
}

/// The Kafka of those tests that run now; the last one stops it.
fn kafka() -> Arc<Servers> {
    static SHARED: Mutex<Weak<Servers>> = Mutex::new(Weak::new());
    let mut shared = SHARED.lock().unwrap();
    shared.upgrade().unwrap_or_else(|| {
        let servers = Arc::new(Servers::start(&["kafka"]).unwrap());
        *shared = Arc::downgrade(&servers);
        servers
    })
}

impl Ground {
    /// With topics of one partition: what blocks there blocks everything behind it.
    pub(super) fn new() -> Self {
        let ground = Self::without_topics();
        ground.succeed(&["topics", "create"]);
        ground
    }

    pub(super) fn without_topics() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let together = together();
        let servers = kafka();
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        std::fs::create_dir(folder.path().join("inbox")).unwrap();
        let scheduler = format!("127.0.0.1:{}", free_port());
        let brokers = servers.setting("FLUXGLOBE_KAFKA").unwrap();
        let mut kafka = KafkaSettings::plain(brokers);
        kafka.kafka_topic_prefix = format!("ground-{}.", NEXT.fetch_add(1, Ordering::Relaxed));
        kafka.kafka_partitions = 1;
        let settings = [
            ("FLUXGLOBE_KAFKA", brokers.to_owned()),
            (
                "FLUXGLOBE_KAFKA_TOPIC_PREFIX",
                kafka.kafka_topic_prefix.clone(),
            ),
            ("FLUXGLOBE_KAFKA_PARTITIONS", "1".to_owned()),
            ("FLUXGLOBE_STORE", format!("file:{}", path("store"))),
            ("FLUXGLOBE_ALLOW_FOLDER", path("inbox")),
            ("FLUXGLOBE_SPOOL", path("spool")),
            ("FLUXGLOBE_EXECUTOR_WORK", path("work")),
            ("FLUXGLOBE_CLUSTER", format!("http://{scheduler}")),
            ("FLUXGLOBE_FETCH_TRIES", "2".to_owned()),
            ("FLUXGLOBE_FETCH_RETRY_S", "1".to_owned()),
            ("FLUXGLOBE_CPU", "true".to_owned()),
            ("FLUXGLOBE_LOG", "info".to_owned()),
        ];
        let settings = settings.map(|(name, value)| (name.to_owned(), value));
        Self {
            settings: settings.to_vec(),
            kafka,
            folder,
            _servers: servers,
            _together: together,
        }
    }

    pub(super) fn set(&mut self, name: &str, value: &str) {
        self.settings.retain(|(known, _)| known != name);
        self.settings.push((name.to_owned(), value.to_owned()));
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A good granule in the inbox.
    pub(super) fn good(&self) -> PathBuf {
        granule::write(&self.path("inbox"), 0, 0).unwrap()
    }

    pub(super) fn start(&self, service: &str) -> Node {
        start(self.folder.path(), service, &self.settings)
    }

    /// What a service says that must end by itself, as one that was refused does.
    pub(super) fn refused_start(&self, service: &str) -> String {
        refused_start(self.folder.path(), service, &self.settings)
    }

    pub(super) fn succeed(&self, words: &[&str]) -> String {
        let output = program::unset()
            .args(words)
            .envs(self.settings.iter().map(|(name, value)| (name, value)))
            .env("FLUXGLOBE_LOG", "warn")
            .output()
            .unwrap();
        let talk = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "fluxglobe {words:?}: {talk}");
        String::from_utf8(output.stdout).unwrap()
    }

    pub(super) fn with_log<T>(&self, ask: impl AsyncFnOnce(&KafkaLog) -> T) -> T {
        let runtime = tokio::runtime::Runtime::new().unwrap();
        runtime.block_on(async { ask(&self.log().await).await })
    }

    /// The log; on a busy machine a connection may need more than one try.
    async fn log(&self) -> KafkaLog {
        let mut tries = 1;
        loop {
            match KafkaLog::connect(&self.kafka).await {
                Ok(log) => return log,
                Err(error) => assert!(tries < 5, "no log after {tries} tries: {error}"),
            }
            tries += 1;
            tokio::time::sleep(Duration::from_secs(2)).await;
        }
    }

    /// Sends messages as any Kafka client might.
    pub(super) fn send(&self, topic: Topic, messages: &[Vec<u8>]) {
        self.with_log(async |log| {
            for content in messages {
                let content = content.clone().into();
                log.append_message(topic, "k", content).await.unwrap();
            }
        });
    }

    pub(super) fn count(&self, topic: Topic) -> usize {
        self.with_log(async |log| storage::log::contents(log, topic).await.unwrap().len())
    }

    /// Messages before a group; a group that nobody has joined yet has no coordinator for a moment.
    pub(super) fn lag(&self, topic: Topic, group: &str) -> u64 {
        let begun = Instant::now();
        self.with_log(async |log| {
            loop {
                match log.lag(topic, group).await {
                    Ok(lag) => return lag,
                    Err(error) => {
                        assert!(error.is_retryable() && begun.elapsed() < LIMIT, "{error}");
                    }
                }
            }
        })
    }

    pub(super) fn rejected(&self) -> Vec<Value> {
        let text = self.succeed(&["rejected", "list", "--json"]);
        text.lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect()
    }

    /// Objects of the store, by key.
    pub(super) fn objects(&self) -> Vec<String> {
        files_below(&self.path("store"))
    }

    /// Bad notices before a good one on one partition, to an ingest service that was told `told` besides: each bad one is
    /// refused with its reason and its place, the good one lands, and nothing else is stored.
    pub(super) fn refuse(mut self, told: &[(&str, &str)], bad: &[Bad]) {
        for (name, value) in told {
            self.set(name, value);
        }
        let messages: Vec<Vec<u8>> = bad.iter().map(|bad| bad.content.clone()).collect();
        self.send(Topic::GranuleNotice, &messages);
        let good = self.good();
        self.succeed(&["notice", "--product", PRODUCT, good.to_str().unwrap()]);
        let mut ingestd = self.start("ingestd");
        until("good granule behind bad ones", &mut ingestd, || {
            self.count(Topic::GranuleLanded) == 1 && self.count(Topic::GranuleRejected) >= bad.len()
        });
        let rejected = self.rejected();
        assert_eq!(rejected.len(), bad.len(), "{rejected:#?}");
        for (i, bad) in bad.iter().enumerate() {
            let origin = format!("granule.notice/0/{i}");
            let about = rejected
                .iter()
                .find(|about| about["origin"] == origin.as_str());
            let about = about.unwrap_or_else(|| panic!("no {origin} in {rejected:#?}"));
            assert_eq!(about["reason"], bad.reason, "{about}");
            assert_eq!(about["attempt"], 1, "{about}");
            let detail = about["detail"].as_str().unwrap();
            assert!(detail.contains(bad.says), "{detail}");
        }
        assert_eq!(self.lag(Topic::GranuleNotice, "ingest"), 0);
        let objects = self.objects();
        let below = |prefix: &str| objects.iter().filter(|key| key.starts_with(prefix)).count();
        assert_eq!((below("raw/"), below("manifests/")), (1, 1), "{objects:#?}");
        let counted = ingestd.metric("fluxglobe_ingestd_rejected_total").unwrap();
        assert_eq!(counted as usize, bad.len());
        assert_eq!(ingestd.get("/readyz").unwrap().status, 200);
        assert_eq!(ingestd.stop().unwrap(), Some(0));
        let left = std::fs::read_dir(self.path("spool")).map_or(0, Iterator::count);
        assert_eq!(left, 0, "files are left in the spool");
    }
}
