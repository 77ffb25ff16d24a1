//! `fluxglobe ingest`: files in; one line a file out, and an exit code other than 0 if one was refused.

use std::process::ExitCode;
use std::sync::Arc;

use anyhow::Result;
use contract::event::RejectReason;
use contract::index::DimensionIndex;
use contract::masked::MaskedCells;
use ingest::{IngestService, Outcome};
use observations::FileStore;
use serde::Serialize;
use storage::log::EventLog;

use super::behind::{say_what_is_behind, say_what_is_not_added_up};
use crate::cli::{Ingest, Settings};
use crate::progress::LandingBar;
use crate::sink::Sink;
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: Ingest) -> Result<ExitCode> {
    let store = deployment::store(settings)?;
    let log: Arc<dyn EventLog> = Arc::new(deployment::embedded_log(settings)?);
    let service = IngestService::new(
        store.clone(),
        log,
        ingest::Settings::with_current_program()?,
    )
    .with_observations(Arc::new(Sink(Arc::new(FileStore::new(store.clone())))));
    let files: Vec<_> = options
        .files
        .iter()
        .map(|file| std::path::absolute(file).unwrap_or_else(|_| file.clone()))
        .collect();
    let wishes = ingest::Wishes {
        profile: options.profile,
        product: options.product,
        variable: options.variable,
        indexes: DimensionIndex::sorted(options.index)?,
    };
    service.notify_of(&files, &wishes).await?;
    let bar = LandingBar::new(files.len());
    let outcomes = service.drain(&bar).await?;
    let refused = outcomes
        .iter()
        .filter(|outcome| outcome.is_rejected())
        .count();
    bar.done(&format!(
        "{} landed, {refused} refused",
        outcomes.len() - refused
    ));
    for outcome in &outcomes {
        if options.json {
            progress::result(&serde_json::to_string(&Line::of(outcome))?)?;
        } else if outcome.is_rejected() {
            progress::say(&format!("refused {outcome}"));
        } else {
            progress::result(&outcome.to_string())?;
        }
    }
    let landed = outcomes.iter().filter_map(|outcome| match outcome {
        Outcome::Landed { manifest, .. } => Some(&manifest.product),
        _ => None,
    });
    say_what_is_behind(&store, landed).await?;
    let new = outcomes.iter().filter_map(|outcome| match outcome {
        Outcome::Landed {
            manifest,
            revised: false,
            ..
        } => Some(&manifest.product),
        _ => None,
    });
    say_what_is_not_added_up(&store, new).await?;
    // What landed is there and told of; it is only read faster along time for this.
    cube::compacted().await;
    Ok(if refused == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// What became of a file, for machines.
#[derive(Serialize)]
struct Line {
    file: String,
    outcome: &'static str,
    manifest: Option<String>,
    reason: Option<RejectReason>,
    detail: Option<String>,
    /// Values that the file gave and that are none here, by why; absent of what did not land.
    #[serde(skip_serializing_if = "Option::is_none")]
    masked: Option<MaskedCells>,
    /// What was taken for granted of a file that lands, and which of its steps are left out; what of a file of observations is not read;
    /// absent if nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    assumptions: Vec<String>,
}

impl Line {
    fn of(outcome: &Outcome) -> Self {
        let (name, reason, detail) = match outcome {
            Outcome::Landed { revised: true, .. } => ("revised", None, None),
            Outcome::Landed { .. } => ("landed", None, None),
            Outcome::AlreadyLanded { .. } => ("already_landed", None, None),
            Outcome::Superseded { .. } => ("superseded", None, None),
            Outcome::Observed { .. } => ("observed", None, None),
            Outcome::Rejected {
                reason,
                object,
                detail,
                ..
            } => (
                "rejected",
                Some(*reason),
                Some(format!("{object}: {detail}")),
            ),
        };
        Self {
            file: outcome.file().display().to_string(),
            outcome: name,
            manifest: outcome.manifest().map(ToString::to_string),
            reason,
            detail,
            masked: outcome.masked(),
            assumptions: match outcome {
                Outcome::Landed { assumptions, .. } => assumptions.clone(),
                Outcome::Observed { passed_over, .. } => passed_over.clone(),
                _ => vec![],
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_of_a_file_is_told_to_machines_too() {
        let landed = |assumptions: Vec<String>| {
            let outcome = Outcome::Landed {
                file: "a.nc".into(),
                manifest: "p@1-5b70ea82".parse().unwrap(),
                periods: vec![],
                revised: false,
                profile: None,
                assumptions,
                masked: MaskedCells::default(),
            };
            serde_json::to_value(Line::of(&outcome)).unwrap()
        };
        let told = "p: holds no value in 2 of 3 steps";
        assert_eq!(landed(vec![told.to_owned()])["assumptions"][0], told);
        assert_eq!(landed(vec![]).get("assumptions"), None);
    }
}
