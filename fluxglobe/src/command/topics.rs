//! `fluxglobe topics`: makes the topics of the event log on Kafka.

use anyhow::Result;

use crate::cli::Topics;
use crate::progress;

pub(crate) async fn run(command: Topics) -> Result<()> {
    let Topics::Create { replication, kafka } = command;
    for topic in kafka_log::create_topics(&kafka, replication.get()).await? {
        let how = if topic.is_new { "made" } else { "was there" };
        progress::result(&format!("{} {how}", topic.name))?;
    }
    Ok(())
}
