//! `fluxglobe executor`: tasks from the scheduler in, their results out.

use anyhow::Result;
use compute::service::Executor;

use crate::cli;
use crate::cli::Settings;
use crate::services::ServiceContext;

pub(crate) async fn run(settings: &Settings, options: cli::Executor) -> Result<()> {
    let mut executor = options.ballista;
    if let Some(scheduler) = &settings.cluster {
        executor.scheduler = scheduler.parse()?;
    }
    let context = ServiceContext::take(
        settings,
        "executor",
        Some(options.admin),
        &["store", "scheduler"],
    )
    .await?;
    let Some(store) = context.store().await? else {
        return context.leave().await;
    };
    let executor = Executor::start(&executor, store, &context.registry).await?;
    let readiness = executor.readiness();
    context.board.set("scheduler", move || {
        let readiness = readiness.clone();
        async move { crate::services::worst(readiness.as_ref()).await }
    });
    let mut parts = context.parts();
    parts.start("executor", executor.run(context.stop.clone()));
    context.run(parts).await
}
