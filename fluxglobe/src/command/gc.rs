//! `fluxglobe gc`: objects that no kept version needs; listed, and removed unless only asked about.

use std::time::Duration;

use anyhow::Result;
use compute::gc::{self, Keep};

use crate::cli::{Gc, Settings};
use crate::command::notice;
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: &Gc) -> Result<()> {
    let store = deployment::store(settings)?;
    let keep = Keep {
        versions: usize::from(options.keep_versions.get()),
        age: Duration::from_hours(24) * u32::from(options.keep_days),
    };
    let plan = gc::plan(&store, keep, notice::now()?).await?;
    let size_bytes: u64 = plan.garbage.iter().map(|garbage| garbage.size_bytes).sum();
    for garbage in &plan.garbage {
        progress::result(&format!("{} {}", garbage.key, garbage.size_bytes))?;
    }
    let summary = format!(
        "{} objects, {:.1} MB; {} stay",
        plan.garbage.len(),
        size_bytes as f64 / 1e6,
        plan.kept_count
    );
    if options.dry_run {
        progress::say(&format!("would remove {summary}"));
        return Ok(());
    }
    let bar = progress::bar("remove", plan.garbage.len() as u64);
    gc::run(&store, &plan, keep, &|done| bar.set_position(done as u64)).await?;
    progress::done(&bar, &summary);
    Ok(())
}
