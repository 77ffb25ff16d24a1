//! Topics of a test's own on a running Kafka, removed at its end.

use std::time::Duration;

use kafka_log::{KafkaLog, KafkaSettings, create_topics};
use rdkafka::ClientConfig;
use rdkafka::admin::{AdminClient, AdminOptions};
use rdkafka::client::DefaultClientContext;

use contract::topic::Topic;

/// Few, so that tests of many groups stay quick.
pub(crate) const PARTITIONS: u32 = 2;

/// A log on topics that nobody else uses.
pub(crate) struct OwnTopics {
    pub(crate) settings: KafkaSettings,
    pub(crate) log: KafkaLog,
}

/// The brokers that tests use.
pub(crate) fn servers() -> String {
    std::env::var_os("FLUXGLOBE_KAFKA")
        .and_then(|servers| servers.into_string().ok())
        .expect(
            "FLUXGLOBE_KAFKA names no Kafka: run `deploy/services/services.sh install kafka` and `start kafka`, \
             then take its variables from `deploy/services/services.sh env`",
        )
}

/// Settings with a prefix that nobody else uses.
pub(crate) fn own_settings(servers: &str) -> KafkaSettings {
    let mut settings = KafkaSettings::plain(servers);
    settings.kafka_topic_prefix = format!("test-{}.", uuid::Uuid::new_v4().simple());
    settings.kafka_partitions = PARTITIONS;
    settings
}

pub(crate) async fn open() -> OwnTopics {
    open_on(&servers()).await
}

pub(crate) async fn open_on(servers: &str) -> OwnTopics {
    open_with(own_settings(servers)).await
}

pub(crate) async fn open_with(settings: KafkaSettings) -> OwnTopics {
    create_topics(&settings, 1).await.unwrap();
    let log = KafkaLog::connect(&settings).await.unwrap();
    OwnTopics { settings, log }
}

pub(crate) async fn end(own: OwnTopics) {
    remove(&own.settings).await;
}

/// Removes the topics of a prefix.
pub(crate) async fn remove(settings: &KafkaSettings) {
    let admin = admin(settings);
    let names = Topic::ALL.map(|topic| format!("{}{topic}", settings.kafka_topic_prefix));
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let options = AdminOptions::new().request_timeout(Some(Duration::from_secs(10)));
    admin.delete_topics(&names, &options).await.unwrap();
}

pub(crate) fn admin(settings: &KafkaSettings) -> AdminClient<DefaultClientContext> {
    let servers = settings.kafka.as_deref().unwrap();
    let mut config = ClientConfig::new();
    config.set("bootstrap.servers", servers).create().unwrap()
}
