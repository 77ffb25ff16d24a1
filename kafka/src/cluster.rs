//! A Kafka cluster as the settings name it: client configurations, and names of topics, groups and transactions.

use contract::event::MAX_EVENT_BYTES;
use contract::topic::Topic;
use rdkafka::ClientConfig;
use rdkafka::config::RDKafkaLogLevel;
use storage::StorageError;

use crate::settings::{KafkaSettings, Security};
use crate::{KafkaFailure, secret};

/// Largest message that is sent or may lie in a topic, bytes: an event with its key and the record's frame.
pub(crate) const MAX_RECORD_BYTES: usize = MAX_EVENT_BYTES + (64 << 10);
/// How long a record may take until it is durable, milliseconds.
pub(crate) const DELIVERY_LIMIT_MS: u64 = 8_000;
/// A transaction that was left open is ended by Kafka after this, milliseconds: readers of what follows wait so long for
/// a process that was killed at the wrong moment and does not come back. Longer than any step of ours.
const TRANSACTION_LIMIT_MS: u64 = 10_000;
/// A member that was not heard of for so long is taken out of its group, milliseconds: the least that brokers allow by
/// default.
const SESSION_LIMIT_MS: u64 = 6_000;
const HEARTBEAT_MS: u64 = 1_500;
/// Largest answer of a broker, bytes: some fetched batches.
const MAX_ANSWER_BYTES: usize = 16 << 20;

/// Settings made ready.
#[derive(Clone)]
pub(crate) struct Cluster {
    /// Holds the password: never shown.
    base: ClientConfig,
    servers: String,
    prefix: String,
    instance: String,
    partitions: u32,
}

impl Cluster {
    /// Reads the secrets and checks that the settings go together; asks no broker.
    pub(crate) fn open(settings: &KafkaSettings) -> Result<Self, KafkaFailure> {
        let servers = settings.kafka.clone().ok_or(KafkaFailure::Settings(
            "--kafka (FLUXGLOBE_KAFKA) is needed: HOST:PORT[,HOST:PORT...]",
        ))?;
        let instance = settings
            .kafka_instance
            .clone()
            .unwrap_or_else(|| uuid::Uuid::new_v4().simple().to_string());
        let mut base = ClientConfig::new();
        base.set_log_level(RDKafkaLogLevel::Warning)
            .set("bootstrap.servers", &servers)
            .set(
                "client.id",
                format!("fluxglobe-{}{instance}", settings.kafka_topic_prefix),
            )
            .set("security.protocol", settings.kafka_security.as_str())
            .set("socket.keepalive.enable", "true")
            .set("socket.timeout.ms", "10000")
            .set("socket.connection.setup.timeout.ms", "5000")
            .set("reconnect.backoff.max.ms", "2000")
            .set("log.connection.close", "false");
        set_login(&mut base, settings)?;
        set_tls(&mut base, settings)?;
        Ok(Self {
            base,
            servers,
            prefix: settings.kafka_topic_prefix.clone(),
            instance,
            partitions: settings.kafka_partitions,
        })
    }

    pub(crate) fn servers(&self) -> &str {
        &self.servers
    }

    /// Partitions that each topic must have.
    pub(crate) fn partitions(&self) -> u32 {
        self.partitions
    }

    /// Name of a topic in Kafka.
    pub(crate) fn topic(&self, topic: Topic) -> String {
        format!("{}{topic}", self.prefix)
    }

    /// Name of a group in Kafka: each topic has its own, so that members of one do not disturb those of another.
    pub(crate) fn group(&self, topic: Topic, group: &str) -> String {
        format!("{}{group}.{topic}", self.prefix)
    }

    /// Name of the transactions of one part of this process.
    pub(crate) fn transactional_id(&self, part: &str) -> String {
        format!("{}{}.{part}", self.prefix, self.instance)
    }

    /// For a client that administers.
    pub(crate) fn admin(&self) -> ClientConfig {
        self.base.clone()
    }

    /// For a client that only asks; it belongs to no group.
    pub(crate) fn asking(&self) -> ClientConfig {
        let mut config = self.base.clone();
        config.set("isolation.level", "read_committed");
        config
    }

    /// For a client that appends. Its queue is bounded: full is an error that passes.
    pub(crate) fn appending(&self) -> ClientConfig {
        let mut config = self.base.clone();
        config
            .set("enable.idempotence", "true")
            .set("acks", "all")
            .set("compression.codec", "lz4")
            // The same partition for a key as other Kafka clients choose.
            .set("partitioner", "murmur2_random")
            .set("linger.ms", "1")
            .set("message.max.bytes", MAX_RECORD_BYTES.to_string())
            .set("message.timeout.ms", DELIVERY_LIMIT_MS.to_string())
            .set("queue.buffering.max.messages", "10000")
            .set("queue.buffering.max.kbytes", "32768");
        config
    }

    /// For a client that appends in transactions.
    pub(crate) fn transacting(&self, part: &str) -> ClientConfig {
        let mut config = self.appending();
        config
            .set("transactional.id", self.transactional_id(part))
            .set("transaction.timeout.ms", TRANSACTION_LIMIT_MS.to_string());
        config
    }

    /// For a client that reads partitions given to it, under the name of a group but not as a member.
    pub(crate) fn reading(&self, group: &str) -> ClientConfig {
        let mut config = self.asking();
        config
            .set("group.id", group)
            .set("enable.auto.commit", "false")
            .set("enable.auto.offset.store", "false")
            .set("auto.offset.reset", "earliest")
            .set("check.crcs", "true")
            // What the client fetches ahead is bounded: by default it would be 64 MiB.
            .set("queued.min.messages", "1000")
            .set("queued.max.messages.kbytes", "4096")
            .set("fetch.queue.backoff.ms", "20")
            // A partition that is read on after a pause waits for the fetch that is under way.
            .set("fetch.wait.max.ms", "100")
            .set("fetch.message.max.bytes", MAX_RECORD_BYTES.to_string())
            .set("fetch.max.bytes", (4 << 20).to_string())
            .set("receive.message.max.bytes", MAX_ANSWER_BYTES.to_string());
        config
    }

    /// For a member of a group.
    pub(crate) fn member(&self, group: &str) -> ClientConfig {
        let mut config = self.reading(group);
        config
            // Members keep most partitions, and what is under way in them, when others come and go.
            .set("partition.assignment.strategy", "cooperative-sticky")
            .set("session.timeout.ms", SESSION_LIMIT_MS.to_string())
            .set("heartbeat.interval.ms", HEARTBEAT_MS.to_string())
            .set("max.poll.interval.ms", "60000");
        config
    }
}

impl KafkaSettings {
    /// Checks what can be checked without asking a broker: that brokers are named, that the settings go together, that
    /// the files they name are there and the secrets in them are lines of text.
    ///
    /// # Errors
    /// `LogSetup`, naming the setting.
    pub fn check(&self) -> Result<(), StorageError> {
        let log = self.kafka.as_deref().unwrap_or("on Kafka");
        match Cluster::open(self) {
            Ok(_cluster) => Ok(()),
            Err(failure) => Err(failure.of_log(log)),
        }
    }
}

fn set_login(config: &mut ClientConfig, settings: &KafkaSettings) -> Result<(), KafkaFailure> {
    let (user, file) = (&settings.kafka_user, &settings.kafka_password_file);
    if !settings.kafka_security.has_sasl() {
        // A file that is named for all services, whether there is one or not, is not asked to be there.
        let has_password = file.as_ref().is_some_and(|file| file.exists());
        return if user.is_some() || has_password {
            Err(KafkaFailure::Settings(
                "--kafka-user and --kafka-password-file need --kafka-security sasl_ssl or sasl_plaintext",
            ))
        } else {
            Ok(())
        };
    }
    let (Some(user), Some(file)) = (user, file) else {
        return Err(KafkaFailure::Settings(
            "--kafka-security sasl_ssl and sasl_plaintext need --kafka-user and --kafka-password-file",
        ));
    };
    if user.is_empty() || user.chars().any(char::is_control) {
        return Err(KafkaFailure::Settings(
            "--kafka-user must be a line of text",
        ));
    }
    if settings.kafka_security == Security::SaslPlaintext {
        tracing::warn!("the login to Kafka goes over no encryption");
    }
    config
        .set("sasl.mechanism", settings.kafka_sasl_mechanism.as_str())
        .set("sasl.username", user)
        .set(
            "sasl.password",
            secret::read("--kafka-password-file", file)?,
        );
    Ok(())
}

fn set_tls(config: &mut ClientConfig, settings: &KafkaSettings) -> Result<(), KafkaFailure> {
    let files = [
        (
            "--kafka-ca-file",
            "ssl.ca.location",
            &settings.kafka_ca_file,
        ),
        (
            "--kafka-certificate-file",
            "ssl.certificate.location",
            &settings.kafka_certificate_file,
        ),
        (
            "--kafka-key-file",
            "ssl.key.location",
            &settings.kafka_key_file,
        ),
    ];
    let password = &settings.kafka_key_password_file;
    let has_any = files.iter().any(|(_, _, file)| file.is_some()) || password.is_some();
    if has_any && !settings.kafka_security.has_tls() {
        return Err(KafkaFailure::Settings(
            "--kafka-ca-file, --kafka-certificate-file and --kafka-key-file need --kafka-security ssl or sasl_ssl",
        ));
    }
    if settings.kafka_certificate_file.is_some() != settings.kafka_key_file.is_some()
        || (password.is_some() && settings.kafka_key_file.is_none())
    {
        return Err(KafkaFailure::Settings(
            "--kafka-certificate-file and --kafka-key-file go together",
        ));
    }
    for (flag, key, file) in files {
        if let Some(file) = file {
            config.set(key, secret::check_readable(flag, file)?);
        }
    }
    if let Some(file) = password {
        let password = secret::read("--kafka-key-password-file", file)?;
        config.set("ssl.key.password", password);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_login_without_its_secret_is_refused_before_any_broker_is_asked() {
        let mut settings = KafkaSettings::plain("nowhere.invalid:1");
        settings.kafka_security = Security::SaslSsl;
        settings.kafka_user = Some("bob".to_owned());
        let refusal = |settings: &KafkaSettings| Cluster::open(settings).err().unwrap().to_string();
        assert!(refusal(&settings).contains("--kafka-password-file"));
        let folder = tempfile::tempdir().unwrap();
        settings.kafka_password_file = Some(folder.path().join("none"));
        assert!(refusal(&settings).contains("cannot be used"));
        settings.kafka_security = Security::Plaintext;
        assert!(refusal(&settings).contains("need --kafka-security"));
        settings.kafka_user = None;
        assert!(Cluster::open(&settings).is_ok(), "no user, no password");
        std::fs::write(folder.path().join("none"), "hush").unwrap();
        assert!(refusal(&settings).contains("need --kafka-security"));
    }

    #[test]
    fn the_password_reaches_the_client_and_nothing_that_is_shown() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("password");
        std::fs::write(&file, "hush\n").unwrap();
        let mut settings = KafkaSettings::plain("nowhere.invalid:1");
        settings.kafka_security = Security::SaslPlaintext;
        settings.kafka_user = Some("bob".to_owned());
        settings.kafka_password_file = Some(file);
        let cluster = Cluster::open(&settings).unwrap();
        assert_eq!(cluster.admin().get("sasl.password"), Some("hush"));
        assert!(!format!("{settings:?} {:?}", cluster.admin()).contains("hush"));
    }

    #[test]
    fn names_of_two_installations_and_two_topics_never_meet() {
        let mut settings = KafkaSettings::plain("a:1");
        settings.kafka_topic_prefix = "x.".to_owned();
        settings.kafka_instance = Some("pod-0".to_owned());
        let cluster = Cluster::open(&settings).unwrap();
        assert_eq!(cluster.topic(Topic::RenderJob), "x.render.job");
        assert_eq!(
            cluster.group(Topic::Observation, "ingest"),
            "x.ingest.observation"
        );
        assert_eq!(cluster.transactional_id("append"), "x.pod-0.append");
    }

    #[test]
    fn each_kind_of_client_is_accepted_by_the_library() {
        let cluster = Cluster::open(&KafkaSettings::plain("a:1")).unwrap();
        for config in [
            cluster.admin(),
            cluster.asking(),
            cluster.appending(),
            cluster.transacting("append"),
            cluster.reading("g"),
            cluster.member("g"),
        ] {
            config.create_native_config().unwrap();
        }
    }
}
