//! `fluxglobe executor`: tasks from the scheduler in, their results out.

use anyhow::Result;
use compute::service::Executor;

use crate::cli;
use crate::cli::Settings;
use crate::services::Footing;

pub(crate) async fn run(settings: &Settings, options: cli::Executor) -> Result<()> {
    let mut executor = options.ballista;
    if let Some(scheduler) = &settings.cluster {
        executor.scheduler = scheduler.parse()?;
    }
    let footing = Footing::take(
        settings,
        "executor",
        Some(options.admin),
        &["store", "scheduler"],
    )
    .await?;
    let Some(store) = footing.store().await? else {
        return footing.leave().await;
    };
    let executor = Executor::start(&executor, store, &footing.registry).await?;
    let readiness = executor.readiness();
    footing.board.set("scheduler", move || {
        let readiness = readiness.clone();
        async move { crate::services::worst(readiness.as_ref()).await }
    });
    let mut parts = footing.parts();
    parts.start("executor", executor.run(footing.stop.clone()));
    footing.run(parts).await
}
