//! Files of a product that are read anew from the store: planned, shown as a row, read, told of.

use std::path::Path;

use anyhow::Result;
use ingest::reread::{self, Plan, Reason, Request, Workplace};
use ingest::{Profile, Profiles};
use storage::Store;
use storage::log::EventLog;

use crate::cli::Recompute;
use crate::progress;

/// Most bytes of files on this machine's disk at a time.
const SPOOL_BYTES: u64 = 16 << 30;

/// The request, what it comes to, and what the work needs.
pub(super) struct Files {
    request: Request,
    workplace: Workplace,
    pub(super) plan: Plan,
}

impl Files {
    pub(super) async fn plan(store: &Store, options: &Recompute) -> Result<Self> {
        let mut settings = ingest::Settings::with_current_program()?;
        settings.parallel_files = usize::from(options.parallel_files);
        if let Some(folder) = &options.profiles {
            settings.profiles = Profiles::with_folder(folder)?;
        }
        let profile = match &options.profile {
            Some(name) if Path::new(name).is_file() => Some(Profile::load(Path::new(name))?),
            Some(name) => Some(settings.profiles.named(name)?),
            None => None,
        };
        let request = Request {
            product: options.product.clone(),
            from: options.from,
            to: options.to,
            profile,
            is_forced: options.force,
            is_verified: options.verify,
        };
        let plan = reread::plan(store, &settings.profiles, &request).await?;
        let workplace = Workplace::new(settings, options.spool.clone(), SPOOL_BYTES);
        Ok(Self {
            request,
            workplace,
            plan,
        })
    }

    /// Reads them, publishes what came out, and tells of it.
    pub(super) async fn read(&self, store: &Store, log: Option<&dyn EventLog>) -> Result<()> {
        if !self.plan.items.is_empty() {
            let bar = progress::bar("read anew", self.plan.items.len() as u64);
            let done = |count: usize| bar.set_position(count as u64);
            let published =
                reread::run(store, &self.plan, &self.request, &self.workplace, &done).await?;
            progress::done(&bar, &format!("{} files", self.plan.items.len()));
            match published {
                Some(manifest) => progress::result(&manifest.id().to_string())?,
                None => progress::say("every value is as it was: no new version"),
            }
        }
        if self.request.is_verified
            && let Some(mended) =
                reread::mend(store, &self.request.product, &self.workplace).await?
        {
            progress::say(&format!("{}: its domain is whole again", mended.id()));
        }
        // Also after a run that was killed before it could tell.
        if let Some(log) = log {
            let events = reread::events(store, &self.request.product).await?;
            storage::log::tell_each_once(log, &events).await?;
        }
        Ok(())
    }
}

/// A row of the table of what is to be done.
pub(super) fn row(plan: &Plan) -> [String; 4] {
    let count = |reason| {
        let of = plan.items.iter().filter(|item| item.reason == reason);
        of.count().to_string()
    };
    [
        "files".to_owned(),
        count(Reason::Missing),
        count(Reason::Stale),
        count(Reason::Forced),
    ]
}
