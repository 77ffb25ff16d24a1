//! What must be put right is told before any work is done.

use std::time::Duration;

use contract::topic::Topic;
use kafka_log::{KafkaLog, KafkaSettings, Security, create_topics};
use rdkafka::admin::{AdminOptions, NewPartitions};
use storage::StorageError;
use storage::log::EventLog as _;
use tokio::time::Instant;

use crate::own_topics::{admin, own_settings, remove, servers};

async fn refusal(settings: &KafkaSettings) -> StorageError {
    KafkaLog::connect(settings).await.err().unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_missing_topic_and_a_wrong_partition_count_are_named_with_what_to_do() {
    let settings = own_settings(&servers());
    let missing = refusal(&settings).await;
    assert!(matches!(missing, StorageError::LogSetup { .. }));
    let text = missing.to_string();
    assert!(
        text.contains("granule.notice is missing") && text.contains("topics create"),
        "{text}"
    );

    let made = create_topics(&settings, 1).await.unwrap();
    assert!(made.len() == Topic::ALL.len() && made.iter().all(|topic| topic.is_new));
    let again = create_topics(&settings, 1).await.unwrap();
    assert!(again.iter().all(|topic| !topic.is_new));
    KafkaLog::connect(&settings)
        .await
        .unwrap()
        .ready()
        .await
        .unwrap();

    let name = format!("{}{}", settings.kafka_topic_prefix, Topic::RenderJob);
    let options = AdminOptions::new().operation_timeout(Some(Duration::from_secs(10)));
    let more = [NewPartitions::new(&name, 3)];
    let more = admin(&settings).create_partitions(&more, &options).await;
    more.unwrap()[0].as_ref().unwrap();
    let until = Instant::now() + Duration::from_secs(10);
    let text = loop {
        match KafkaLog::connect(&settings).await {
            Err(wrong) => break wrong.to_string(),
            Ok(_not_yet) => assert!(Instant::now() < until, "the new partition is not seen"),
        }
    };
    assert!(
        text.contains("render.job has 3 partitions, 2 are wanted"),
        "{text}"
    );
    let text = create_topics(&settings, 1).await.unwrap_err().to_string();
    assert!(text.contains("3 partitions"), "{text}");
    remove(&settings).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broker_that_is_not_there_is_an_error_that_may_pass_within_the_limit() {
    // A port that nobody listens on: it was free a moment ago.
    let port = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let settings = own_settings(&format!("127.0.0.1:{port}"));
    let start = Instant::now();
    let error = refusal(&settings).await;
    assert!(error.is_retryable(), "{error}");
    assert!(error.to_string().contains("Connection refused"), "{error}");
    assert!(
        create_topics(&settings, 1)
            .await
            .unwrap_err()
            .is_retryable()
    );
    assert!(start.elapsed() < Duration::from_secs(25));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn settings_that_cannot_work_are_refused_before_any_broker_is_asked() {
    let start = Instant::now();
    let mut settings = own_settings("192.0.2.1:9092");
    settings.kafka_security = Security::SaslSsl;
    settings.kafka_user = Some("bob".to_owned());
    settings.kafka_password_file = Some("/nowhere/password".into());
    let refused = refusal(&settings).await;
    assert!(
        matches!(refused, StorageError::LogSetup { .. }),
        "{refused}"
    );
    assert!(
        refused.to_string().contains("--kafka-password-file"),
        "{refused}"
    );
    let unasked = settings.check().unwrap_err();
    assert_eq!(unasked.to_string(), refused.to_string());

    let mut settings = own_settings("192.0.2.1:9092");
    settings.kafka_security = Security::Ssl;
    settings.kafka_ca_file = Some(std::env::current_exe().unwrap());
    let refused = refusal(&settings).await;
    assert!(
        matches!(refused, StorageError::LogSetup { .. }),
        "{refused}"
    );

    let mut settings = own_settings("192.0.2.1:9092");
    settings.kafka = None;
    assert!(
        refusal(&settings)
            .await
            .to_string()
            .contains("--kafka (FLUXGLOBE_KAFKA) is needed")
    );
    assert!(start.elapsed() < Duration::from_secs(5));
}
