//! How Kafka is reached: flags, and environment variables of the same names. Secrets come from files only.

use std::path::PathBuf;

/// Most brokers that a list of brokers may name.
const MAX_SERVERS: usize = 32;
/// Longest prefix and instance name, bytes.
const MAX_NAME_BYTES: usize = 64;

/// Partitions of each topic unless said otherwise.
pub(crate) const DEFAULT_PARTITIONS: u32 = 4;

/// How brokers are spoken to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Security {
    /// No encryption, no names.
    Plaintext,
    /// TLS; the client shows a certificate if one is given.
    Ssl,
    /// A name and a password over no encryption.
    SaslPlaintext,
    /// A name and a password over TLS.
    SaslSsl,
}

impl Security {
    pub(crate) fn has_tls(self) -> bool {
        match self {
            Self::Ssl | Self::SaslSsl => true,
            Self::Plaintext | Self::SaslPlaintext => false,
        }
    }

    pub(crate) fn has_sasl(self) -> bool {
        match self {
            Self::SaslPlaintext | Self::SaslSsl => true,
            Self::Plaintext | Self::Ssl => false,
        }
    }

    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Self::Plaintext => "plaintext",
            Self::Ssl => "ssl",
            Self::SaslPlaintext => "sasl_plaintext",
            Self::SaslSsl => "sasl_ssl",
        }
    }
}

/// How name and password are shown to a broker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SaslMechanism {
    /// As they are: only over TLS.
    #[value(name = "PLAIN")]
    Plain,
    /// As a salted challenge.
    #[value(name = "SCRAM-SHA-256")]
    ScramSha256,
    /// As a salted challenge.
    #[value(name = "SCRAM-SHA-512")]
    ScramSha512,
}

impl SaslMechanism {
    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Self::Plain => "PLAIN",
            Self::ScramSha256 => "SCRAM-SHA-256",
            Self::ScramSha512 => "SCRAM-SHA-512",
        }
    }
}

/// Where Kafka is and how it is used. Holds names of secret files, never a secret.
#[derive(Debug, Clone, clap::Args)]
pub struct KafkaSettings {
    /// Kafka's brokers, HOST:PORT[,HOST:PORT...], at most 32
    #[arg(long, env = "FLUXGLOBE_KAFKA", value_name = "SERVERS", value_parser = servers)]
    pub kafka: Option<String>,
    /// How brokers are spoken to
    #[arg(
        long,
        env = "FLUXGLOBE_KAFKA_SECURITY",
        default_value = "plaintext",
        value_enum
    )]
    pub kafka_security: Security,
    /// How name and password are shown, for `sasl_plaintext` and `sasl_ssl`
    #[arg(
        long,
        env = "FLUXGLOBE_KAFKA_SASL_MECHANISM",
        default_value = "SCRAM-SHA-512",
        value_enum
    )]
    pub kafka_sasl_mechanism: SaslMechanism,
    /// Name to log in with, for `sasl_plaintext` and `sasl_ssl`
    #[arg(long, env = "FLUXGLOBE_KAFKA_USER")]
    pub kafka_user: Option<String>,
    /// File with the password, one line, at most 4 KiB
    #[arg(long, env = "FLUXGLOBE_KAFKA_PASSWORD_FILE", value_name = "FILE")]
    pub kafka_password_file: Option<PathBuf>,
    /// File with the certificates (PEM) that brokers' certificates must go back to; the system's own if absent
    #[arg(long, env = "FLUXGLOBE_KAFKA_CA_FILE", value_name = "FILE")]
    pub kafka_ca_file: Option<PathBuf>,
    /// File with this client's certificate (PEM)
    #[arg(long, env = "FLUXGLOBE_KAFKA_CERTIFICATE_FILE", value_name = "FILE")]
    pub kafka_certificate_file: Option<PathBuf>,
    /// File with the key (PEM) of this client's certificate
    #[arg(long, env = "FLUXGLOBE_KAFKA_KEY_FILE", value_name = "FILE")]
    pub kafka_key_file: Option<PathBuf>,
    /// File with the password of that key, one line, at most 4 KiB
    #[arg(long, env = "FLUXGLOBE_KAFKA_KEY_PASSWORD_FILE", value_name = "FILE")]
    pub kafka_key_password_file: Option<PathBuf>,
    /// What names of topics, groups and transactions begin with, so that several installations can share a cluster;
    /// letters, digits, `.`, `_` and `-`, at most 64
    #[arg(long, env = "FLUXGLOBE_KAFKA_TOPIC_PREFIX", default_value = "", value_parser = name)]
    pub kafka_topic_prefix: String,
    /// A name that only this process has and keeps over restarts, so that a transaction left open by a kill is ended at
    /// the restart and not by a timeout; a random one if absent; letters, digits, `.`, `_` and `-`, at most 64
    #[arg(long, env = "FLUXGLOBE_KAFKA_INSTANCE", value_name = "NAME", value_parser = instance)]
    pub kafka_instance: Option<String>,
    /// Partitions that each topic must have, 1 to 1000: as many members of a group can share its work
    #[arg(long, env = "FLUXGLOBE_KAFKA_PARTITIONS", default_value_t = DEFAULT_PARTITIONS, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub kafka_partitions: u32,
}

impl KafkaSettings {
    /// Brokers without encryption or login, all else as by default.
    pub fn plain(servers: impl Into<String>) -> Self {
        Self {
            kafka: Some(servers.into()),
            kafka_security: Security::Plaintext,
            kafka_sasl_mechanism: SaslMechanism::ScramSha512,
            kafka_user: None,
            kafka_password_file: None,
            kafka_ca_file: None,
            kafka_certificate_file: None,
            kafka_key_file: None,
            kafka_key_password_file: None,
            kafka_topic_prefix: String::new(),
            kafka_instance: None,
            kafka_partitions: DEFAULT_PARTITIONS,
        }
    }
}

fn servers(text: &str) -> Result<String, String> {
    let all: Vec<&str> = text.split(',').collect();
    if all.len() > MAX_SERVERS {
        return Err(format!("at most {MAX_SERVERS} brokers"));
    }
    if all.iter().all(|server| is_server(server)) {
        Ok(text.to_owned())
    } else {
        Err("give HOST:PORT[,HOST:PORT...]".to_owned())
    }
}

fn is_server(text: &str) -> bool {
    let Some((host, port)) = text.rsplit_once(':') else {
        return false;
    };
    let is_host = |c: char| c.is_ascii_alphanumeric() || ".-_:[]".contains(c);
    !host.is_empty()
        && host.len() <= 255
        && host.chars().all(is_host)
        && port.parse::<u16>().is_ok_and(|port| port > 0)
}

fn name(text: &str) -> Result<String, String> {
    let is_fine = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    if text.len() <= MAX_NAME_BYTES && text.chars().all(is_fine) {
        Ok(text.to_owned())
    } else {
        Err(format!(
            "at most {MAX_NAME_BYTES} letters, digits, '.', '_' and '-'"
        ))
    }
}

fn instance(text: &str) -> Result<String, String> {
    if text.is_empty() {
        return Err("a name".to_owned());
    }
    name(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[derive(clap::Parser)]
    struct Program {
        #[command(flatten)]
        kafka: KafkaSettings,
    }

    fn parse(arguments: &[&str]) -> Result<KafkaSettings, clap::Error> {
        Program::try_parse_from([&["program"], arguments].concat()).map(|program| program.kafka)
    }

    #[test]
    fn flags_are_read_with_their_limits() {
        let settings = parse(&[
            "--kafka=a.example:9092,[::1]:9093",
            "--kafka-security=sasl_ssl",
            "--kafka-sasl-mechanism=SCRAM-SHA-256",
            "--kafka-topic-prefix=test-1.",
        ])
        .unwrap();
        assert_eq!(settings.kafka_security, Security::SaslSsl);
        assert_eq!(
            settings.kafka_sasl_mechanism.as_str(),
            SaslMechanism::ScramSha256.as_str()
        );
        for bad in [
            "--kafka=localhost",
            "--kafka=a:0",
            "--kafka=a:1,",
            "--kafka=a b:1",
            "--kafka-security=tls",
            "--kafka-topic-prefix=a/b",
            "--kafka-instance=",
            "--kafka-partitions=0",
            "--kafka-partitions=1001",
        ] {
            assert!(parse(&[bad]).is_err(), "{bad}");
        }
    }

    #[test]
    fn names_said_to_kafka_are_the_names_of_the_flags() {
        for security in <Security as clap::ValueEnum>::value_variants() {
            let flag = format!("--kafka-security={}", security.as_str());
            assert_eq!(parse(&[&flag]).unwrap().kafka_security, *security);
        }
        for mechanism in <SaslMechanism as clap::ValueEnum>::value_variants() {
            let flag = format!("--kafka-sasl-mechanism={}", mechanism.as_str());
            assert_eq!(parse(&[&flag]).unwrap().kafka_sasl_mechanism, *mechanism);
        }
    }
}
