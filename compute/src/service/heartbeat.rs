//! Signs of life of an executor: one a second, however busy it is.
//!
//! Ballista's executor gives one with each request for work; with all hands busy that is every five seconds, too seldom
//! to tell a busy executor from a lost one within five.

use std::time::Duration;

use ballista_core::serde::protobuf::scheduler_grpc_client::SchedulerGrpcClient;
use ballista_core::serde::protobuf::{
    ExecutorRegistration, ExecutorStatus, HeartBeatParams, executor_status,
};
use tonic::transport::Channel;

use super::retry_channel::RetryChannel;

/// Between two signs of life.
const INTERVAL: Duration = Duration::from_secs(1);

/// Gives signs of life until it is dropped. The scheduler learns of the executor by its first request for work; signs
/// before that, and after a restart of the scheduler, are refused and forgotten.
pub(super) async fn run(
    channel: Channel,
    registration: ExecutorRegistration,
    retry_channel: RetryChannel,
) {
    let mut scheduler = SchedulerGrpcClient::new(channel);
    let mut ticks = tokio::time::interval(INTERVAL);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        if retry_channel.answer_count() == 0 {
            continue;
        }
        let sign = scheduler.heart_beat_from_executor(HeartBeatParams {
            executor_id: registration.id.clone(),
            metrics: vec![],
            status: Some(ExecutorStatus {
                status: Some(executor_status::Status::Active(String::new())),
            }),
            metadata: Some(registration.clone()),
        });
        match tokio::time::timeout(INTERVAL, sign).await {
            Ok(Ok(_seen)) => retry_channel.is_there(),
            Ok(Err(error)) => tracing::debug!(%error, "a sign of life was refused"),
            Err(_elapsed) => tracing::debug!("a sign of life was not answered"),
        }
    }
}
