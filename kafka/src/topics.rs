//! The topics: made with their retention, and checked before any work.

use std::time::Duration;

use contract::topic::Topic;
use rdkafka::admin::{AdminClient, AdminOptions, NewTopic, TopicReplication};
use rdkafka::error::{KafkaError, RDKafkaErrorCode};
use storage::StorageError;
use tokio::time::Instant;

use crate::cluster::{Cluster, MAX_RECORD_BYTES};
use crate::context::Context;
use crate::probe::{ASK_LIMIT, Found, Probe};
use crate::{KafkaFailure, KafkaSettings};

const DAY_MS: u64 = 24 * 60 * 60 * 1000;
/// Notices, measurements and what was refused of them: so long they can be sent again.
const SOURCE_DAYS: u64 = 30;
/// What followed: whoever was away so long reads the store anew.
const FOLLOWED_DAYS: u64 = 14;
/// Pictures: drawn anew when asked for.
const PICTURE_DAYS: u64 = 2;
/// Pause before a topic is looked for again that was just made.
const LOOK_PAUSE: Duration = Duration::from_millis(100);

/// A topic, and whether it was made now or there before.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicMade {
    /// Its name in Kafka.
    pub name: String,
    /// Was it made now?
    pub is_new: bool,
}

/// Makes the topics that are missing, with as many partitions as the settings say and `replication` copies of each
/// (at most as many as there are brokers); with three copies or more, two must have a message before it counts.
///
/// # Errors
/// No broker; a topic that is there with another partition count.
pub async fn create_topics(
    settings: &KafkaSettings,
    replication: u16,
) -> Result<Vec<TopicMade>, StorageError> {
    let servers = settings.kafka.clone().unwrap_or_default();
    create(settings, replication)
        .await
        .map_err(|failure| failure.of_log(&servers))
}

async fn create(
    settings: &KafkaSettings,
    replication: u16,
) -> Result<Vec<TopicMade>, KafkaFailure> {
    const STEP: &str = "making topics";
    let cluster = Cluster::open(settings)?;
    let context = Context::default();
    // Asked first: an administrator's client says less about why it cannot reach a broker.
    let probe = Probe::open(&cluster)?;
    probe.topics(&Topic::ALL[..1], ASK_LIMIT).await?;
    let admin: AdminClient<Context> = cluster
        .admin()
        .create_with_context(context.clone())
        .map_err(|e| context.failure(STEP, e))?;
    let names = Topic::ALL.map(|topic| cluster.topic(topic));
    let texts = Topic::ALL.map(|topic| config(topic, replication));
    let new = names.iter().zip(&texts).map(|(name, config)| {
        let copies = TopicReplication::Fixed(i32::from(replication));
        let topic = NewTopic::new(name, cluster.partitions() as i32, copies);
        config
            .iter()
            .fold(topic, |topic, (key, value)| topic.set(key, value))
    });
    let new: Vec<NewTopic<'_>> = new.collect();
    let options = AdminOptions::new()
        .request_timeout(Some(ASK_LIMIT))
        .operation_timeout(Some(ASK_LIMIT));
    let results = admin
        .create_topics(&new, &options)
        .await
        .map_err(|e| context.failure(STEP, e))?;
    let mut made = vec![];
    for result in results {
        made.push(match result {
            Ok(name) => TopicMade { name, is_new: true },
            Err((name, RDKafkaErrorCode::TopicAlreadyExists)) => TopicMade {
                name,
                is_new: false,
            },
            Err((_name, code)) => return Err(context.failure(STEP, KafkaError::Global(code))),
        });
    }
    // Brokers hear of new topics one after the other.
    let until = Instant::now() + ASK_LIMIT;
    loop {
        match check(&cluster, &probe).await {
            Ok(()) => return Ok(made),
            Err(failure) if Instant::now() >= until || !made.iter().any(|topic| topic.is_new) => {
                return Err(failure);
            }
            Err(_not_yet) => tokio::time::sleep(LOOK_PAUSE).await,
        }
    }
}

fn config(topic: Topic, replication: u16) -> Vec<(&'static str, String)> {
    let days = match topic {
        Topic::GranuleNotice | Topic::Observation | Topic::GranuleRejected => SOURCE_DAYS,
        Topic::GranuleLanded | Topic::ProductDerived => FOLLOWED_DAYS,
        Topic::RenderJob | Topic::RenderDone => PICTURE_DAYS,
    };
    let copies_in_sync = if replication >= 3 { 2 } else { 1 };
    vec![
        ("cleanup.policy", "delete".to_owned()),
        ("retention.ms", (days * DAY_MS).to_string()),
        ("max.message.bytes", MAX_RECORD_BYTES.to_string()),
        ("min.insync.replicas", copies_in_sync.to_string()),
        // As producers compress it: ours do, others need not.
        ("compression.type", "producer".to_owned()),
    ]
}

/// Are all topics there, with the right partition counts? A key's partition follows from the count, so one that changed
/// would break the order of a product's events: the count must be the settings' exactly.
pub(crate) async fn check(cluster: &Cluster, probe: &Probe) -> Result<(), KafkaFailure> {
    let until = Instant::now() + ASK_LIMIT;
    while let Some(leaderless) = find_leaderless(cluster, probe).await? {
        if Instant::now() >= until {
            return Err(KafkaFailure::Client {
                step: "looking for topics",
                source: KafkaError::MetadataFetch(RDKafkaErrorCode::LeaderNotAvailable),
                noted: Some(leaderless),
            });
        }
        // A broker that was lost for a moment leads again soon: no reason for a command to fail.
        tokio::time::sleep(LOOK_PAUSE).await;
    }
    Ok(())
}

/// A topic of which a partition has no leader now, if there is one; an error if one is missing or made otherwise.
async fn find_leaderless(cluster: &Cluster, probe: &Probe) -> Result<Option<String>, KafkaFailure> {
    let wanted = cluster.partitions();
    let mut leaderless = None;
    for (topic, found) in probe.topics(&Topic::ALL, ASK_LIMIT).await? {
        let name = cluster.topic(topic);
        match found {
            Found::Partitions(count) if count == wanted => {}
            Found::Partitions(count) => {
                return Err(KafkaFailure::Topic(format!(
                    "topic {name} has {count} partitions, {wanted} are wanted; \
                     give --kafka-partitions {count}, or stop all services, remove the topic and run `fluxglobe topics create`"
                )));
            }
            Found::Missing => {
                return Err(KafkaFailure::Topic(format!(
                    "topic {name} is missing, {wanted} partitions are wanted; run `fluxglobe topics create`"
                )));
            }
            Found::Leaderless => leaderless = Some(name),
        }
    }
    Ok(leaderless)
}
