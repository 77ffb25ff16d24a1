//! `fluxglobe scheduler`: Ballista's scheduler, and the deriver that keeps derived products up with what lands.

use anyhow::Result;
use compute::service::{Deriver, Scheduler};

use crate::cli;
use crate::cli::Settings;
use crate::deployment;
use crate::services::ServiceContext;

pub(crate) async fn run(settings: &Settings, options: cli::Scheduler) -> Result<()> {
    // Settings and secrets are looked at before anything is waited for.
    options.kafka.check()?;
    let parts = ["store", "event log", "scheduler"];
    let context = ServiceContext::take(settings, "scheduler", Some(options.admin), &parts).await?;
    let Some(store) = context.store().await? else {
        return context.leave().await;
    };
    let scheduler = Scheduler::start(&options.ballista, store.clone(), &context.registry).await?;
    let (readiness, address) = (scheduler.readiness(), scheduler.address());
    context.board.set("scheduler", move || {
        let readiness = readiness.clone();
        async move { crate::services::worst(readiness.as_ref()).await }
    });
    let engine = deployment::cluster(settings, store, &format!("http://{address}"))?;
    let mut parts = context.parts();
    // Executors and clients are served while the log is waited for.
    parts.start("scheduler", scheduler.run(context.stop.clone()));
    let own = context.clone();
    parts.start("deriver", async move {
        if let Some(log) = own.log(&options.kafka).await? {
            let deriver = Deriver::new(engine, log, &own.registry)?;
            deriver.run(own.stop.clone()).await?;
        }
        Ok::<_, anyhow::Error>(())
    });
    context.run(parts).await
}
