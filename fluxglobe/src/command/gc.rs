//! `fluxglobe gc`: objects that no kept version needs and files of killed writers; listed, and removed unless only asked
//! about.

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
    for garbage in &plan.garbage {
        progress::result(&format!("{} {}", garbage.key, garbage.size_bytes))?;
    }
    for leftover in &plan.leftovers {
        progress::result(&format!("{} {}", leftover.path, leftover.size_bytes))?;
    }
    let summary = format!(
        "{} objects, {} half-written files, {:.1} MB; {} stay",
        plan.garbage.len(),
        plan.leftovers.len(),
        plan.size_bytes() as f64 / 1e6,
        plan.kept_count
    );
    if options.dry_run {
        progress::say(&format!("would remove {summary}"));
        return Ok(());
    }
    let bar = progress::bar("remove", plan.count() as u64);
    gc::run(&store, &plan, keep, &|done| bar.set_position(done as u64)).await?;
    progress::done(&bar, &summary);
    Ok(())
}
