//! TLS, client certificates and logins against a broker that asks for them.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use kafka_log::{KafkaLog, KafkaSettings, SaslMechanism, Security, create_topics};
use storage::StorageError;
use storage::log::{EventLog as _, contents};
use test_data::free_port;
use tokio::time::Instant;

use crate::events::{FROM, notice, paths};
use crate::own_topics::own_settings;

const USER: &str = "bob";
const PASSWORD: &str = "correct horse";

/// A broker with a port for logins over TLS and one for client certificates.
struct GuardedBroker {
    folder: tempfile::TempDir,
    login_port: u16,
    certificate_port: u16,
    process: Child,
}

impl GuardedBroker {
    fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        make_certificate(folder.path(), "broker");
        make_certificate(folder.path(), "stranger");
        let [inner, login_port, certificate_port, controller] =
            std::array::from_fn(|_| free_port());
        let settings = folder.path().join("server.properties");
        let store = folder.path().display();
        let text = format!(
            "process.roles=broker,controller\n\
             node.id=1\n\
             controller.quorum.voters=1@127.0.0.1:{controller}\n\
             controller.listener.names=CONTROLLER\n\
             listeners=INNER://127.0.0.1:{inner},LOGIN://127.0.0.1:{login_port},CERT://127.0.0.1:{certificate_port},CONTROLLER://127.0.0.1:{controller}\n\
             advertised.listeners=INNER://127.0.0.1:{inner},LOGIN://127.0.0.1:{login_port},CERT://127.0.0.1:{certificate_port}\n\
             listener.security.protocol.map=INNER:PLAINTEXT,LOGIN:SASL_SSL,CERT:SSL,CONTROLLER:PLAINTEXT\n\
             inter.broker.listener.name=INNER\n\
             sasl.enabled.mechanisms=SCRAM-SHA-256,SCRAM-SHA-512\n\
             listener.name.login.scram-sha-256.sasl.jaas.config=org.apache.kafka.common.security.scram.ScramLoginModule required;\n\
             listener.name.login.scram-sha-512.sasl.jaas.config=org.apache.kafka.common.security.scram.ScramLoginModule required;\n\
             listener.name.cert.ssl.client.auth=required\n\
             ssl.keystore.type=PEM\n\
             ssl.keystore.location={store}/broker.pem\n\
             ssl.truststore.type=PEM\n\
             ssl.truststore.location={store}/broker.crt\n\
             log.dirs={store}/data\n\
             auto.create.topics.enable=true\n\
             offsets.topic.num.partitions=1\n\
             offsets.topic.replication.factor=1\n\
             transaction.state.log.num.partitions=1\n\
             transaction.state.log.replication.factor=1\n\
             transaction.state.log.min.isr=1\n\
             share.coordinator.state.topic.replication.factor=1\n\
             share.coordinator.state.topic.min.isr=1\n"
        );
        std::fs::write(&settings, text).unwrap();
        let mut format = java(folder.path());
        format.args([
            "kafka.tools.StorageTool",
            "format",
            "--cluster-id",
            "MkU3OEVBNTcwNTJENDM2Qk",
        ]);
        format.arg("--config").arg(&settings);
        for mechanism in ["SCRAM-SHA-256", "SCRAM-SHA-512"] {
            format.args([
                "--add-scram",
                &format!("{mechanism}=[name={USER},password={PASSWORD}]"),
            ]);
        }
        assert!(format.status().unwrap().success(), "its folder is laid out");
        let process = java(folder.path())
            .arg("kafka.Kafka")
            .arg(&settings)
            .spawn()
            .unwrap();
        Self {
            folder,
            login_port,
            certificate_port,
            process,
        }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn login(&self, mechanism: SaslMechanism, password: &str) -> KafkaSettings {
        let mut settings = own_settings(&format!("127.0.0.1:{}", self.login_port));
        let file = self.file(&format!("password-{}", password.len()));
        std::fs::write(&file, password).unwrap();
        settings.kafka_security = Security::SaslSsl;
        settings.kafka_sasl_mechanism = mechanism;
        settings.kafka_user = Some(USER.to_owned());
        settings.kafka_password_file = Some(file);
        settings.kafka_ca_file = Some(self.file("broker.crt"));
        settings
    }

    fn certificate(&self, holder: &str) -> KafkaSettings {
        let mut settings = own_settings(&format!("127.0.0.1:{}", self.certificate_port));
        settings.kafka_security = Security::Ssl;
        settings.kafka_ca_file = Some(self.file("broker.crt"));
        settings.kafka_certificate_file = Some(self.file(&format!("{holder}.crt")));
        settings.kafka_key_file = Some(self.file(&format!("{holder}.key")));
        settings
    }
}

impl Drop for GuardedBroker {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!(
                "{}",
                std::fs::read_to_string(self.file("log")).unwrap_or_default()
            );
        }
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

fn java(folder: &Path) -> Command {
    let services = std::env::var_os("FLUXGLOBE_SERVICES").map_or_else(
        || Path::new(&std::env::var_os("HOME").unwrap()).join(".cache/fluxglobe/services"),
        PathBuf::from,
    );
    let jars = services.join("kafka/lib/*");
    let log = std::fs::File::options()
        .create(true)
        .append(true)
        .open(folder.join("log"));
    let mut java = Command::new("java");
    let lines = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/services/kafka/log4j2.xml");
    java.args(["-Xmx256m", "-XX:+UseSerialGC", "-Dfluxglobe.log=WARN"])
        .arg(format!("-Dlog4j2.configurationFile={}", lines.display()))
        .arg("-cp")
        .arg(jars)
        .stdout(Stdio::null())
        .stderr(log.unwrap());
    java
}

/// A key with a certificate that vouches for itself, for this machine.
fn make_certificate(folder: &Path, name: &str) {
    let file = |kind: &str| folder.join(format!("{name}.{kind}"));
    let made = Command::new("openssl")
        .args([
            "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2",
        ])
        .args([
            "-subj",
            &format!("/CN={name}"),
            "-addext",
            "subjectAltName=IP:127.0.0.1",
        ])
        .arg("-keyout")
        .arg(file("key"))
        .arg("-out")
        .arg(file("crt"))
        .output()
        .expect("the program openssl is there");
    assert!(
        made.status.success(),
        "{}",
        String::from_utf8_lossy(&made.stderr)
    );
    let both = [file("key"), file("crt")].map(|path| std::fs::read(path).unwrap());
    std::fs::write(file("pem"), both.concat()).unwrap();
}

/// Makes topics, tells an event and reads it.
async fn use_it(settings: &KafkaSettings) {
    let until = Instant::now() + Duration::from_mins(1);
    while let Err(error) = create_topics(settings, 1).await {
        assert!(error.is_retryable() && Instant::now() < until, "{error}");
    }
    let log = KafkaLog::connect(settings).await.unwrap();
    log.append(&[notice("a")]).await.unwrap();
    assert_eq!(paths(&contents(&log, FROM).await.unwrap()), ["a"]);
}

async fn assert_refused(settings: &KafkaSettings, text: &str) {
    let start = Instant::now();
    let error = KafkaLog::connect(settings).await.err().unwrap();
    println!("{:.1} s: {error}", start.elapsed().as_secs_f64());
    assert!(matches!(error, StorageError::LogSetup { .. }), "{error}");
    let error = error.to_string();
    assert!(error.to_lowercase().contains(text), "{error}");
    assert!(!error.contains(PASSWORD), "{error}");
    assert!(start.elapsed() < Duration::from_secs(5));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn logins_and_certificates_open_the_door_and_wrong_ones_are_named() {
    let broker = GuardedBroker::start();
    use_it(&broker.login(SaslMechanism::ScramSha512, PASSWORD)).await;
    use_it(&broker.login(SaslMechanism::ScramSha256, PASSWORD)).await;
    use_it(&broker.certificate("broker")).await;

    let wrong = broker.login(SaslMechanism::ScramSha512, "wrong");
    assert_refused(&wrong, "authentication").await;
    let mut wrong = broker.login(SaslMechanism::Plain, PASSWORD);
    assert_refused(&wrong, "mechanism").await;
    wrong.kafka_ca_file = Some(broker.file("stranger.crt"));
    assert_refused(&wrong, "certificate").await;
    assert_refused(&broker.certificate("stranger"), "certificate").await;
    let mut garbled = broker.certificate("broker");
    garbled.kafka_ca_file = Some(broker.file("server.properties"));
    assert_refused(&garbled, "ca").await;

    // Brokers make topics by default when a producer asks for them: ours never asks for what is not there.
    let nothing = broker.login(SaslMechanism::ScramSha512, PASSWORD);
    for _ in 0..2 {
        assert_refused(&nothing, "is missing").await;
    }
}
