//! `fluxglobe topics`: makes the topics of the event log on Kafka, or lists them.

use anyhow::Result;
use kafka_log::KafkaLog;

use crate::cli::Topics;
use crate::progress;

pub(crate) async fn run(command: Topics) -> Result<()> {
    match command {
        Topics::Create { kafka, partitions, replication } => {
            let made = KafkaLog::create_topics(&kafka, partitions.get(), replication.get()).await?;
            for topic in made {
                progress::result(&topic.to_string())?;
            }
        }
    }
    Ok(())
}
