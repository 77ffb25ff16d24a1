//! Landing with a progress bar: files in, one event each through the log, outcomes out.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Result, bail};
use ingest::{IngestService, Outcome, Settings};
use storage::Store;
use storage::log::{EmbeddedLog, EventLog};

use crate::demo::source::{FILES_PER_SET, Set};
use crate::progress::LandingBar;

/// Have all sets landed with all their months?
pub(crate) async fn has_landed(store: &Store, sets: &[Set]) -> Result<bool> {
    for set in sets {
        let manifest = storage::manifests::latest(store, &set.product.parse()?).await?;
        if manifest.is_none_or(|manifest| manifest.steps.len() < FILES_PER_SET) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Sends a notice of every file through the log and lands what the notices say.
///
/// # Errors
/// A file was refused: the demo's own files all fit.
pub(crate) async fn land(store: &Store, log: &EmbeddedLog, files: &[PathBuf]) -> Result<()> {
    let service = IngestService::new(
        store.clone(),
        Arc::new(log.clone()) as Arc<dyn EventLog>,
        Settings::with_current_program()?,
    );
    service.notify(files, None, None).await?;
    let bar = LandingBar::new(files.len());
    let outcomes = service.drain(&bar).await?;
    let refused: Vec<_> = outcomes
        .iter()
        .filter(|outcome| outcome.is_rejected())
        .collect();
    bar.done(&format!(
        "{} files in {} products",
        outcomes.len() - refused.len(),
        count_products(&outcomes)
    ));
    match refused.first() {
        Some(first) => bail!("{} files were refused, the first: {first}", refused.len()),
        None => Ok(()),
    }
}

fn count_products(outcomes: &[Outcome]) -> usize {
    let products: BTreeSet<_> = outcomes
        .iter()
        .filter_map(|outcome| Some(&outcome.manifest()?.product))
        .collect();
    products.len()
}
